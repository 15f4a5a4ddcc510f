"""Balance the pole: Gymnasium's CartPole task with the thesis's angle threshold (Table 4.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.tasks.task import Actions, Start

X, THETA = 0, 2


@dataclass(frozen=True)
class Balance:
    """+1 a step while |theta| <= angle_limit and, unless position_limit is None, |x| <= position_limit.

    Actions 0 and 1 push with -force and +force [N]; all four state variables start uniform in +-start_range.
    """

    force: float = 10.0
    angle_limit: float = 0.2
    position_limit: float | None = 2.4
    start_range: float = 0.05
    max_steps: int = 500

    state: ClassVar[Channels] = Channels.of({"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"})
    action: ClassVar[Channels] = Channels.of({"force": "N"})

    def __post_init__(self) -> None:
        limits = {"force": self.force, "angle_limit": self.angle_limit, "position_limit": self.position_limit}
        for name, value in limits.items():
            if value is not None and not value > 0:
                raise ValueError(f"{name} must be positive, got {value:g}")
        if not self.start_range >= 0:
            raise ValueError(f"start_range must be at least 0, got {self.start_range:g}")
        if self.max_steps < 1:
            raise ValueError(f"max_steps must be at least 1, got {self.max_steps}")

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        """The raw state (4,)."""
        return gymnasium.spaces.Box(-np.inf, np.inf, (4,), np.float32)

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        """Push left or right."""
        return gymnasium.spaces.Discrete(2)

    def start(self, count: int, rng: np.random.Generator) -> Start:
        """Uniform in +-start_range on every state variable."""
        return Start(rng.uniform(-self.start_range, self.start_range, (count, 4)), np.empty((count, 0)))

    def evaluation_starts(self, count: int, rng: np.random.Generator) -> Start:
        """As in training."""
        return self.start(count, rng)

    def on_target(self) -> Balance:
        """The same task."""
        return self

    def observe(self, states: FloatArray, context: FloatArray) -> NDArray[np.float32]:
        """The state itself."""
        return states.astype(np.float32)

    def command(self, actions: Actions) -> FloatArray:
        """(B, 1): force [N]."""
        return np.where(actions == 1, self.force, -self.force)[:, None]

    def reward(
        self, states: FloatArray, actions: Actions, next_states: FloatArray, context: FloatArray
    ) -> FloatArray:
        """One a step, the falling one included, as in Gymnasium."""
        return np.ones(len(states))

    def terminated(self, states: FloatArray, context: FloatArray) -> BoolArray:
        """The pole or the cart has left its limits, or the numbers have ceased to be finite."""
        over = ~(np.abs(states[:, THETA]) <= self.angle_limit)
        if self.position_limit is not None:
            over |= ~(np.abs(states[:, X]) <= self.position_limit)
        return over
