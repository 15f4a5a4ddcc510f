"""A task of the user's own: a reward and, if there is one, an end, as functions of what the channels say."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.errors import Terminated, UsageError
from gpsim.tasks.task import Actions, Start

Told = Mapping[str, Any]
"""Channel -> its value: a number, or (B,) numbers."""
Reward = Callable[[Told, Told, Told], Any]
"""reward(state, action, next_state)."""
End = Callable[[Told], Any]
"""terminated(state)."""


def never(state: Told) -> bool:
    """The end of a task that has none."""
    return False


@dataclass(frozen=True)
class OwnTask:
    """A task by functions; states and commands of one plant, in its channels' order.

    starts: (N, S) states, of which episodes begin at any; low, high: (A,) of the commands; vectorised: whether the
    functions take (B,) arrays for a batch, else they are asked episode by episode, with numbers.
    """

    state: Channels
    action: Channels
    reward_of: Reward
    starts: FloatArray
    low: FloatArray
    high: FloatArray
    ends: End = never
    max_steps: int = 500
    vectorised: bool = False

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        """The state as it is measured (S,)."""
        return gymnasium.spaces.Box(-np.inf, np.inf, (len(self.state),), np.float32)

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        """The commands (A,) from -1 to 1: low to high in their units."""
        return gymnasium.spaces.Box(-1.0, 1.0, (len(self.action),), np.float32)

    def start(self, count: int, rng: np.random.Generator) -> Start:
        """Any of the starts, with equal chances."""
        rows = rng.integers(len(self.starts), size=count)
        return Start(self.starts[rows], np.empty((count, 0)))

    def evaluation_starts(self, count: int, rng: np.random.Generator) -> Start:
        """As in training."""
        return self.start(count, rng)

    def on_target(self) -> OwnTask:
        """The same task."""
        return self

    def observe(self, states: FloatArray, context: FloatArray) -> NDArray[np.float32]:
        """The state itself."""
        return states.astype(np.float32)

    def command(self, actions: Actions) -> FloatArray:
        """(B, A): in the units of the action channels."""
        shares = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)
        return np.asarray(self.low + 0.5 * (shares + 1.0) * (self.high - self.low))

    def reward(
        self, states: FloatArray, actions: Actions, next_states: FloatArray, context: FloatArray
    ) -> FloatArray:
        """What the user's function says, checked; nothing where the numbers have ceased to be finite."""
        finite = np.isfinite(next_states).all(axis=1)
        told = (states[finite], self.command(actions)[finite], next_states[finite])
        out = np.zeros(len(states))
        out[finite] = self._asked("reward", self.reward_of, told)
        return out

    def terminated(self, states: FloatArray, context: FloatArray) -> BoolArray:
        """What the user's function says, or the numbers have ceased to be finite."""
        finite = np.isfinite(states).all(axis=1)
        over = np.ones(len(states), dtype=np.bool_)
        over[finite] = self._asked("terminated", self.ends, (states[finite],)) != 0.0
        return over

    def _asked(self, what: str, function: Callable[..., Any], arrays: tuple[FloatArray, ...]) -> FloatArray:
        """(B,) numbers; raises UsageError where the function raises, or gives something else."""
        names = (self.state.names, self.action.names, self.state.names)
        count = len(arrays[0])
        if self.vectorised:
            told = [_told(values.T, name) for values, name in zip(arrays, names, strict=False)]
            return _numbers(_call(function, told, what), (count,), what)
        out = np.empty(count)
        for i in range(count):
            told = [_told(values[i], name) for values, name in zip(arrays, names, strict=False)]
            out[i] = _numbers(_call(function, told, what), (), what)
        return out


def _told(values: FloatArray, names: tuple[str, ...]) -> dict[str, Any]:
    return dict(zip(names, values, strict=True))


def _call(function: Callable[..., Any], told: list[dict[str, Any]], what: str) -> Any:
    try:
        return function(*told)
    except (UsageError, Terminated):
        raise
    except Exception as error:  # a user's code may raise anything
        arguments = "(state)" if what == "terminated" else "(state, action, next_state)"
        raise UsageError(
            f"{what}{arguments} raised {type(error).__name__}: {' '.join(str(error).split())[:160]}; its inputs are "
            "mappings of channel: value"
        ) from error


def _numbers(answer: Any, shape: tuple[int, ...], what: str) -> FloatArray:
    values = np.asarray(answer)
    if values.shape not in (shape, ()) or values.dtype.kind not in "bifu" or not np.isfinite(values).all():
        wanted = "a finite number" if not shape else f"{shape[0]} finite numbers, one an episode"
        got = f"shape {values.shape}" if values.shape not in (shape, ()) else repr(answer)[:60]
        raise UsageError(f"{what}: expected {wanted}, got {got}")
    return np.broadcast_to(values.astype(np.float64), shape)
