"""The registry of simulators: one line a system, duplicates refused by the mapping itself."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.errors import UsageError
from gpsim.simulators.cartpole import CartPole
from gpsim.simulators.simulator import Simulator

SIMULATORS: Mapping[str, type[Simulator]] = {
    CartPole.name: CartPole,
}


def make_simulator(name: str) -> Simulator:
    """The simulator registered under `name`; raises UsageError with the alternatives."""
    if name not in SIMULATORS:
        raise UsageError(f"unknown simulator '{name}'; registered are: {', '.join(SIMULATORS)}")
    return SIMULATORS[name]()
