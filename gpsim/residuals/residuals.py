"""Recording x simulator -> residuals: the rates that were measured minus the rates that the simulator predicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray, columns_beside, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import OverGaps, Recording, Transitions, gaps
from gpsim.residuals.checks import check_clock, check_match, check_rates, check_varies, not_finite
from gpsim.residuals.split import held_out_rows, holding_out
from gpsim.simulators import Integrator, Simulator

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Residuals:
    """One row a transition; those over a gap of the clock are left out.

    channels: of state and action, an angle wraps where simulator or recording says so; inputs: (N, S + A) their values;
    measured, simulated: (N, R) rates; t: (N,) s; episode: (N,) index; test: (N,) True on held-out episodes; order: (N,)
    rank of a training row in the seeded subsample, -1 on test rows; over_gaps: the commands of what is left out, None
    where no row is lost.
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
    over_gaps: OverGaps | None = None

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
        lost = None if self.over_gaps is None else self.over_gaps.take(rows)
        return replace(self, **columns, over_gaps=lost)

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
    """Residual rates of every transition that lasts a control step; over a gap commands may be hidden.

    What is held out for testing the recording's own `held_out` decides, else it is the last `test_fraction` of it (see
    `split`). learnt_from: a channel that never changes is refused; what is only judged may be
    as it is. Raises UsageError where recording and simulator do not go together.
    """
    check_match(recording, simulator)
    check_clock(recording)
    check_rates(recording, simulator, parameters)
    if learnt_from:
        check_varies(recording)
    everything = recording.transitions()
    over = np.concatenate([gaps(episode.t, recording.dt) for episode in recording.episodes])
    rows = np.flatnonzero(~over)
    transitions = everything.take(rows)
    simulated = _simulated_rates(recording, simulator, parameters, integrator, transitions, rows)
    state = either_wraps(simulator.state, recording.state)
    test = held_out_rows(holding_out(recording, test_fraction), transitions)
    order = np.full(len(transitions), -1, dtype=np.int64)
    training = np.flatnonzero(~test)
    if not training.size:
        raise UsageError(
            "no transitions are left for training: hold out less of it (residuals.test_fraction)"
        )
    order[rng.permutation(training)] = np.arange(training.size)
    return Residuals(
        channels=state + simulator.action,
        rate=simulator.rate,
        inputs=np.hstack([transitions.states, transitions.actions]),
        measured=simulator.measured_rates(
            transitions.states, _run_on(transitions, state.wraps & ~simulator.state.wraps), transitions.dt
        ),
        simulated=simulated,
        t=transitions.t,
        episode=transitions.episode,
        test=test,
        order=order,
        over_gaps=OverGaps.of(over, everything.episode, everything.t, everything.actions),
    )


def either_wraps(channels: Channels, others: Channels) -> Channels:
    """`channels`, wrapping where they or their namesakes among `others` do."""
    return Channels.of(channels.units, wraps=(c.name for c in (*channels, *others) if c.wraps))


def _run_on(transitions: Transitions, angles: BoolArray) -> FloatArray:
    """(N, S): the next states, the columns of `angles` (S,) the short way on from the states.

    A simulator that does not know that an angle wraps would see a jump of a whole turn.
    """
    after = transitions.next_states.copy()
    before = transitions.states[:, angles]
    after[:, angles] = before + wrap_angle(after[:, angles] - before)
    return after


def _simulated_rates(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
    integrator: Integrator,
    transitions: Transitions,
    rows: IntArray,
) -> FloatArray:
    """(N, R): the rates of the simulator's own step; `rows` (N,): the transitions' places in the recording.

    `check_rates` looks at some rows and at their start only: here all of them count, and what integration makes.
    """
    with np.errstate(all="ignore"):
        predicted = simulator.step(
            transitions.states, transitions.actions, parameters, transitions.dt, integrator
        )
        simulated = simulator.measured_rates(transitions.states, predicted, transitions.dt)
    made, names = np.hstack([predicted, simulated]), (*simulator.state.names, *simulator.rate.names)
    bad = np.argwhere(~np.isfinite(made))
    if len(bad):
        at, column = (int(i) for i in bad[0])
        raise not_finite(recording, simulator, f"{names[column]} after a step", made[at, column], rows[at])
    return simulated


def to_table(residuals: Residuals) -> pd.DataFrame:
    """One row a transition: episode, t, inputs, measured.*, simulated.*, test, order; `over_gaps` has its own table.

    An input that is called as one of the others is `input.NAME`.
    """
    import pandas as pd  # here: half a second that most commands need not wait for

    columns = {"episode": residuals.episode, "t": residuals.t}
    inputs = _input_columns(residuals.channels, residuals.rate)
    columns |= {name: residuals.inputs[:, i] for i, name in enumerate(inputs)}
    for i, name in enumerate(residuals.rate.names):
        columns[f"measured.{name}"] = residuals.measured[:, i]
        columns[f"simulated.{name}"] = residuals.simulated[:, i]
    return pd.DataFrame(columns | {"test": residuals.test, "order": residuals.order})


def _input_columns(channels: Channels, rate: Channels) -> list[str]:
    of_rates = [f"{what}.{name}" for name in rate.names for what in ("measured", "simulated")]
    return columns_beside(channels.names, {"episode", "t", "test", "order", *of_rates}, "input")


def from_table(
    table: pd.DataFrame, channels: Channels, rate: Channels, over_gaps: OverGaps | None = None
) -> Residuals:
    """The inverse of `to_table`."""
    return Residuals(
        channels=channels,
        rate=rate,
        inputs=table[_input_columns(channels, rate)].to_numpy(dtype=np.float64),
        measured=table[[f"measured.{name}" for name in rate.names]].to_numpy(dtype=np.float64),
        simulated=table[[f"simulated.{name}" for name in rate.names]].to_numpy(dtype=np.float64),
        t=table["t"].to_numpy(dtype=np.float64),
        episode=table["episode"].to_numpy(dtype=np.int64),
        test=table["test"].to_numpy(dtype=np.bool_),
        order=table["order"].to_numpy(dtype=np.int64),
        over_gaps=over_gaps,
    )
