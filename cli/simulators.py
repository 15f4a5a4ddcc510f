"""`gpsim simulators` and `gpsim effects`: which there are, what one says, and whether one of your own is right."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gpsim.errors import UsageError

from .answers import answer, say, say_all
from .everywhere import named, named_effects
from .progress import note

if TYPE_CHECKING:
    from gpsim.effects import Brought
    from gpsim.mjcf import Checked, Declared
    from gpsim.stages.try_effect import Recovered


simulators_app = typer.Typer(
    no_args_is_help=True,
    help="Simulators: built-in ones, your own, and MuJoCo models (which need the extra mujoco).",
)
Name = Annotated[
    str,
    typer.Argument(
        metavar="SIMULATOR",
        help="A built-in one, FILE.py:ClassName, robot.xml, robot.urdf, FILE.py:function or gym:ID.",
    ),
]
MOST = 12  # pairs that are told
OTHERS = {
    "FILE.py:ClassName": "equations of your own",
    "robot.xml, robot.urdf": "a MuJoCo model",
    "FILE.py:function": "that returns a mujoco.MjModel",
    "gym:ID": "a Gymnasium environment built on MuJoCo",
}


@simulators_app.command("list")
def list_command() -> None:
    """List the simulators."""
    from gpsim.simulators import SIMULATORS

    say_all(SIMULATORS)
    for written, what in OTHERS.items():
        say(f"{written:26} {what}")
    answer(registered=list(SIMULATORS), others=OTHERS)


@simulators_app.command("show")
def show_command(name: Name) -> None:
    """Show a simulator: coordinates, state, actions, parameters, and the effects that can be tested."""
    from gpsim.mjcf import declared, open_simulator

    named(name)
    facts = declared(open_simulator(name))
    _tell(facts)
    answer(declared=asdict(facts))


@simulators_app.command("check")
def check_command(name: Name) -> None:
    """Check a MuJoCo model: the output of `show`, its speed, its energy, and parameters that are hard to separate."""
    import numpy as np

    from gpsim.mjcf import MjcfSimulator, checked, declared, open_simulator

    named(name)
    simulator = open_simulator(name)
    if not isinstance(simulator, MjcfSimulator):
        raise UsageError(f"{name}: `check` is for MuJoCo models; `gpsim diagnose` checks your own equations")
    facts, tried = declared(simulator), checked(simulator, np.random.default_rng(0))
    _tell(facts)
    _tell_checked(tried)
    answer(declared=asdict(facts), checked=asdict(tried))


def _tell(facts: Declared) -> None:
    say(f"simulator    {facts.name}")
    for line in facts.notes:
        say(f"  not as its file says: {line}")
    say(f"coordinates  {_listed(facts.coordinates) or 'none'}")
    say(f"state        {_listed(facts.state)}")
    say(f"actions      {_listed(facts.actions) or 'none'}")
    parameters = [
        f"{name} = {value:.4g} {unit}".removesuffix(" 1") for name, (value, unit) in facts.parameters.items()
    ]
    say(f"parameters   {', '.join(parameters) or 'none'}")
    say("corrected by:")
    for family, places in facts.families.items():
        say(f"  {family:24} {', '.join(places)}")


def _tell_checked(facts: Checked) -> None:
    say(f"own step     {facts.step:g} s, {facts.steps_a_second:,.0f} steps a processor second")
    if facts.control_step is not None:
        say(f"control step {facts.control_step:g} s, {facts.control_step / facts.step:.0f} steps each")
    drift = "nothing moves" if facts.energy_drift is None else f"{facts.energy_drift:.2g} of what moves"
    say(f"energy       changes by {drift} in 1 s of free motion at its own step")
    if not facts.confusable:
        say("hard to separate: nothing, if all joints move")
        return
    say("hard to separate (cosine of their effects):")
    for one, other, alike in facts.confusable[:MOST]:
        say(f"  {alike:.3f}  {one} and {other}")
    if len(facts.confusable) > MOST:
        say(f"  and {len(facts.confusable) - MOST} more pairs")


def _listed(units: dict[str, str]) -> str:
    return ", ".join(f"{name} [{unit}]" for name, unit in units.items())


effects_app = typer.Typer(no_args_is_help=True, help="Effects: the catalogue's, and your own.")
EffectName = Annotated[str, typer.Argument(metavar="EFFECT", help="A family, or your own as FILE.py:Class.")]
Own = Annotated[str, typer.Argument(metavar="FILE.py[:Class]", help="Your own effect.")]
Of = Annotated[list[str] | None, typer.Option("--effects", metavar="FILE.py", help="Your own, too.")]


@effects_app.command("list")
def list_effects(effects: Of = None) -> None:
    """The catalogue: each effect, where it acts, and whether it is tested by default."""
    from gpsim.effects import CATALOGUE

    rows = [(f, e.site, "asked" if e.asked else "on request") for f, e in CATALOGUE.items()]
    rows += [(b.effect.family, b.effect.site, b.reference) for b in _every(effects)]
    for family, site, asked in rows:
        say(f"{family:24} {site:10} {asked}")
    answer(effects=[{"family": f, "site": s, "asked": a} for f, s, a in rows])


@effects_app.command("show")
def show_effect(name: EffectName) -> None:
    """Show an effect: its law, where it acts, its parameters, its reference."""
    from gpsim.effects import PLACE, effect_of

    effect = _one(name).effect if ".py" in name else effect_of(name)
    law = (type(effect).__doc__ or "").strip().partition("\n\n")[0].replace("\n", " ")
    said = {
        "family": effect.family,
        "law": " ".join(law.split()),
        "site": effect.site,
        "function of": effect.function_of,
        "asked": "always" if effect.asked else "on request",
    }
    for key, value in said.items():
        say(f"{key:12} {value}")
    declared = [p for variant in effect.variants for p in effect.parameters(PLACE, variant)]
    sizes = {p.name: {"unit": p.unit, "low": p.low, "high": p.high, "starts": p.starts} for p in declared}
    for parameter in {p.name: p for p in declared}.values():
        start = ", ".join(f"{s:.4g}" for s in parameter.starts)
        bounds = f"{parameter.low:.4g} to {parameter.high:.4g}"
        say(f"{'parameter':12} {parameter.name} [{parameter.unit}] {bounds}, a fit starts at {start}")
    answer(effect=said, parameters=sizes)


@effects_app.command("new")
def new_command(
    name: Annotated[str, typer.Argument(metavar="NAME", help="As small letters, as rubber_band.")],
    site: Annotated[
        str, typer.Option("--site", help="Where it acts: force, friction, actuator, drive, ...")
    ] = "force",
    out: Annotated[Path, typer.Option("--out", help="Folder to write to.")] = Path(),
) -> None:
    """Write NAME.py, a class whose law you replace, and test_NAME.py beside it."""
    from gpsim.effects import template
    from gpsim.files import disk_errors

    texts = template(name, site)
    for file in texts:
        if (out / file).exists():
            raise UsageError(
                f"{out / file}: exists already; choose another name, or another folder with --out"
            )
    with disk_errors(out, "--out"):
        out.mkdir(parents=True, exist_ok=True)
        for file, text in texts.items():
            (out / file).write_text(text, encoding="utf-8")
            say(f"{out / file}")
    say(f"next: gpsim effects check {out / f'{name}.py'}")
    answer(files=[out / file for file in texts])


@effects_app.command("check")
def check_effect(
    name: Own,
    simulator: Annotated[str | None, typer.Option("--simulator", help="Where it is tried.")] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Test the law only, without simulating and diagnosing a recording."),
    ] = False,
    keep: Annotated[
        Path | None, typer.Option("--keep", help="Write the simulated recording to this folder.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the world.")] = 0,
) -> None:
    """Check a law: shapes, numbers, rest; whether it is found again, and which effects would replace it."""
    from gpsim.effects import bring
    from gpsim.files import disk_errors, written_whole
    from gpsim.recordings import write_recording
    from gpsim.stages.try_effect import checks, recovered, systems_for, world_with

    brought, wrong = _one(name), 0
    for check in checks(brought, seed):
        wrong += bool(check.wrong)
        say(f"{check.question:32} {check.wrong or 'yes'}")
    if wrong:
        raise UsageError(f"{brought.reference}: {wrong} of the checks above failed for the law")
    bring([brought])
    model, on = systems_for(brought, simulator)
    if keep is not None:
        if keep.exists():
            raise UsageError(f"--keep {keep}: exists already; choose another folder")
        with disk_errors(keep, "--keep"), written_whole(keep) as folder:
            folder.mkdir(parents=True)
            write_recording(world_with(brought, model, on, seed)[0], folder)
        say(f"recording: {keep}")
    if quick:
        answer(effect=brought.effect.family, right=True)
        return
    note(f"a world of {model.name} with it is simulated and diagnosed twice: some tens of seconds")
    found = recovered(brought, model, on, seed)
    _tell_recovered(found)
    answer(effect=brought.effect.family, right=found.right, recovered=asdict(found))


def _tell_recovered(found: Recovered) -> None:
    sizes = ", ".join(f"{name} {got:.4g} of {true:.4g}" for name, (true, got) in found.sizes.items())
    told = f"{found.verdict}: {', '.join(found.said) or 'nothing'}{f' ({sizes})' if sizes else ''}"
    say(f"{'recovered from a world with it':32} {'yes, ' if found.right else 'no, '}{told}")
    others = f"{', '.join(found.instead) or 'nothing'} explains {100 * found.explained:.1f} % without it"
    say(f"{'hard to separate from':32} {others if found.confusable else f'nothing: {others}'}")


def _one(name: str) -> Brought:
    """The user's effect; consent goes with naming it."""
    found = _every([name])
    if len(found) != 1:
        raise UsageError(f"{name}: has {', '.join(b.reference for b in found)}; name one of them")
    return found[0]


def _every(references: list[str] | None) -> list[Brought]:
    from gpsim.effects import installed, read_effects

    given = named_effects(references)
    return [*(installed() if not references else ()), *(b for r in given for b in read_effects(r))]
