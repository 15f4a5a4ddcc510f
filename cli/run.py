"""`gpsim run full-loop`: the whole experiment in one command."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from gpsim.errors import UsageError
from gpsim.reports.sheets import literal

from .answers import answer, asked
from .cores import CORES
from .launching import launcher_of
from .options import ConfigDir, DryRun, Jobs, ShowConfig, Words, configured, show_standing, shown_words, told
from .printing import console, say
from .progress import Board, note, single_progress, warn

if TYPE_CHECKING:
    from gpsim.artifacts import Artifact

run_app = typer.Typer(no_args_is_help=True, help="Run several stages at once.")
Seeds = Annotated[int, typer.Option("--seeds", min=1, max=1000, help="Repeat with seed, seed + 1, ...")]
Reported = Annotated[
    int, typer.Option("--seeds", min=1, max=1000, help="Seeds of the finished loop: seed, seed + 1, ...")
]


@run_app.callback()
def _run() -> None:
    pass


@run_app.command("full-loop")
def full_loop(
    words: Words = None,
    seeds: Seeds = 1,
    jobs: Jobs = CORES,
    config_dir: ConfigDir = None,
    show_config: ShowConfig = False,
    dry_run: DryRun = False,
) -> None:
    """Run every stage and write the report; keep what exists with the same configuration and parents."""
    config = configured(words, config_dir, show_config)
    if dry_run:
        show_status(config, shown_words(words, config_dir), seeds)
        return
    # Imported here: torch takes seconds to load, and `--help` should not wait for it.
    from gpsim.reports.loop_page import terminal_notes, terminal_tables
    from gpsim.stages import full_loop as loop
    from gpsim.stages import report
    from gpsim.stages.stage import Request

    started = time.monotonic()
    request = Request(config, shown_words(words, config_dir))
    chosen = tuple(request.seed + i for i in range(seeds))
    launcher = launcher_of(config, jobs)
    jobs_done: list[dict[str, object]] = []
    with Board(len(loop.plan(request, chosen))) as board:

        def finished(job: str, artifact: Artifact, existed: bool) -> None:
            mark = Text("kept", "dim") if existed else Text("made", "green")
            board.finish(job, mark + literal(f" {job:<34} {artifact.path}"), existed)
            warn(artifact.path)
            jobs_done.append({"job": job, "folder": str(artifact.path.absolute()), "made": not existed})

        loop.run(request, chosen, launcher, board.update, finished)
        artifact, _ = report.stage_for(chosen).make(request)
        gathered = report.gather(request, chosen)
        tables, notes = terminal_tables(gathered), terminal_notes(gathered)
    note(f"finished in {time.monotonic() - started:.0f} s")
    answer(jobs=jobs_done)
    show_report(artifact.path, chosen, tables, notes)


@run_app.command("iterate")
def iterate(words: Words = None, config_dir: ConfigDir = None, show_config: ShowConfig = False) -> None:
    """Round after round: deploy the best policy, record, refit, train; what is there already is kept.

    rounds= says how many there are at most. It stops before where a round's policy gains no more over the best one than
    the standard error of that gain, on starts of the target that the evaluation does not use.
    """
    config = configured(words, config_dir, show_config)
    from gpsim.stages import iterate as iterating
    from gpsim.stages.stage import Request

    made: list[dict[str, object]] = []

    def told(what: str, artifact: Artifact, existed: bool) -> None:
        say(f"{'kept' if existed else 'made'} {what:<14} {artifact.path}")
        made.append({"job": what, "folder": str(artifact.path.absolute()), "made": not existed})

    with single_progress("iterate") as progress:
        artifact = iterating.run(Request(config, shown_words(words, config_dir), progress), told)
    notes = iterating.lines(artifact)
    for line in notes:
        say(f"  {line}")
    answer({"folder": artifact.path, "iteration": artifact.path / iterating.SUMMARY}, jobs=made, notes=notes)


def status_command(
    words: Words = None, seeds: Seeds = 1, config_dir: ConfigDir = None, show_config: ShowConfig = False
) -> None:
    """What is there of the configured loop, what would be made, and why: the setting, parent, file or code."""
    config = configured(words, config_dir, show_config)
    show_status(config, shown_words(words, config_dir), seeds)


def show_status(config: dict[str, Any], words: tuple[str, ...], seeds: int) -> None:
    """Print how it stands with a loop; nothing is written."""
    from gpsim.reports.runs_sheets import status_lines
    from gpsim.stages.runs import loop_status
    from gpsim.stages.stage import Request

    request = Request(config, words)
    found = loop_status(request, tuple(request.seed + i for i in range(seeds)))
    for line in status_lines(found):
        say(line)
    answer(status=asdict(found))


def show_report(folder: Path, seeds: tuple[int, ...], tables: list[Table], notes: list[str]) -> None:
    """Print the tables, then where the page and the summary lie."""
    printer = console()
    if not printer.is_terminal:
        printer = console(width=120)  # a log has no width of its own
    for table in tables:
        printer.print(table)
        printer.print()
    for line in notes:
        say(line)
    say(f"report: {folder / 'report.html'}")
    say(folder / "summary.json")  # the path alone on the last line, for programs
    if asked():
        from gpsim.stages.figures import evaluation_figures, paths_of

        figures = evaluation_figures(folder / "summary.json")
        answer(paths_of("report", folder), seeds=list(seeds), notes=told(notes), figures=figures)


Site = Annotated[
    bool, typer.Option("--site", help="A folder of pages instead: an index over all runs, and every report.")
]
SiteOut = Annotated[
    Path | None,
    typer.Option(
        "--out", help="With --site: the folder to make, <runs_dir>/site by default; a site there is replaced."
    ),
]


def report_command(
    words: Words = None,
    seeds: Reported = 1,
    site: Site = False,
    out: SiteOut = None,
    config_dir: ConfigDir = None,
    show_config: ShowConfig = False,
    dry_run: DryRun = False,
) -> None:
    """Tables, figures and one HTML page of a finished loop.

    With --site a folder of pages instead: an index over all runs, and every report.
    """
    config = configured(words, config_dir, show_config)
    if site and dry_run:
        raise UsageError(
            "report: --dry-run says what would be made in runs/; a site is a copy of what is there"
        )
    if site:
        _site(Path(str(config["runs_dir"])), out)
        return
    if out is not None:
        raise UsageError(
            "report: --out goes with --site; a report is an artifact and lies where runs_dir= says"
        )
    from gpsim.reports.loop_page import terminal_notes, terminal_tables
    from gpsim.stages import report
    from gpsim.stages.stage import Request

    request = Request(config, shown_words(words, config_dir))
    chosen = tuple(request.seed + i for i in range(seeds))
    if dry_run:
        show_standing(report.stage_for(chosen), request)
        return
    artifact, _ = report.stage_for(chosen).make(request)
    gathered = report.gather(request, chosen)
    show_report(artifact.path, chosen, terminal_tables(gathered), terminal_notes(gathered))


def _site(runs: Path, out: Path | None) -> None:
    from gpsim.stages.site import write_site

    index, notes = write_site(runs, out)
    say(f"site: {index}")
    for line in notes:
        say(f"  {line}")
    answer({"site": index}, notes=told(notes))
