"""`gpsim prove`: concealed worlds, diagnosed blind."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import answer, console, say, say_all
from .options import CORES, KEPT, Jobs, LauncherWords, launcher_from_words, option, spread
from .progress import single_progress

if TYPE_CHECKING:
    from gpsim.launchers import Launcher

IN_FULL = ("packages", "strata", "families", "kinds", "confusion", "rivals")
"""Parts of prove.json that are long, and read there."""
prove_app = typer.Typer(
    cls=LauncherWords,
    invoke_without_command=True,
    help=(
        "Make machines with hidden defects, diagnose them blind, reveal the truth and score; or run one of these "
        "steps. Settings of the launcher select where it runs, such as launcher=slurm launcher.queue=main."
    ),
)
Out = Annotated[Path, typer.Option("--out", help="Folder of the blind test; finished trials in it are kept.")]


Answers = Annotated[
    Path | None, typer.Option("--answers", help="Where the answers are, if not in OUT/private.")
]
MISSES = {
    "rough": "{} of {} rough worlds not completely right, listed in the page",
    "machines": "{} of {} machines not completely right, listed in the page",
    "whole": "{} of {} whole robots not completely right, listed in the page",
    "afloat": "{} of {} floating or legged robots not completely right, listed in the page",
    "curves": "{} of {} laws outside the catalogue not completely right, listed in the page",
    "plans": "{} of {} worlds for plans missed",
    "mjcf": "{} misses of {} robots, listed in the page",
}
"""A line on each group of worlds beside the plain ones: how many misses of how many."""


@dataclass(frozen=True)
class Worlds:
    """Which worlds are drawn, and by how many processes."""

    trials: int = option(40, "--trials", min=0, help="How many worlds.")
    seed: int = option(1, "--seed", min=0, help="Seed of the worlds; 1 to 99 are for tuning.")
    jobs: Jobs = CORES
    stratum: list[str] | None = option(
        None,
        "--stratum",
        help="Only worlds of this kind: single, pair, triple, none, unknown; may be repeated.",
        autocompletion=completion.strata,
    )
    long: bool = option(True, "--long/--no-long", help="With the long recordings.")
    rough: int = option(0, "--rough", min=0, help="Number of worlds to add with the defects of real logs.")
    machines: int = option(
        0, "--machines", min=0, help="Number of whole machines to add: axes, rigs, cars, arms ..."
    )
    robots: int = option(
        0,
        "--robots",
        min=0,
        help="With --system mjcf: number of whole robots to add, with friction and rotor inertia at every joint.",
    )
    floating: int = option(
        0,
        "--floating",
        min=0,
        help="With --system mjcf: number of quadrotors, boats, hoppers and quadrupeds to add.",
    )
    curves: int = option(
        0, "--curves", min=0, help="Number of worlds to add with a law of one input that no family contains."
    )
    plan: int = option(
        0,
        "--plan",
        min=0,
        help="Number of worlds to add that test plans: does a plan decide sooner than a chirp?",
    )
    system: str | None = option(
        None,
        "--system",
        help="mjcf: robots whose simulator is a MuJoCo model, instead of the other worlds.",
    )

    def numbers(self) -> list[int]:
        """The numbers of the worlds; raises UsageError for options that do not go together."""
        from gpsim.stages import prove

        others = self.rough, self.machines, self.curves, self.plan
        if self.system not in (None, prove.MJCF):
            raise UsageError(
                f"--system {self.system}: unknown; use mjcf, or omit the option for worlds that gpsim simulates"
            )
        if self.system and (any(others) or not self.long):
            raise UsageError(
                "--system mjcf: its worlds cannot be combined with --rough, --machines, --curves, --plan and "
                "--no-long"
            )
        for name, count in (("--robots", self.robots), ("--floating", self.floating)):
            if count and not self.system:
                raise UsageError(f"{name}: such robots need --system mjcf; add it")
        if self.system:
            return prove.robots_numbers(self.trials, self.stratum or (), self.robots, self.floating)
        return prove.numbers_of(self.trials, self.stratum or (), self.long, *others)


@prove_app.callback()
@spread
def prove_command(
    *,
    context: typer.Context,
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the blind test.")] = None,
    worlds: Worlds,
) -> None:
    """Conceal worlds, diagnose them blind, reveal and score: a table; a page and prove.json below OUT."""
    if context.invoked_subcommand is not None:
        _refuse_options(context, context.invoked_subcommand)
        return
    if out is None:
        raise UsageError(
            "prove: name the folder with --out DIR; single steps: gpsim prove conceal | diagnose | reveal"
        )
    _conceal(context, out, worlds)
    diagnose_command(context, out, worlds.jobs)
    reveal_command(context, out, None, worlds.jobs)


def _launcher(context: typer.Context, jobs: int) -> Launcher:
    return launcher_from_words(context.meta.get(KEPT, ()), jobs)


def _refuse_options(context: typer.Context, step: str) -> None:
    """What stands before a step would be ignored."""
    for given in (given for given in context.command.params if given.name not in ("quiet", "as_json")):
        source = context.get_parameter_source(given.name or "")
        if source is not None and source.name == "COMMANDLINE":
            raise UsageError(
                f"prove: {'/'.join([*given.opts, *given.secondary_opts])} is before the step; put options after it: "
                f"gpsim prove {step} ..."
            )


@prove_app.command("conceal")
@spread
def conceal_command(*, context: typer.Context, out: Out, worlds: Worlds) -> None:
    """Draw worlds: recordings below OUT/public, answers below OUT/private, their hashes beside the recordings."""
    _conceal(context, out, worlds)


def _conceal(context: typer.Context, out: Path, worlds: Worlds) -> None:
    from gpsim.stages import prove

    numbers, launcher = worlds.numbers(), _launcher(context, worlds.jobs)
    with single_progress("conceal") as progress:
        prove.conceal(out, worlds.seed, numbers, launcher, progress)
    say(f"conceal: {len(numbers)} recordings in {out / 'public'}, answers in {out / 'private'}")
    answer({"public": out / "public", "answers": out / "private"}, seed=worlds.seed, worlds=len(numbers))


@prove_app.command("diagnose")
def diagnose_command(context: typer.Context, out: Out, jobs: Jobs = CORES) -> None:
    """Diagnose every recording in OUT/public, each in its own process and folder."""
    from gpsim.stages import prove

    launcher = _launcher(context, jobs)
    with single_progress("diagnose") as progress:
        count = prove.diagnose(out, launcher, progress)
    say(f"diagnose: {count} diagnoses in {out / 'diagnoses'}")
    answer({"diagnoses": out / "diagnoses"}, diagnoses=count)


@prove_app.command("reveal")
def reveal_command(context: typer.Context, out: Out, answers: Answers = None, jobs: Jobs = CORES) -> None:
    """Check every answer against its published hash, and score; refuses an answer that does not match."""
    from gpsim.reports.loop_page import terminal_table
    from gpsim.reports.prove_page import beside
    from gpsim.reports.prove_sheets import terminal_sheets
    from gpsim.stages import prove

    launcher = _launcher(context, jobs)
    with single_progress("reveal") as progress:
        content = prove.reveal(out, answers, launcher, progress)
    printer = console()
    for sheet in terminal_sheets(content):
        printer.print(terminal_table(sheet, {}))
    if plain := content["all"]["n"] + content["long"]["n"]:
        say(f"{len(content['misses'])} misses of {plain}, listed in the page")
    for part, said in MISSES.items():
        if (block := content.get(part)) is not None:
            say(said.format(len(block["misses"]), block["drawn" if part == "plans" else "n"]))
    say_all(beside(content))
    made = {"summary": out / "prove.json", "report": out / "report.html", "record": out / "record.md"}
    say(f"reveal: {', '.join(map(str, made.values()))}")
    answer(made, summary={key: value for key, value in content.items() if key not in IN_FULL})


@prove_app.command("answers")
def answers_command(out: Annotated[Path, typer.Argument(help="Folder of the proof.")]) -> None:
    """List the answers, one line per world, for the person who holds them."""
    from gpsim.stages import prove

    answers = prove.read_answers(out)
    answer({"answers": out / "private"}, answers=answers)
    for one in answers:
        world = one["world"]
        effects = "; ".join(
            f"{e['family']} on {e['on']} {_numbers(e)} ({_how_strong(e)})" for e in one["effects"]
        )
        rough = one.get("rough", one.get("machine"))
        share = f"; explained {rough['explained']:.3f}; {', '.join(rough['defects'])}" if rough else ""
        say(
            f"{one['trial']:04d} {one['stratum']:<7} {world['system']:<9} {world['noise_level']:<6} "
            f"{world['velocities'] or '':<14} {world['engine']:<6} {effects}{share}"
        )


def _how_strong(effect: dict[str, object]) -> str:
    if effect["outside"] and "visible" not in effect:
        return "nuisance"
    return f"{effect['strength']}{'' if effect.get('visible', True) else ', not visible'}"


def _numbers(effect: dict[str, object]) -> str:
    parts = [f"{k}={v:.4g}" for k, v in effect["parameters"].items()]  # type: ignore[attr-defined]
    parts += [f"{k} in {v}" for k, v in effect["region"].items()]  # type: ignore[attr-defined]
    return " ".join([*parts, *([f"since {effect['since']}"] if effect["since"] is not None else [])])
