"""A bare table beside a simulator: the simulator says what its columns are, and how it steps."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TypedDict

import pandas as pd

from gpsim.channels import Channels
from gpsim.recordings import Recording, read_bare_table, recording_of
from gpsim.simulators import SIMULATORS, Simulator


class _Described(TypedDict):
    system: str
    state: Channels
    action: Channels
    parameters: dict[str, float]
    optional: Collection[str]
    integrator: str


def read_table(path: Path, simulator: Simulator) -> Recording:
    """A CSV or Parquet file of the simulator's channels; raises UsageError."""
    return read_bare_table(path, **_described(simulator))


def table_recording(
    table: pd.DataFrame, where: str, simulator: Simulator, dt: float | None = None
) -> Recording:
    """A table that is there already, which messages call `where`; dt: as for `recording_of`."""
    return recording_of(table, where, dt=dt, **_described(simulator))


def _described(simulator: Simulator) -> _Described:
    """Its channels, of which those may be absent that a diagnosis can estimate."""
    return {
        "system": simulator.name,
        "state": simulator.state,
        "action": simulator.action,
        "parameters": simulator.defaults(),
        "optional": simulator.state.names if simulator.name in SIMULATORS else _optional(simulator),
        "integrator": simulator.integrator,
    }


def _optional(simulator: Simulator) -> tuple[str, ...]:
    """States that a bare table need not have: those with a guess, and the velocities of a MuJoCo model."""
    speeds = tuple(c.velocity for c in simulator.coordinates) if simulator.guesses_speeds else ()
    return (*simulator.start, *speeds)
