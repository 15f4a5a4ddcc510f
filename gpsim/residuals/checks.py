"""What a recording must be to go with a simulator; what is not is one UsageError that says where and what to do.

A bare table beside a simulator: the simulator says what its columns are, and how it steps.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gpsim.channels import Channels
from gpsim.errors import UsageError
from gpsim.recordings import Described, Recording, evenly, read_bare_table, recording_of
from gpsim.simulators import SIMULATORS, Simulator

if TYPE_CHECKING:
    import pandas as pd

RATES_LOOKED_AT = 300  # recorded rows at which a simulator's rates must be finite, beside the extreme ones
OWN_DT = 0.1  # relative difference that jitter may make between a recording's dt and its median step


def check_clock(recording: Recording) -> None:
    """The recording's dt must be its clock's usual step: gaps, delays and rollouts are counted in it."""
    steps = recording.transitions().dt
    if not len(steps):
        return
    usual = float(np.median(steps))
    if abs(usual - recording.dt) > OWN_DT * recording.dt:
        raise UsageError(
            f"the recording says dt {recording.dt:g} s, but the median step of its t is {usual:g} s: write dt: "
            f"{usual:.6g} in its recording.yaml if t is right, or correct t (in seconds)"
        )


def check_match(recording: Recording, simulator: Simulator, *, hidden: Collection[str] = ()) -> None:
    """The recording must hold the simulator's channels, in its units and order; `hidden` ones may be absent."""
    expected = Channels(tuple(channel for channel in simulator.state if channel.name not in hidden))
    for kind, has, needs in (
        ("state", recording.state, expected),
        ("action", recording.action, simulator.action),
    ):
        if has.same_as(needs):
            continue
        absent = [c for c in needs if c.name not in has.names]
        remedy = "import the log with a mapping to these channels"
        built_in = (
            (simulator.guesses_speeds or simulator.name in SIMULATORS)
            and kind == "state"
            and len(absent) < len(needs)
        )
        if absent and (all(c.name in simulator.start for c in absent) or built_in):
            remedy = "only `gpsim diagnose` estimates unmeasured states"
        elif kind == "action" and not len(has):
            remedy = "only `gpsim diagnose` sets unrecorded commands to 0"
        elif kind == "state" and absent and len(absent) < len(needs):
            guesses = ", ".join(f'"{c.name}": VALUE' for c in absent)
            remedy += f"; or, in your own system, give an initial guess: start = {{{guesses}}}"
        raise UsageError(
            f"the recording's {kind} is {has.listed()}, simulator {simulator.name} needs {needs.listed()}; {remedy}"
        )


def check_rates(recording: Recording, simulator: Simulator, parameters: Mapping[str, float]) -> None:
    """The simulator must give finite rates where the recording has been: a root of a noisy level is no number.

    Looked at are rows evenly spread, and those at which a channel is least and greatest. The recording must hold all of
    the simulator's channels.
    """
    rows = recording.transitions()
    if not len(rows):
        return
    inputs = np.hstack([rows.states, rows.actions])
    extremes = (inputs.argmin(axis=0), inputs.argmax(axis=0))
    looked = np.unique(np.concatenate([evenly(len(rows), RATES_LOOKED_AT), *extremes]))
    some = rows.take(looked)
    with np.errstate(all="ignore"):
        rates = simulator.rates(some.states, some.actions, parameters)
    bad = np.argwhere(~np.isfinite(rates))
    if not len(bad):
        return
    at, column = (int(i) for i in bad[0])
    raise not_finite(recording, simulator, simulator.rate.names[column], rates[at, column], looked[at])


def not_finite(
    recording: Recording, simulator: Simulator, what: str, value: float, transition: int
) -> UsageError:
    """The error that says at which of the recording's transitions `what` came out as `value`."""
    rows = recording.transitions()
    episode = int(rows.episode[transition])
    row = int(transition - np.searchsorted(rows.episode, episode))
    names = (*recording.state.names, *recording.action.names)
    been = (*rows.states[transition], *rows.actions[transition])
    where = ", ".join(f"{name}={number:g}" for name, number in zip(names, been, strict=True))
    return UsageError(
        f"simulator {simulator.name}: {what} is not finite ({value:g}) at episode {recording.episodes[episode].name}, "
        f"row {row} ({where}); protect roots, logarithms and divisions, as np.sqrt(np.maximum(x, 0.0))"
    )


def check_varies(recording: Recording) -> None:
    """A channel that never changes teaches nothing and usually is a dead sensor: name it."""
    channels = (*recording.state.names, *recording.action.names)
    rows = np.concatenate([np.hstack([e.states[:-1], e.actions]) for e in recording.episodes])
    constant = np.flatnonzero(np.ptp(rows, axis=0) == 0.0) if len(rows) else np.arange(len(channels))
    if constant.size:
        column = int(constant[0])
        first, last = recording.episodes[0].name, recording.episodes[-1].name
        value = f"{rows[0, column] + 0.0:g}" if len(rows) else "absent"
        more = "; a part that is held on purpose needs a simulator without it (--simulator FILE.py:ClassName)"
        if column >= len(recording.state):
            more = ": a command that never changes gives no information"
        raise UsageError(
            f"channel {channels[column]} is constant ({value}) from episode {first}, row 0 to episode {last}, "
            f"row {len(recording.episodes[-1])}: check the sensor, or record data in which it moves{more}"
        )


def read_table(path: Path, simulator: Simulator) -> Recording:
    """A CSV or Parquet file of the simulator's channels; raises UsageError."""
    return read_bare_table(path, _described(simulator))


def table_recording(
    table: pd.DataFrame, where: str, simulator: Simulator, dt: float | None = None
) -> Recording:
    """A table that is there already, which messages call `where`; dt: as for `recording_of`."""
    return recording_of(table, where, _described(simulator), dt)


def _described(simulator: Simulator) -> Described:
    """Its channels, of which those may be absent that a diagnosis can estimate."""
    velocities = sorted(simulator.velocities) if simulator.guesses_speeds else ()
    own = (
        *simulator.start,
        *velocities,
    )  # of a system of one's own: those with a guess, velocities of a MuJoCo model
    return Described(
        simulator.name,
        simulator.state,
        simulator.action,
        simulator.defaults(),
        simulator.state.names if simulator.name in SIMULATORS else own,
        simulator.integrator,
        simulator.stand_ins,
    )
