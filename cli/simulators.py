"""`gpsim simulators`: which there are, what one declares, and what a MuJoCo model is like."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from gpsim.errors import UsageError

from .answers import answer, say, say_all
from .everywhere import named

if TYPE_CHECKING:
    from gpsim.mjcf import Checked, Declared

simulators_app = typer.Typer(
    no_args_is_help=True,
    help="Simulators: those registered, your own, and MuJoCo models (needs gpsim[mujoco]).",
)
Name = Annotated[
    str,
    typer.Argument(
        metavar="SIMULATOR",
        help="A registered one, FILE.py:ClassName, robot.xml, robot.urdf, FILE.py:function or gym:ID.",
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
    """Which simulators there are."""
    from gpsim.simulators import SIMULATORS

    say_all(SIMULATORS)
    for written, what in OTHERS.items():
        say(f"{written:26} {what}")
    answer(registered=list(SIMULATORS), others=OTHERS)


@simulators_app.command("show")
def show_command(name: Name) -> None:
    """What a simulator declares: coordinates, state, actions, parameters, and what can be corrected."""
    from gpsim.mjcf import declared, open_simulator

    named(name)
    facts = declared(open_simulator(name))
    _tell(facts)
    answer(declared=asdict(facts))


@simulators_app.command("check")
def check_command(name: Name) -> None:
    """What a MuJoCo model is like: all that `show` says, its speed, its energy, what is hard to tell apart."""
    import numpy as np

    from gpsim.mjcf import MjcfSimulator, checked, declared, open_simulator

    named(name)
    simulator = open_simulator(name)
    if not isinstance(simulator, MjcfSimulator):
        raise UsageError(
            f"{name}: `check` is for MuJoCo models; `gpsim diagnose` tries equations of your own by itself"
        )
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
        say("confusable   nothing, where all joints move")
        return
    say("confusable (cosine of what they change):")
    for one, other, alike in facts.confusable[:MOST]:
        say(f"  {alike:.3f}  {one} and {other}")
    if len(facts.confusable) > MOST:
        say(f"  and {len(facts.confusable) - MOST} more pairs")


def _listed(units: dict[str, str]) -> str:
    return ", ".join(f"{name} [{unit}]" for name, unit in units.items())
