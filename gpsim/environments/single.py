"""Plant x task as a plain Gymnasium environment: one episode at a time, for programs that know no batches of ours."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from gpsim.channels import FloatArray
from gpsim.environments.envs import Episodes
from gpsim.simulators import Plant
from gpsim.tasks import Task


class SingleEnv(gymnasium.Env[NDArray[np.float32], Any]):
    """One episode of a task on a plant. Observations are what the sensors say; rewards are of the true state."""

    def __init__(self, plant: Plant, task: Task) -> None:
        self.observation_space = task.observation_space
        self.action_space = task.action_space
        self.metadata, self.render_mode = {"render_modes": []}, None
        self.plant, self.task = plant, task
        self._episodes: Episodes | None = None

    @property
    def state(self) -> FloatArray:
        """(S,): the true state now; `reset` comes first."""
        return np.array(self._running().states[0])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """A new episode; `options={"states": (S,)}` sets its first state, `"context": (K,)` the goal beside it."""
        super().reset(seed=seed)
        self._episodes = Episodes(self.plant, self.task, 1, self.np_random)
        return self._episodes.begin(self._episodes.given_start(options))[0], {}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One control step."""
        running = self._running()
        rewards, terminated, truncated = running.step(np.asarray(action)[None])
        return running.observe()[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), {}

    def _running(self) -> Episodes:
        if self._episodes is None:
            raise gymnasium.error.ResetNeeded("call reset() before step() and state")
        return self._episodes
