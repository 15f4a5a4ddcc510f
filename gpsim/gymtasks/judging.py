"""What a Gymnasium environment built on MuJoCo says of a transition: observation, reward, end. It steps nothing."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.mjcf import GYM, load_mjcf, mujoco, new_environment


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
