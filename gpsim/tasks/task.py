"""What a task is: where episodes start, what the policy sees and may do, what it earns, when it is over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from gpsim.channels import BoolArray, Channels, FloatArray

Actions = NDArray[Any]
"""A batch of policy actions: (B,) int64 for discrete tasks, (B, A) float for continuous ones."""


@dataclass(frozen=True)
class Start:
    """Where episodes begin: states (B, S), and the task's own context (B, K), a goal say (K may be 0)."""

    states: FloatArray
    context: FloatArray


class Task(Protocol):
    """Initial states, observation, command, reward and termination, all batched."""

    @property
    def state(self) -> Channels:
        """The state's channels that the task starts from and judges: its plant's, in this order."""
        ...

    @property
    def action(self) -> Channels:
        """The channels that it commands: its plant's, in this order."""
        ...

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        """What the policy sees of one episode."""
        ...

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        """What the policy may do in one episode."""
        ...

    @property
    def max_steps(self) -> int:
        """Steps after which an episode is truncated."""
        ...

    def start(self, count: int, rng: np.random.Generator) -> Start:
        """Draw `count` new episodes."""
        ...

    def evaluation_starts(self, count: int, rng: np.random.Generator) -> Start:
        """The `count` starts on which policies are compared."""
        ...

    def on_target(self) -> Task:
        """The task as it is on the real system, where that has limits that no simulator knows."""
        ...

    def observe(self, states: FloatArray, context: FloatArray) -> NDArray[np.float32]:
        """(B, O): what the policy sees."""
        ...

    def command(self, actions: Actions) -> FloatArray:
        """(B, A): the policy's actions in the units of the simulator's action channels."""
        ...

    def reward(
        self, states: FloatArray, actions: Actions, next_states: FloatArray, context: FloatArray
    ) -> FloatArray:
        """(B,): what the transition earns."""
        ...

    def terminated(self, states: FloatArray, context: FloatArray) -> BoolArray:
        """(B,): whether the episode is over for good in these states."""
        ...
