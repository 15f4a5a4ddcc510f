"""Recording x simulator -> residuals: the rates that were measured minus the rates that the simulator predicts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from gpsim.channels import BoolArray, Channel, Channels, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.evenly import evenly
from gpsim.recordings import Recording, Transitions
from gpsim.simulators import Integrator, Simulator

RATES_LOOKED_AT = 300  # recorded rows at which a simulator's rates must be finite, beside the extreme ones


@dataclass(frozen=True)
class Residuals:
    """One row a transition.

    inputs: (N, S + A) state and action; measured, simulated: (N, R) rates; t: (N,) s; episode: (N,) index;
    test: (N,) True on held-out episodes; order: (N,) rank of a training row in the seeded subsample, -1 on test rows.
    """

    channels: Channels
    rate: Channels
    inputs: FloatArray
    measured: FloatArray
    simulated: FloatArray
    t: FloatArray
    episode: IntArray
    test: BoolArray
    order: IntArray

    @property
    def values(self) -> FloatArray:
        """(N, R): measured minus simulated rates."""
        return self.measured - self.simulated

    def take(self, rows: BoolArray) -> Residuals:
        """The transitions of the mask `rows` (N,)."""
        columns = {
            name: getattr(self, name)[rows]
            for name in ("inputs", "measured", "simulated", "t", "episode", "test", "order")
        }
        return replace(self, **columns)

    def training_rows(self, count: int) -> IntArray:
        """Row numbers of the first `count` training rows of the subsample, in the recording's order."""
        return np.flatnonzero((self.order >= 0) & (self.order < count))


def build_residuals(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
    integrator: Integrator,
    *,
    test_fraction: float,
    rng: np.random.Generator,
    learnt_from: bool = True,
) -> Residuals:
    """Residual rates of every transition; whole episodes are held out for testing, never rows.

    The recording's own `held_out` decides which, else the last `test_fraction` of its episodes. learnt_from: a channel
    that never changes is refused; what is only judged may be as it is.
    """
    check_match(recording, simulator)
    check_rates(recording, simulator, parameters)
    transitions = recording.transitions()
    if learnt_from:
        check_varies(recording)
    predicted = simulator.step(
        transitions.states, transitions.actions, parameters, transitions.dt, integrator
    )
    test = held_out_rows(recording, transitions, test_fraction)
    order = np.full(len(transitions), -1, dtype=np.int64)
    training = np.flatnonzero(~test)
    if not training.size:
        raise UsageError(
            "no transitions are left for training: hold out fewer episodes (residuals.test_fraction)"
        )
    order[rng.permutation(training)] = np.arange(training.size)
    return Residuals(
        channels=simulator.state + simulator.action,
        rate=simulator.rate,
        inputs=np.hstack([transitions.states, transitions.actions]),
        measured=simulator.measured_rates(transitions.states, transitions.next_states, transitions.dt),
        simulated=simulator.measured_rates(transitions.states, predicted, transitions.dt),
        t=transitions.t,
        episode=transitions.episode,
        test=test,
        order=order,
    )


def check_match(recording: Recording, simulator: Simulator, *, hidden: Collection[str] = ()) -> None:
    """The recording must hold the simulator's channels, in its units and order; `hidden` ones may be absent."""
    expected = [channel for channel in simulator.state if channel.name not in hidden]
    for kind, has, needs in (
        ("state", list(recording.state), expected),
        ("action", list(recording.action), list(simulator.action)),
    ):
        if [(c.name, c.unit) for c in has] == [(c.name, c.unit) for c in needs]:
            continue
        absent = [c for c in needs if c.name not in {h.name for h in has}]
        remedy = "import the log with a mapping to these channels"
        if kind == "state" and absent and len(absent) < len(needs):
            guesses = ", ".join(f'"{c.name}": VALUE' for c in absent)
            remedy += f"; or, in a system of your own, guess what nobody measured: start = {{{guesses}}}"
        raise UsageError(
            f"the recording's {kind} is {_listed(has)}, simulator {simulator.name} needs {_listed(needs)}; {remedy}"
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
    episode = int(some.episode[at])
    row = int(looked[at] - np.searchsorted(rows.episode, episode))
    names = (*recording.state.names, *recording.action.names)
    where = ", ".join(f"{name}={value:g}" for name, value in zip(names, inputs[looked[at]], strict=True))
    raise UsageError(
        f"simulator {simulator.name}: {simulator.rate.names[column]} is not finite ({rates[at, column]:g}) where the "
        f"recording's episode {recording.episodes[episode].name}, row {row} has been ({where}); guard its roots, "
        f"logarithms and divisions, as np.sqrt(np.maximum(level, 0.0)) does"
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
        raise UsageError(
            f"channel {channels[column]} is constant ({value}) from episode {first}, row 0 to episode {last}, "
            f"row {len(recording.episodes[-1])}: {_remedy(recording, column)}"
        )


def _remedy(recording: Recording, column: int) -> str:
    if column >= len(recording.state):
        return (
            "check the sensor, or record data in which it moves: a command that never changes teaches nothing"
        )
    return (
        "check the sensor, or record data in which it moves; a part that is held still on purpose needs a simulator "
        "without it (--simulator FILE.py:ClassName)"
    )


def held_out_rows(recording: Recording, transitions: Transitions, test_fraction: float) -> BoolArray:
    """(N,) True on the transitions kept for testing."""
    held_out = recording.held_out
    if held_out is not None and held_out.time_from is not None:
        return np.asarray(transitions.t >= held_out.time_from)
    count = len(recording.episodes)
    first = held_out.episodes_from if held_out is not None else None
    if first is None:
        first = count - int(np.ceil(test_fraction * count)) if count > 1 and test_fraction > 0 else count
    return np.asarray(transitions.episode >= first)


def to_table(residuals: Residuals) -> pd.DataFrame:
    """One row a transition: episode, t, inputs, measured.*, simulated.*, test, order."""
    columns = {"episode": residuals.episode, "t": residuals.t}
    columns |= {name: residuals.inputs[:, i] for i, name in enumerate(residuals.channels.names)}
    for i, name in enumerate(residuals.rate.names):
        columns[f"measured.{name}"] = residuals.measured[:, i]
        columns[f"simulated.{name}"] = residuals.simulated[:, i]
    return pd.DataFrame(columns | {"test": residuals.test, "order": residuals.order})


def from_table(table: pd.DataFrame, channels: Channels, rate: Channels) -> Residuals:
    """The inverse of `to_table`."""
    return Residuals(
        channels=channels,
        rate=rate,
        inputs=table[list(channels.names)].to_numpy(dtype=np.float64),
        measured=table[[f"measured.{name}" for name in rate.names]].to_numpy(dtype=np.float64),
        simulated=table[[f"simulated.{name}" for name in rate.names]].to_numpy(dtype=np.float64),
        t=table["t"].to_numpy(dtype=np.float64),
        episode=table["episode"].to_numpy(dtype=np.int64),
        test=table["test"].to_numpy(dtype=np.bool_),
        order=table["order"].to_numpy(dtype=np.int64),
    )


def _listed(channels: Iterable[Channel]) -> str:
    return "(" + ", ".join(f"{channel.name} [{channel.unit}]" for channel in channels) + ")"
