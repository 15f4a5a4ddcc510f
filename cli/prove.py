"""`gpsim prove`: concealed worlds, diagnosed blind."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gpsim.errors import UsageError

from . import completion
from .answers import NAME as AS_JSON
from .answers import answer
from .cores import CORES
from .launching import KEPT, LauncherWords, launcher_from_words
from .options import Jobs
from .printing import console, say
from .progress import single_progress
from .quiet import NAME as QUIET

if TYPE_CHECKING:
    from gpsim.launchers import Launcher

IN_FULL = ("packages", "strata", "families", "kinds", "confusion", "rivals")
"""Parts of prove.json that are long, and read there."""
prove_app = typer.Typer(
    cls=LauncherWords,
    invoke_without_command=True,
    help=(
        "Make machines with hidden defects, diagnose them blind, reveal the truth and score; or one of these steps. "
        "Settings of the launcher say where it runs, such as launcher=slurm launcher.queue=main."
    ),
)
Trials = Annotated[int, typer.Option("--trials", min=0, help="How many worlds.")]
Rough = Annotated[
    int, typer.Option("--rough", min=0, help="How many worlds with the defects of real logs to add.")
]
Machines = Annotated[
    int,
    typer.Option(
        "--machines",
        min=0,
        help="How many whole machines to add: axes, rigs, servos, cars, arms.",
    ),
]
Robots = Annotated[
    int,
    typer.Option(
        "--robots",
        min=0,
        help="With --system mjcf: how many whole robots to add, friction and a rotor at every joint.",
    ),
]
Curves = Annotated[
    int,
    typer.Option(
        "--curves", min=0, help="How many worlds to add with a law of one input that no family has."
    ),
]
Plans = Annotated[
    int,
    typer.Option(
        "--plan",
        min=0,
        help="How many worlds to add that a slow recording leaves open: does a plan decide, sooner than a chirp?",
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Worlds are drawn from it; 1 to 99 are for tuning.")]
Out = Annotated[Path, typer.Option("--out", help="Folder of the proof; what is finished in it is kept.")]
Strata = Annotated[
    list[str] | None,
    typer.Option(
        "--stratum",
        help="Only worlds of this kind: single, pair, triple, none, unknown; may be repeated.",
        autocompletion=completion.strata,
    ),
]
System = Annotated[
    str | None,
    typer.Option(
        "--system", help="mjcf: worlds of robots whose simulator is a MuJoCo model, instead of the others."
    ),
]
Answers = Annotated[
    Path | None, typer.Option("--answers", help="Where the answers are, if not in OUT/private.")
]
Long = Annotated[bool, typer.Option("--long/--no-long", help="With the long recordings.")]


@prove_app.callback()
def prove_command(
    context: typer.Context,
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the proof; it is resumed.")] = None,
    trials: Trials = 40,
    seed: Seed = 1,
    jobs: Jobs = CORES,
    stratum: Strata = None,
    long: Long = True,
    rough: Rough = 0,
    machines: Machines = 0,
    robots: Robots = 0,
    curves: Curves = 0,
    plan: Plans = 0,
    system: System = None,
) -> None:
    """Conceal worlds, diagnose them blind, reveal and score: a table; a page and prove.json below OUT."""
    if context.invoked_subcommand is not None:
        _refuse_options(context, context.invoked_subcommand)
        return
    if out is None:
        raise UsageError(
            "prove: say where with --out DIR; steps of it: gpsim prove conceal | diagnose | reveal"
        )
    conceal_command(
        context, out, trials, seed, jobs, stratum, long, rough, machines, robots, curves, plan, system
    )  # fmt: skip
    diagnose_command(context, out, jobs)
    reveal_command(context, out, None, jobs)


def _launcher(context: typer.Context, jobs: int) -> Launcher:
    return launcher_from_words(context.meta.get(KEPT, ()), jobs)


def _refuse_options(context: typer.Context, step: str) -> None:
    """What stands before a step would be ignored."""
    for option in (option for option in context.command.params if option.name not in (QUIET, AS_JSON)):
        source = context.get_parameter_source(option.name or "")
        if source is not None and source.name == "COMMANDLINE":
            raise UsageError(
                f"prove: {'/'.join([*option.opts, *option.secondary_opts])} stands before the step; "
                f"options go behind it: gpsim prove {step} ..."
            )


@prove_app.command("conceal")
def conceal_command(
    context: typer.Context,
    out: Out,
    trials: Trials = 40,
    seed: Seed = 1,
    jobs: Jobs = CORES,
    stratum: Strata = None,
    long: Long = True,
    rough: Rough = 0,
    machines: Machines = 0,
    robots: Robots = 0,
    curves: Curves = 0,
    plan: Plans = 0,
    system: System = None,
) -> None:
    """Draw worlds: recordings below OUT/public, answers below OUT/private, their hashes beside the recordings."""
    from gpsim.stages import prove

    if system not in (None, prove.MJCF):
        raise UsageError(
            f"--system {system}: there is mjcf, and without the option the worlds that gpsim simulates"
        )
    if system and (rough or machines or curves or plan or not long):
        raise UsageError(
            "--system mjcf: its worlds are neither rough nor long nor machines nor curves nor for plans; "
            "leave --rough, --machines, --curves, --plan and --no-long out"
        )
    if robots and not system:
        raise UsageError("--robots: whole robots are worlds of --system mjcf; say that, too")
    if system:
        numbers = prove.robots_numbers(trials, stratum or (), robots)
    else:
        numbers = prove.numbers_of(trials, stratum or (), long, rough, machines, curves, plan)
    launcher = _launcher(context, jobs)
    with single_progress("conceal") as progress:
        prove.conceal(out, seed, numbers, launcher, progress)
    say(f"conceal: {len(numbers)} recordings in {out / 'public'}, answers in {out / 'private'}")
    answer({"public": out / "public", "answers": out / "private"}, seed=seed, worlds=len(numbers))


@prove_app.command("diagnose")
def diagnose_command(context: typer.Context, out: Out, jobs: Jobs = CORES) -> None:
    """Diagnose every recording in OUT/public, each in a process and folder that hold nothing else."""
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
    from gpsim.reports.prove_sheets import beside, terminal_sheets
    from gpsim.stages import prove

    launcher = _launcher(context, jobs)
    with single_progress("reveal") as progress:
        content = prove.reveal(out, answers, launcher, progress)
    printer = console()
    for sheet in terminal_sheets(content):
        printer.print(terminal_table(sheet, {}))
    if plain := content["all"]["n"] + content["long"]["n"]:
        say(f"{len(content['misses'])} misses of {plain}, listed in the page")
    if "rough" in content:
        misses, worlds = len(content["rough"]["misses"]), content["rough"]["n"]
        say(f"{misses} of {worlds} rough worlds not right in all, listed in the page")
    if "machines" in content:
        say(
            f"{len(content['machines']['misses'])} of {content['machines']['n']} machines not right in all, "
            "listed in the page"
        )
    if "whole" in content:
        misses, worlds = len(content["whole"]["misses"]), content["whole"]["n"]
        say(f"{misses} of {worlds} whole robots not right in all, listed in the page")
    if "curves" in content:
        misses, worlds = len(content["curves"]["misses"]), content["curves"]["n"]
        say(f"{misses} of {worlds} laws of no family not right in all, listed in the page")
    if "plans" in content:
        say(f"{len(content['plans']['misses'])} of {content['plans']['drawn']} worlds for plans missed")
    if "mjcf" in content:
        say(f"{len(content['mjcf']['misses'])} misses of {content['mjcf']['n']} robots, listed in the page")
    for line in beside(content):
        say(line)
    say(f"reveal: {out / 'prove.json'}, {out / 'report.html'}, {out / 'record.md'}")
    made = {"summary": out / "prove.json", "report": out / "report.html", "record": out / "record.md"}
    answer(made, summary={key: value for key, value in content.items() if key not in IN_FULL})


@prove_app.command("answers")
def answers_command(out: Annotated[Path, typer.Argument(help="Folder of the proof.")]) -> None:
    """List the answers, one line a world: for those who hold them."""
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
