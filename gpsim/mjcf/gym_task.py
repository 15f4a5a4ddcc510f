"""A Gymnasium environment's own task on any plant of its robot: starts, observation, reward and end are theirs."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.mjcf.layout import Layout
from gpsim.mjcf.loading import new_environment
from gpsim.mjcf.optional import mujoco
from gpsim.mjcf.simulator import MjcfSimulator, load_mjcf
from gpsim.tasks import Actions, Start
from gpsim.trust import GYM


class Judge:
    """One environment of its own, whose simulation is replaced by what happened elsewhere.

    Its own code computes everything from positions and velocities before and after; contact and constraint forces are
    those of its own model in the later state.
    """

    def __init__(self, reference: str) -> None:
        self._env, self.most_steps = new_environment(reference)
        self._after: tuple[FloatArray, FloatArray] | None = None
        self._env.do_simulation = self._arrive

    @property
    def dt(self) -> float:
        """The control step [s]."""
        return float(self._env.dt)

    @property
    def observations(self) -> Any:
        """Its observation space."""
        return self._env.observation_space

    @property
    def actions(self) -> Any:
        """Its action space."""
        return self._env.action_space

    def start(self, seed: int) -> tuple[FloatArray, FloatArray]:
        """(nq,), (nv,) of a new episode."""
        self._env.reset(seed=seed)
        return self._env.data.qpos.copy(), self._env.data.qvel.copy()

    def observation(self, qpos: FloatArray, qvel: FloatArray) -> NDArray[np.float64]:
        """(O,): what is seen of a state."""
        self._set(qpos, qvel)
        return np.asarray(self._env._get_obs(), dtype=np.float64)

    def step(
        self, before: tuple[FloatArray, FloatArray], action: FloatArray, after: tuple[FloatArray, FloatArray]
    ) -> tuple[float, bool]:
        """What the transition earns, and whether the episode is over for good."""
        self._set(*before)
        self._after = after
        _, reward, terminated, *_ = self._env.step(action)
        return float(reward), bool(terminated)

    def _set(self, qpos: FloatArray, qvel: FloatArray) -> None:
        """A state of which nothing went before: what is said of it must not depend on what was asked last."""
        mujoco().mj_resetData(self._env.model, self._env.data)
        self._env.set_state(qpos, qvel)

    def _arrive(self, ctrl: FloatArray, frames: int) -> None:
        mj, model, data = mujoco(), self._env.model, self._env.data
        assert self._after is not None
        data.ctrl[:] = ctrl
        data.qpos[:], data.qvel[:] = self._after
        data.time += frames * model.opt.timestep
        mj.mj_forward(model, data)
        mj.mj_rnePostConstraint(model, data)


@lru_cache(maxsize=4)
def judge_of(reference: str) -> Judge:
    """The judge of gym:ID in this process; raises UsageError."""
    if not reference.startswith(GYM):
        raise UsageError(f"task {reference}: expected gym:ID, as gym:InvertedDoublePendulum-v5")
    load_mjcf(reference)  # which refuses an environment that is not built on MuJoCo
    return Judge(reference)


SEEDS = 2**31


def is_gym_task(name: str) -> bool:
    """Whether a task's name means a Gymnasium environment's own."""
    return name.startswith(GYM)


@dataclass(frozen=True)
class GymTask:
    """The task gym:ID, as gym:InvertedDoublePendulum-v5. States are of its model, all of them, in the joints' order.

    max_steps: control steps of an episode; 0: as many as the environment has.
    """

    reference: str
    max_steps: int = 0
    _known: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.max_steps < 0:
            raise ValueError(f"max_steps must be at least 0, got {self.max_steps}")
        if not self.max_steps:
            object.__setattr__(self, "max_steps", self._judge.most_steps)

    @property
    def state(self) -> Channels:
        """All channels of the model."""
        return self._simulator.state

    @property
    def action(self) -> Channels:
        """Its actuators."""
        return self._simulator.action

    @property
    def dt(self) -> float:
        """The control step [s] that the task is made for."""
        return self._judge.dt

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        """Theirs, in single precision."""
        space = self._judge.observations
        return gymnasium.spaces.Box(
            space.low.astype(np.float32), space.high.astype(np.float32), space.shape, np.float32
        )

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        """Theirs."""
        space = self._judge.actions
        return gymnasium.spaces.Box(
            space.low.astype(np.float32), space.high.astype(np.float32), space.shape, np.float32
        )

    def start(self, count: int, rng: np.random.Generator) -> Start:
        """As they draw them."""
        drawn = [self._judge.start(int(seed)) for seed in rng.integers(SEEDS, size=count)]
        if not drawn:
            return Start(np.empty((0, len(self.state))), np.empty((0, 0)))
        qpos, qvel = (np.array(part) for part in zip(*drawn, strict=True))
        return Start(self._layout.state(qpos, qvel), np.empty((count, 0)))

    def evaluation_starts(self, count: int, rng: np.random.Generator) -> Start:
        """As in training."""
        return self.start(count, rng)

    def on_target(self) -> GymTask:
        """The same task."""
        return self

    def observe(self, states: FloatArray, context: FloatArray) -> NDArray[np.float32]:
        """(B, O): what they show of the states; zeros where the numbers have ceased to be finite."""
        (size,) = self._judge.observations.shape
        out = np.zeros((len(states), size), dtype=np.float32)
        qpos, qvel = self._layout.full(states)
        for i in np.flatnonzero(np.isfinite(states).all(axis=1)):
            out[i] = self._judge.observation(qpos[i], qvel[i])
        return out

    def command(self, actions: Actions) -> FloatArray:
        """(B, A): the actions within their range."""
        space = self._judge.actions
        return np.clip(np.asarray(actions, dtype=np.float64), space.low, space.high)

    def reward(
        self, states: FloatArray, actions: Actions, next_states: FloatArray, context: FloatArray
    ) -> FloatArray:
        """Theirs; nothing where the numbers have ceased to be finite."""
        rewards, over = self._judged(states, self.command(actions), next_states)
        self._known.update(states=next_states.copy(), over=over)
        return rewards

    def terminated(self, states: FloatArray, context: FloatArray) -> BoolArray:
        """Theirs, or the numbers have ceased to be finite; of what was just rewarded it is known already."""
        if "states" in self._known and np.array_equal(self._known["states"], states):
            return np.array(self._known["over"])
        return self._judged(states, np.zeros((len(states), len(self.action))), states)[1]

    def _judged(
        self, before: FloatArray, commands: FloatArray, after: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        rewards, over = np.zeros(len(after)), np.ones(len(after), dtype=np.bool_)
        was, now = self._layout.full(before), self._layout.full(after)
        finite = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
        for i in np.flatnonzero(finite):
            first, last = (was[0][i], was[1][i]), (now[0][i], now[1][i])
            rewards[i], over[i] = self._judge.step(first, commands[i], last)
        return rewards, over

    @property
    def _judge(self) -> Judge:
        return judge_of(self.reference)

    @cached_property
    def _simulator(self) -> MjcfSimulator:
        return load_mjcf(self.reference)

    @property
    def _layout(self) -> Layout:
        return self._simulator.layout
