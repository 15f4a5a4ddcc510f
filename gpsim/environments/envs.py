"""Plant x task as a Gymnasium vector environment: a batch of episodes stepped as NumPy arrays.

Plant x task as a plain Gymnasium environment: one episode at a time, for programs that know no batches of ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from gpsim.channels import BoolArray, FloatArray
from gpsim.errors import UsageError
from gpsim.simulators import Memory, Plant, restart
from gpsim.tasks import Actions, Start, Task


class Episodes:
    """A batch of running episodes of a task on a plant: the one place where episodes begin, step and end."""

    def __init__(self, plant: Plant, task: Task, count: int, rng: np.random.Generator) -> None:
        self.plant, self.task, self.count, self.rng = plant, task, count, rng
        self.states: FloatArray
        self.context: FloatArray
        self.memory: Memory
        self.steps: NDArray[np.int64]

    def begin(self, start: Start | None = None) -> NDArray[np.float32]:
        """Start every episode anew, from `start` if given; returns the observations (B, O)."""
        start = start or self.task.start(self.count, self.rng)
        self.states, self.context = start.states.copy(), start.context.copy()
        self.memory = self.plant.begin(self.count, self.rng)
        self.steps = np.zeros(self.count, dtype=np.int64)
        return self.observe()

    def given_start(self, options: Mapping[str, Any] | None) -> Start | None:
        """The start that the options of a Gymnasium `reset` ask for, None where they ask for none.

        `states` (B, S) are the initial states; `context` (B, K) is what else the task begins with, the goal say, and is
        drawn by the task where it is absent. Raises UsageError for arrays of other shapes.
        """
        if not options or "states" not in options:
            return None
        states = _rows(options["states"], (self.count, len(self.plant.state)), "states")
        width = self.task.start(0, self.rng).context.shape[1]  # of no episodes: nothing is drawn
        if "context" in options:
            return Start(states, _rows(options["context"], (self.count, width), "context"))
        drawn = self.task.start(self.count if width else 0, self.rng).context
        return Start(states, drawn.reshape(self.count, width))

    def step(self, actions: Actions) -> tuple[FloatArray, BoolArray, BoolArray]:
        """One control step; returns rewards, terminated and truncated, each (B,); does not restart anything."""
        before = self.states
        self.states = self.plant.step(before, self.task.command(actions), self.memory, self.rng)
        self.steps += 1
        rewards = self.task.reward(before, actions, self.states, self.context)
        terminated = self.task.terminated(self.states, self.context)
        return rewards, terminated, (self.steps >= self.task.max_steps) & ~terminated

    def observe(self) -> NDArray[np.float32]:
        """(B, O): what the policy sees now, of the measured states."""
        return self.task.observe(self.plant.measure(self.states, self.memory, self.rng), self.context)

    def held(self, rows: BoolArray) -> tuple[FloatArray, Memory]:
        """Copies of the masked rows' states and of what their plants remember."""
        return self.states[rows], {key: values[rows] for key, values in self.memory.items()}

    def put_back(self, rows: BoolArray, states: FloatArray, memory: Memory) -> None:
        """Let the masked rows be where they were when `held` copied them."""
        self.states[rows] = states
        restart(self.memory, rows, memory)

    def restart(self, rows: BoolArray) -> None:
        """Begin new episodes in the masked rows."""
        count = int(rows.sum())
        start = self.task.start(count, self.rng)
        self.states[rows], self.context[rows] = start.states, start.context
        restart(self.memory, rows, self.plant.begin(count, self.rng))
        self.steps[rows] = 0


class BatchedEnv(VectorEnv[NDArray[np.float32], Actions, Any]):
    """A Gymnasium VectorEnv whose episodes step as one NumPy batch and restart within the same step.

    An action is played for `repeat` control steps, their rewards added up; an episode that ends on the way stays there.
    """

    def __init__(self, plant: Plant, task: Task, count: int, seed: int, repeat: int = 1) -> None:
        self.num_envs, self.repeat = count, repeat
        self.single_observation_space = task.observation_space
        self.single_action_space = task.action_space
        self.observation_space = batch_space(task.observation_space, count)
        self.action_space = batch_space(task.action_space, count)
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        self.episodes = Episodes(plant, task, count, np.random.default_rng(seed))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start every episode anew.

        `options={"states": (B, S)}` sets the initial states, `"context": (B, K)` beside them what else the task begins
        with (the goals (x, y) [m] of the goal task); without it the task draws its own.
        """
        if seed is not None:
            self.episodes.rng = np.random.default_rng(seed)
        return self.episodes.begin(self.episodes.given_start(options)), {}

    def step(
        self, actions: Actions
    ) -> tuple[NDArray[np.float32], FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Play the actions in every episode; ended ones restart, their last observation is in `final_obs`."""
        rewards, terminated, truncated = self.episodes.step(actions)
        for _ in range(self.repeat - 1):
            over = terminated | truncated
            held = self.episodes.held(over)
            more, ended, late = self.episodes.step(actions)
            self.episodes.put_back(over, *held)
            rewards += np.where(over, 0.0, more)
            terminated |= ended & ~over
            truncated |= late & ~over
        observations = self.episodes.observe()
        done = terminated | truncated
        info: dict[str, Any] = {}
        if done.any():
            info = {"final_obs": observations, "_final_obs": done}
            self.episodes.restart(done)
            observations = self.episodes.observe()
        return observations, rewards, terminated, truncated, info


def _rows(given: Any, shape: tuple[int, int], key: str) -> FloatArray:
    rows = np.atleast_2d(np.asarray(given, dtype=np.float64))
    if rows.shape != shape:
        raise UsageError(f"reset: options['{key}'] must have shape {shape}, got {rows.shape}")
    return rows


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
