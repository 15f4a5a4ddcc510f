"""The registry of simulators: one line a system, duplicates refused by the mapping itself."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from gpsim.errors import UsageError, near
from gpsim.simulators.ackermann import Ackermann
from gpsim.simulators.cartpole import CartPole
from gpsim.simulators.pendulum import Pendulum
from gpsim.simulators.servo_joint import ServoJoint
from gpsim.simulators.simulator import Simulator
from gpsim.simulators.slider import Slider
from gpsim.simulators.unicycle import Unicycle
from gpsim.simulators.user import load_user_simulator

SIMULATORS: Mapping[str, type[Simulator]] = {
    CartPole.name: CartPole,
    Unicycle.name: Unicycle,
    Ackermann.name: Ackermann,
    Slider.name: Slider,
    Pendulum.name: Pendulum,
    ServoJoint.name: ServoJoint,
}


def source_file(name: str) -> Path | None:
    """The file that a user's own simulator comes from; None of a registered one, or of one in an environment."""
    return Path(name.rpartition(":")[0]) if ":" in name and not name.startswith("gym:") else None


def make_simulator(name: str) -> Simulator:
    """The simulator registered under `name`, or a user's own as FILE.py:ClassName; raises UsageError."""
    if ":" in name:
        return load_user_simulator(name)
    if name not in SIMULATORS:
        raise UsageError(
            f"unknown simulator '{name}'{near(name, SIMULATORS)}; registered are: {', '.join(SIMULATORS)}; "
            "your own: FILE.py:ClassName"
        )
    return SIMULATORS[name]()
