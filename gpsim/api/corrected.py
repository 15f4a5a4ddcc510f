"""CorrectedSimulator: the base with what a recording taught, to be stepped and rolled out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.corrected import CorrectedPlant, EffectsPlant
from gpsim.errors import UsageError
from gpsim.gp import FitReport
from gpsim.recordings import Recording
from gpsim.simulators import Memory

Corrected = EffectsPlant | CorrectedPlant


@dataclass(frozen=True, repr=False)
class CorrectedSimulator:
    """A base simulator corrected by named effects, by a Gaussian process, or by both.

    `Diagnosis.corrected()` and `fit_gp` make one. Arrays have the channels' order and units: `state` and `action` say
    which. What effects remember (a delay, a lag, a stuck gear) begins at rest and is kept along an episode.

    Attributes:
        plant: what steps it, for those who look inside.
        recording: the recording it was learnt from, where that is known: `make_env` begins episodes there.
        fits: of a Gaussian process of `fit_gp`, rate: how its fit went; empty without one.

    Example:
        >>> import numpy as np
        >>> import gpsim
        >>> corrected = gpsim.Diagnosis.load("found").corrected()
        >>> corrected.state, corrected.action, round(corrected.dt, 6)
        ({'q': 'm', 'q_dot': 'm/s'}, {'force': 'N'}, 0.02)
        >>> corrected.step([0.0, 1.0], [0.0]).shape
        (2,)
        >>> path = corrected.rollout([0.0, 1.0], np.zeros((50, 1)))
        >>> path.shape, bool(path[-1, 1] < 0.5)
        ((51, 2), True)
    """

    plant: Corrected
    recording: Recording | None = None
    fits: Mapping[str, FitReport] = field(default_factory=dict)

    def __repr__(self) -> str:
        terms = [t.effect.family for t in self.plant.terms] if isinstance(self.plant, EffectsPlant) else []
        by = [*terms, *(["a Gaussian process"] if self.plant.correction is not None else [])]
        return f"<CorrectedSimulator of {self.plant.simulator.name}: {', '.join(by) or 'nothing'}>"

    @property
    def state(self) -> dict[str, str]:
        """State channel: unit, in the order of arrays."""
        return self.plant.state.units

    @property
    def action(self) -> dict[str, str]:
        """Action channel: unit, in the order of arrays."""
        return self.plant.action.units

    @property
    def dt(self) -> float:
        """The control step [s]: an action is held over it."""
        return self.plant.dt

    def step(self, state: ArrayLike, action: ArrayLike, *, seed: int = 0) -> FloatArray:
        """The state after the first control step of an episode that begins in `state`.

        Args:
            state: (S,) or (B, S).
            action: (A,) or (B, A).
            seed: of what is drawn: an episode's age where an effect goes by it, samples of a Gaussian process.

        Returns:
            (S,) or (B, S), as `state` is. Nothing was commanded before: `batch` remembers.

        Raises:
            UsageError: another shape, or a number that is not finite.
        """
        start = _rows(state, self.plant.state, "state")
        after = self.batch(start, seed=seed).step(_of_all(action, len(start), self.plant.action))
        return after[0] if np.ndim(state) == 1 else after

    def extrapolates(self, state: ArrayLike, action: ArrayLike) -> BoolArray:
        """Whether a measured curve is asked where its recording never was: there what it adds is held from its edge.

        Args:
            state: (S,) or (B, S).
            action: (A,) or (B, A).

        Returns:
            () or (B,), as `state` is; false without measured curves.

        Raises:
            UsageError: another shape, or a number that is not finite.
        """
        at = _rows(state, self.plant.state, "state")
        sent = _of_all(action, len(at), self.plant.action)
        none = np.zeros(len(at), dtype=bool)
        found = self.plant.extrapolates(at, sent) if isinstance(self.plant, EffectsPlant) else none
        return found if np.ndim(state) > 1 else np.asarray(found[0])

    def rollout(
        self, start: ArrayLike, actions: ArrayLike, *, measured: bool = False, seed: int = 0
    ) -> FloatArray:
        """The states of an episode, or of a batch of them, under given actions. Nothing terminates.

        Args:
            start: (S,) or (B, S).
            actions: (T, A), for all alike, or (B, T, A).
            measured: whether to return what the sensors would say (late, biased) instead of the true states.
            seed: as for `step`.

        Returns:
            (T + 1, S) or (B, T + 1, S), the start first. What runs away is not finite.

        Raises:
            UsageError: another shape, or a number that is not finite.
        """
        first = _rows(start, self.plant.state, "start")
        sent = _commands(actions, len(first), self.plant.action)
        batch = self.batch(first, seed=seed)
        path = [batch.measured if measured else batch.states]
        for k in range(sent.shape[1]):
            batch.step(sent[:, k])
            path.append(batch.measured if measured else batch.states)
        states = np.stack(path, axis=1)
        return states[0] if np.ndim(start) == 1 else states

    def batch(self, states: ArrayLike, *, seed: int = 0) -> Batch:
        """Episodes that begin in `states` (B, S) and are stepped together, one action a step.

        Example:
            >>> import gpsim
            >>> batch = gpsim.Diagnosis.load("found").corrected().batch([[0.0, 1.0], [0.0, -1.0]])
            >>> for _ in range(3):
            ...     states = batch.step([[0.5], [0.5]])
            >>> states.shape, batch.steps
            ((2, 2), 3)
        """
        return Batch(self.plant, _rows(states, self.plant.state, "states"), seed)


class Batch:
    """Running episodes of a corrected simulator, with what each remembers.

    Attributes:
        states: (B, S) the true states now.
        steps: how many control steps have been taken.
    """

    def __init__(self, plant: Corrected, states: FloatArray, seed: int) -> None:
        self._plant, self._rng = plant, np.random.default_rng(seed)
        self._memory: Memory = plant.begin(len(states), self._rng)
        self.states, self.steps = states.copy(), 0

    @property
    def measured(self) -> FloatArray:
        """(B, S): what the sensors say now; asking changes nothing."""
        return np.array(self._plant.measure(self.states, self._memory, self._rng))

    def step(self, actions: ArrayLike) -> FloatArray:
        """The states (B, S) after a control step under actions (B, A), or (A,) for all alike."""
        sent = _of_all(actions, len(self.states), self._plant.action)
        with np.errstate(over="ignore", invalid="ignore"):  # a simulator may run away
            self.states = self._plant.step(self.states, sent, self._memory, self._rng)
        self.steps += 1
        return self.states.copy()


def _numbers(values: ArrayLike, what: str) -> FloatArray:
    try:
        out = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{what}: expected numbers, got {str(values)[:60]}") from error
    if not np.isfinite(out).all():
        raise UsageError(f"{what}: contains a number that is not finite")
    return out


def _refuse(what: str, expected: str, got: Any, channels: Channels) -> UsageError:
    return UsageError(f"{what}: expected shape {expected}, got {got}; its columns are {channels.listed()}")


def _rows(values: ArrayLike, channels: Channels, what: str) -> FloatArray:
    """(B, S), of one row as of many."""
    out, width = _numbers(values, what), len(channels)
    if out.ndim not in (1, 2) or out.shape[-1] != width:
        raise _refuse(what, f"({width},) or (B, {width})", out.shape, channels)
    return np.atleast_2d(out)


def _of_all(values: ArrayLike, count: int, channels: Channels) -> FloatArray:
    """(B, A): one row for all, or a row each."""
    out = _rows(values, channels, "action")
    if len(out) not in (1, count):
        raise _refuse("action", f"({count}, {len(channels)})", out.shape, channels)
    return np.broadcast_to(out, (count, len(channels)))


def _commands(values: ArrayLike, count: int, channels: Channels) -> FloatArray:
    """(B, T, A): one sequence for all, or one each."""
    out, width = _numbers(values, "actions"), len(channels)
    out = out[None] if out.ndim == 2 else out
    if out.ndim != 3 or out.shape[0] not in (1, count) or out.shape[2] != width:
        raise _refuse("actions", f"(T, {width}) or ({count}, T, {width})", np.shape(values), channels)
    return np.broadcast_to(out, (count, *out.shape[1:]))
