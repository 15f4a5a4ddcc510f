"""Training policies: the only file that knows stable-baselines3."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from gpsim.envs import BatchedEnv
from gpsim.learning import LearningCurve, PpoSettings, Progress
from gpsim.policy import Policy


def train_ppo(
    env: BatchedEnv, settings: PpoSettings, seed: int, progress: Progress
) -> tuple[Policy, LearningCurve]:
    """Train on one torch thread (two are no faster for networks of this size) and return plain arrays."""
    torch.set_num_threads(1)
    size = env.single_observation_space.shape[0]  # type: ignore[index]
    scale = np.asarray(settings.observation_scale or np.ones(size), dtype=np.float32)
    watcher = _Watcher(settings.total_steps, progress)
    # A rollout longer than the whole budget would overshoot it (tiny budgets).
    n_steps = min(settings.n_steps, max(settings.total_steps // settings.n_envs, 2))
    model = PPO(
        "MlpPolicy",
        _StableBaselinesEnv(env, scale, settings.reward_scale),
        n_steps=n_steps,
        batch_size=min(settings.batch_size, n_steps * settings.n_envs),
        n_epochs=settings.n_epochs,
        learning_rate=_linear(settings.learning_rate, settings.anneal),
        clip_range=_linear(settings.clip_range, settings.anneal),
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        ent_coef=settings.ent_coef,
        policy_kwargs={"net_arch": list(settings.hidden), "optimizer_kwargs": {"fused": True}},
        seed=seed,
        device="cpu",
    )
    model.learn(settings.total_steps, callback=watcher)
    return _actor(model, scale), watcher.curve()


def _linear(start: float, anneal: bool) -> float | Callable[[float], float]:
    return (lambda remaining: start * max(remaining, 0.0)) if anneal else start


def _actor(model: PPO, scale: NDArray[np.float32]) -> Policy:
    state = {k: v.detach().cpu().numpy().copy() for k, v in model.policy.state_dict().items()}
    hidden = sorted({k.rsplit(".", 1)[0] for k in state if k.startswith("mlp_extractor.policy_net.")})
    weights = {}
    for i, prefix in enumerate([*hidden, "action_net"]):
        weights[f"layer.{i}.weight"] = state[f"{prefix}.weight"]
        weights[f"layer.{i}.bias"] = state[f"{prefix}.bias"]
    return Policy(weights, scale)


class _Watcher(BaseCallback):
    """Reports progress and gathers the learning curve."""

    def __init__(self, total: int, progress: Progress) -> None:
        super().__init__()
        self._total, self._progress = total, progress
        self._rows: list[tuple[int, float, int]] = []

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        finished = self.training_env.take_finished()  # type: ignore[attr-defined]
        mean = float(np.mean(finished)) if finished else float("nan")
        self._rows.append((self.num_timesteps, mean, len(finished)))
        self._progress(min(self.num_timesteps, self._total), self._total, f"return {mean:.0f}")

    def curve(self) -> LearningCurve:
        columns = list(zip(*self._rows, strict=True))
        return LearningCurve(np.array(columns[0]), np.array(columns[1]), np.array(columns[2]))


class _StableBaselinesEnv(VecEnv):
    """The batched environment in stable-baselines3's vector interface, with scaled observations."""

    def __init__(self, env: BatchedEnv, scale: NDArray[np.float32], reward_scale: float) -> None:
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._env, self._scale, self._reward_scale = env, scale, reward_scale
        self._returns = np.zeros(env.num_envs)
        self._finished: list[float] = []

    def reset(self) -> VecEnvObs:
        self._returns[:] = 0.0
        return self._env.reset()[0] / self._scale

    def step_async(self, actions: NDArray[Any]) -> None:
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
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
        self._env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        if attr_name == "render_mode":
            return [None] * self.num_envs
        raise AttributeError(f"a batched environment has no attribute '{attr_name}' of its own episodes")

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise AttributeError(f"a batched environment has no attribute '{attr_name}' of its own episodes")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        raise AttributeError(f"a batched environment has no method '{method_name}' of its own episodes")

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        return [False] * self.num_envs
