"""One stage, several at once, and how they stand: `gpsim collect` ..., `run`, `sweep`, `status`, `report`."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gpsim.errors import UsageError

from . import options
from .answers import answer, asked, console, say, say_all
from .options import CORES, ConfigDir, DryRun, Jobs, Out, Setup, launcher_of, run_stage, spread
from .progress import Board, note

if TYPE_CHECKING:
    from gpsim.artifacts import Artifact
    from gpsim.stages.stage import Request

run_app = typer.Typer(no_args_is_help=True, help="Run several stages at once.")
Seeds = Annotated[int, typer.Option("--seeds", min=1, max=1000, help="Repeat with seed, seed + 1, ...")]
PANEL = "Stages, in order"
LOOP = {
    "train-source": (
        "Train a policy in the base simulator.",
        "variant=source|randomised|target: the base simulator, the same with random parameters, or the target.",
    ),
    "build-residuals": (
        "Subtract the prediction from the recording, rate by rate.",
        "recording=DIR uses another recording than that of `collect`.",
    ),
    "fit-gp": ("Fit one Gaussian process per rate to the residuals.", ""),
    "train-gp-policy": (
        "Train a policy in the corrected simulator.",
        "correction=gp|effects|effects+gp selects the correction, prediction=mean|sample the use of the Gaussian "
        "process; robustness=posterior draws a simulator per episode from the posterior of the diagnosis.",
    ),
    "certify": ("Search for the starts of the evaluation that can be solved.", ""),
    "evaluate": (
        "Compare policies and simulators on the target.",
        "One step, rollouts and returns; deployed=BAG scores recorded deployments instead.",
    ),
}
"""A line for `gpsim --help`, and what the command's own help adds."""


@run_app.callback()
def _run() -> None:
    pass


def _seeds(request: Request, count: int) -> tuple[int, ...]:
    return tuple(request.seed + i for i in range(count))


@run_app.command("full-loop")
@spread
def full_loop(*, seeds: Seeds = 1, jobs: Jobs = CORES, setup: Setup, dry_run: DryRun = False) -> None:
    """Run every stage and write the report; keep what exists with the same configuration and parents."""
    request = setup.request()
    if dry_run:
        show_status(request, seeds)
        return
    # Imported here: torch takes seconds to load, and `--help` should not wait for it.
    from gpsim.stages import full_loop as loop

    started = time.monotonic()
    chosen, launcher = _seeds(request, seeds), launcher_of(setup.config, jobs)
    with Board(len(loop.plan(request, chosen))) as board:
        loop.run(request, chosen, launcher, board)
        show = _reported(request, chosen)
    note(f"finished in {time.monotonic() - started:.0f} s")
    answer(jobs=board.finished)
    show()


class Rounds(Board):
    """All jobs of all rounds on one bar; what they made is the result."""

    def update(self, job: str, done: int, total: int, note: str) -> None:
        """As one job."""
        super().update("iterate", done, total, note)

    def made(self, job: str, artifact: Artifact, existed: bool) -> None:
        """A line each."""
        say(f"{'kept' if existed else 'made'} {job:<14} {artifact.path}")
        self.keep(job, artifact, existed)


@run_app.command("iterate")
@spread
def iterate(*, setup: Setup) -> None:
    """Repeat the loop: deploy the best policy, record, refit, train; existing artifacts are kept.

    rounds= limits their number. It stops early when a round gains no more than the standard error of the
    gain, on starts of the target that the evaluation does not use.
    """
    request, launcher = setup.request(), launcher_of(setup.config, 0)
    from gpsim.stages import iterate as iterating

    with Rounds() as rounds:
        artifact = iterating.run(request, launcher, rounds)
    notes = iterating.lines(artifact)
    say_all(notes, "  ")
    paths = {"folder": artifact.path, "iteration": artifact.path / iterating.SUMMARY}
    answer(paths, jobs=rounds.finished, notes=notes)


@spread
def status_command(*, seeds: Seeds = 1, setup: Setup) -> None:
    """Show which artifacts of the loop exist, which would be made, and why: the setting, parent, file or code."""
    show_status(setup.request(), seeds)


def show_status(request: Request, seeds: int) -> None:
    """Print how it stands with a loop; nothing is written."""
    from gpsim.reports.runs_text import status_lines
    from gpsim.stages.runs import loop_status

    found = loop_status(request, _seeds(request, seeds))
    say_all(status_lines(found))
    answer(status=asdict(found))


def _reported(request: Request, seeds: tuple[int, ...]) -> Callable[[], None]:
    """Make the report; the function that prints its tables, then where the page and the summary lie."""
    from gpsim.reports.loop_page import terminal_notes, terminal_tables
    from gpsim.stages import report
    from gpsim.stages.figures import evaluation_figures, paths_of

    artifact, gathered = report.made(request, seeds)
    folder = artifact.path
    tables, notes = terminal_tables(gathered), terminal_notes(gathered)

    def show() -> None:
        printer = console(width=120)
        for table in tables:
            printer.print(table)
            printer.print()
        say_all(notes)
        say(f"report: {folder / 'report.html'}")
        say(folder / "summary.json")  # the path alone on the last line, for programs
        if asked():
            figures = evaluation_figures(folder / "summary.json")
            answer(paths_of("report", folder), seeds=list(seeds), notes=options.told(notes), figures=figures)

    return show


@spread
def report_command(
    *,
    seeds: int = typer.Option(
        1, "--seeds", min=1, max=1000, help="Seeds of the finished loop: seed, seed + 1, ..."
    ),
    setup: Setup,
    dry_run: DryRun = False,
) -> None:
    """Tables, figures and one HTML page of a finished loop."""
    request = setup.request()
    chosen = _seeds(request, seeds)
    if dry_run:
        from gpsim.stages.report import stage_for

        options.show_standing(stage_for(chosen), request)
        return
    _reported(request, chosen)()


def sweep_command(
    words: list[str] | None = typer.Argument(
        None,
        metavar="[KEY=VALUE]...",
        help="Settings; several values make a sweep: gp.n_train=100,250 seed=range(10).",
    ),
    of: str = typer.Option("evaluate", "--of", help="The stage to run at every point, with all its inputs."),
    jobs: Jobs = CORES,
    config_dir: ConfigDir = None,
    dry_run: DryRun = False,
) -> None:
    """One stage for every combination of settings, in Hydra's sweep grammar; a table and a page at the end."""
    from .sweep import points_of, resolved

    points = resolved(points_of(words or []), config_dir)
    launcher = launcher_of(points[0].request.config, jobs)
    from gpsim.stages import full_loop as loop  # torch takes seconds to load

    plan = loop.grid_of(points, of)
    say(f"sweep: {len(points)} points, {len(plan.jobs)} jobs")
    answer(of=of, points=len(points), jobs=len(plan.jobs))
    if dry_run:
        answer(dry_run=True)
        return
    with Board(len(plan.jobs)) as board:
        artifact, missing = loop.run_grid(plan, launcher, board)
    note(f"columns of the table: the varied settings, the figures of {of}, sha256, error")
    made = {"table": loop.CSV, "parquet": loop.PARQUET, "report": loop.PAGE}
    paths = {name: artifact.path / file for name, file in made.items()}
    say(f"sweep: {paths['report']}, {paths['parquet']}")
    say(paths["table"])  # the path alone on the last line, for programs
    answer({"folder": artifact.path} | paths, swept=list(points[0].swept))
    if missing:
        raise UsageError(
            f"{missing} of {len(points)} points failed; the table says why. To continue, run the same command again"
        )


@spread
def collect_command(
    *,
    setup: Setup,
    out: Out = None,
    plan: Path | None = typer.Option(
        None,
        "--plan",
        help="Play this finished plan of `gpsim plan` on the target. If the file does not exist, only write "
        "the commands of the sweep to it, for a robot to play.",
    ),
    dry_run: DryRun = False,
) -> None:
    """Record episodes of the target, or import logs of it (collect.source=my.bag)."""
    config = setup.config
    # Imported here: rosbags takes a second to load, and `--help` should not wait for it.
    if plan is None:
        from gpsim.stages.registry import STAGES

        run_stage(STAGES["collect"], setup, out, dry_run)
    elif plan.is_dir():
        from gpsim.stages.plan import play_stage

        run_stage(play_stage(plan), setup, out, dry_run)
    elif dry_run:
        raise UsageError("collect: --dry-run cannot be combined with --plan, which makes no recording")
    else:
        from gpsim.stages.collect import write_plan

        rows = write_plan(config, plan)
        say(f"collect: {plan}, {rows} commands, one a control step")
        answer({"plan": plan}, rows=rows)


def add_stages(app: typer.Typer) -> None:
    """One command a stage, in the order of the loop."""
    for name, (line, more) in LOOP.items():
        app.command(name, help=f"{line}\n\n{more}", short_help=line, rich_help_panel=PANEL)(_command(name))
        if name == "train-source":
            short = "Record episodes of the target, or import logs of it."
            app.command("collect", short_help=short, rich_help_panel=PANEL)(collect_command)


def _command(name: str) -> Callable[..., None]:
    @spread
    def command(*, setup: Setup, out: Out = None, dry_run: DryRun = False) -> None:
        setup.request()  # before torch is loaded, which takes seconds: --show-config and bad words end here
        from gpsim.stages.registry import STAGES

        run_stage(STAGES[name], setup, out, dry_run)

    return command
