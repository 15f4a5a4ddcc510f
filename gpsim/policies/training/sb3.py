"""What all trainings by stable-baselines3 share: event files for TensorBoard, weights and schedules."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from gpsim.environments import BatchedEnv

FIGURES = "training"  # what gpsim itself says; stable-baselines3 adds `train/` and `time/`


@contextmanager
def event_log(folder: Path | None) -> Iterator[Logger]:
    """A logger into a folder, closed at the end; without one, of nothing: the library's own leaves a folder behind."""
    logger = Logger(None, [TensorBoardOutputFormat(str(folder))] if folder is not None else [])
    try:
        yield logger
    finally:
        logger.close()


def note(log: Logger | None, **figures: float) -> None:
    """Write figures down for the next dump; what is not finite, as the mean return of no episode, is left out."""
    for name, value in figures.items():
        if log is not None and math.isfinite(value):
            log.record(f"{FIGURES}/{name}", value)


def falling(start: float, anneal: bool, share: float = 0.0) -> float | Callable[[float], float]:
    """Falling to 0 with what remains of the training; share: what the rollout before an update has used already.

    Counted at an update's end the last one, and the only one of a short training, would change nothing.
    """
    return (lambda remaining: start * min(max(remaining + share, 0.0), 1.0)) if anneal else start


def arrays(module: torch.nn.Module) -> dict[str, NDArray[np.float32]]:
    """A network's weights and biases by name."""
    return {k: v.detach().cpu().numpy().copy() for k, v in module.state_dict().items()}


def hidden_layers(state: Mapping[str, NDArray[np.float32]], start: str) -> list[str]:
    """The names of the hidden layers below `start`, in order."""
    names = {k.rsplit(".", 1)[0] for k in state if k.startswith(start)}
    return sorted(names, key=lambda name: int(name.rsplit(".", 1)[1]))


def layers_of(
    state: Mapping[str, NDArray[np.float32]], names: Sequence[str]
) -> dict[str, NDArray[np.float32]]:
    """Weights and biases of layers, as a `Policy` names them."""
    parts = ("weight", "bias")
    return {f"layer.{i}.{part}": state[f"{name}.{part}"] for i, name in enumerate(names) for part in parts}


class StableBaselinesEnv(VecEnv):
    """The batched environment in stable-baselines3's vector interface, with scaled observations."""

    def __init__(self, env: BatchedEnv, scale: NDArray[np.float32], reward_scale: float) -> None:
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._env, self._scale, self._reward_scale = env, scale, reward_scale
        self._returns = np.zeros(env.num_envs)
        self._finished: list[float] = []

    def reset(self) -> VecEnvObs:
        """Observations (N, O) of fresh episodes."""
        self._returns[:] = 0.0
        return self._env.reset()[0] / self._scale

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """The step; what has ended begins anew, its last observation is in the infos."""
        observations, rewards, terminated, truncated, info = self._env.step(self._actions)
        done = terminated | truncated
        self._returns += rewards
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done):
            infos[i] = {
                "terminal_observation": info["final_obs"][i] / self._scale,
                "TimeLimit.truncated": bool(truncated[i]),
            }
            self._finished.append(float(self._returns[i]))
            self._returns[i] = 0.0
        return observations / self._scale, (rewards * self._reward_scale).astype(np.float32), done, infos

    def take_finished(self) -> list[float]:
        """The returns of the episodes that ended since the last call."""
        finished, self._finished = self._finished, []
        return finished

    def close(self) -> None:
        """Nothing is kept open."""
        self._env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The episodes have no attributes of their own."""
        if attr_name == "render_mode":
            return [None] * self.num_envs
        raise AttributeError(f"a batched environment has no attribute '{attr_name}' of its own episodes")

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """The episodes have no attributes of their own."""
        raise AttributeError(f"a batched environment has no attribute '{attr_name}' of its own episodes")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """The episodes have no methods of their own."""
        raise AttributeError(f"a batched environment has no method '{method_name}' of its own episodes")

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """They are not."""
        return [False] * self.num_envs
