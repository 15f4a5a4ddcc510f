"""Training policies: the only file that knows stable-baselines3."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from gpsim.envs import BatchedEnv, Episodes
from gpsim.learning import (
    Checkpoints,
    LearningCurve,
    PpoSettings,
    Progress,
    SacSettings,
    observation_scale,
)
from gpsim.policy import Policy
from gpsim.tasks import GoalReaching

ADAM_EPSILON = (
    1e-5  # stable-baselines3's own choice for PPO, which naming any other option of Adam takes back
)


def train_ppo(
    env: BatchedEnv, settings: PpoSettings, seed: int, progress: Progress
) -> tuple[Policy, LearningCurve, Policy]:
    """Train on one torch thread (two are no faster for networks of this size) and return plain arrays.

    The last is the critic: its one logit is the discounted return that it expects of the policy.
    """
    torch.set_num_threads(1)
    scale = observation_scale(env.single_observation_space, settings.observation_scale)
    watcher = _Watcher(settings.total_steps, progress)
    # A rollout longer than the whole budget would overshoot it (tiny budgets).
    n_steps = min(settings.n_steps, max(settings.total_steps // settings.n_envs, 2))
    with warnings.catch_warnings():
        # A last mini-batch that is smaller than the others is harmless, and tiny budgets have one.
        warnings.filterwarnings("ignore", message="You have specified a mini-batch size")
        model = _ppo(env, scale, settings, n_steps, seed)
    model.learn(settings.total_steps, callback=watcher)
    return (
        _network(model, "policy_net", "action_net", scale),
        watcher.curve(),
        _network(model, "value_net", "value_net", scale),
    )


def train_sac(
    env: BatchedEnv, settings: SacSettings, seed: int, progress: Progress
) -> tuple[Policy, LearningCurve, Checkpoints]:
    """Train on one torch thread; returns the checkpoint that did best in the training simulator, and all their scores.

    Every `checkpoint_every` steps the most probable actions are tried there, at every control step, on starts of
    their own that are the same each time.
    """
    torch.set_num_threads(1)
    scale = observation_scale(env.single_observation_space, settings.observation_scale)
    judge = _Judge(env, scale, settings, seed, progress)
    model = SAC(
        "MlpPolicy",
        _StableBaselinesEnv(env, scale, settings.reward_scale),
        learning_rate=_linear(settings.learning_rate, settings.anneal),
        buffer_size=min(settings.buffer_size, max(settings.total_steps, settings.n_envs)),
        learning_starts=settings.learning_starts,
        batch_size=settings.batch_size,
        tau=settings.tau,
        gamma=settings.gamma,
        train_freq=1,
        gradient_steps=settings.gradient_steps,
        n_steps=settings.n_step,
        ent_coef=f"auto_{settings.initial_entropy}",
        target_entropy=settings.target_entropy,
        policy_kwargs={"net_arch": list(settings.hidden)},
        seed=seed,
        device="cpu",
    )
    model.learn(settings.total_steps, callback=[_Sharpening(settings), judge])
    judge.judge()
    return judge.best, judge.curve(), judge.checkpoints()


def _ppo(env: BatchedEnv, scale: NDArray[np.float32], settings: PpoSettings, n_steps: int, seed: int) -> PPO:
    share = n_steps * settings.n_envs / settings.total_steps
    return PPO(
        "MlpPolicy",
        _StableBaselinesEnv(env, scale, settings.reward_scale),
        n_steps=n_steps,
        batch_size=min(settings.batch_size, n_steps * settings.n_envs),
        n_epochs=settings.n_epochs,
        learning_rate=_linear(settings.learning_rate, settings.anneal, share),
        clip_range=_linear(settings.clip_range, settings.anneal, share),
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        ent_coef=settings.ent_coef,
        policy_kwargs={
            "net_arch": list(settings.hidden),
            "optimizer_kwargs": {"fused": True, "eps": ADAM_EPSILON},
        },
        seed=seed,
        device="cpu",
    )


def _linear(start: float, anneal: bool, share: float = 0.0) -> float | Callable[[float], float]:
    """Falling to 0 with what remains of the training; share: what the rollout before an update has used already.

    Counted at an update's end the last one, and the only one of a short training, would change nothing.
    """
    return (lambda remaining: start * min(max(remaining + share, 0.0), 1.0)) if anneal else start


def _network(model: PPO, hidden: str, last: str, scale: NDArray[np.float32]) -> Policy:
    """The actor's layers, or the critic's."""
    state = _arrays(model.policy)
    weights = {}
    for i, prefix in enumerate([*_hidden(state, f"mlp_extractor.{hidden}."), last]):
        weights[f"layer.{i}.weight"] = state[f"{prefix}.weight"]
        weights[f"layer.{i}.bias"] = state[f"{prefix}.bias"]
    return Policy(weights, scale)


def _squashed_actor(model: SAC, scale: NDArray[np.float32]) -> Policy:
    """The last layer holds the mean's rows above the log spread's."""
    state, weights = _arrays(model.actor), {}
    hidden = _hidden(state, "latent_pi.")
    for i, prefix in enumerate(hidden):
        weights[f"layer.{i}.weight"] = state[f"{prefix}.weight"]
        weights[f"layer.{i}.bias"] = state[f"{prefix}.bias"]
    for part in ("weight", "bias"):
        weights[f"layer.{len(hidden)}.{part}"] = np.concatenate(
            [state[f"mu.{part}"], state[f"log_std.{part}"]]
        )
    space = model.action_space
    assert isinstance(space, Box)
    return Policy(weights, scale, np.stack([space.low, space.high]).astype(np.float32), "relu")


def _arrays(module: torch.nn.Module) -> dict[str, NDArray[np.float32]]:
    return {k: v.detach().cpu().numpy().copy() for k, v in module.state_dict().items()}


def _hidden(state: Mapping[str, NDArray[np.float32]], start: str) -> list[str]:
    """The names of the hidden layers below `start`, in order."""
    names = {k.rsplit(".", 1)[0] for k in state if k.startswith(start)}
    return sorted(names, key=lambda name: int(name.rsplit(".", 1)[1]))


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
        """Everything so far."""
        columns = list(zip(*self._rows, strict=True))
        return LearningCurve(np.array(columns[0]), np.array(columns[1]), np.array(columns[2]))


class _Sharpening(BaseCallback):
    """Lets the target entropy fall near the end: exploration was for learning, and blurs what was learnt."""

    def __init__(self, settings: SacSettings) -> None:
        super().__init__()
        self._settings = settings

    def _on_step(self) -> bool:
        assert isinstance(self.model, SAC)
        self.model.target_entropy = self._settings.entropy_at(self.num_timesteps)
        return True


class _Judge(BaseCallback):
    """Evaluates in the training simulator now and then and keeps the best policy."""

    best: Policy

    def __init__(
        self,
        env: BatchedEnv,
        scale: NDArray[np.float32],
        settings: SacSettings,
        seed: int,
        progress: Progress,
    ) -> None:
        super().__init__()
        self._plant, self._task = env.episodes.plant, env.episodes.task
        self._scale, self._settings, self._seed, self._progress = scale, settings, seed, progress
        self._rows: list[tuple[int, float, float, float]] = []
        self._returns: list[tuple[int, float, int]] = []

    def _on_step(self) -> bool:
        if self.num_timesteps >= (len(self._rows) + 1) * self._settings.checkpoint_every:
            self.judge()
        return True

    def judge(self) -> None:
        """Try the policy as it is now."""
        if self._rows and self._rows[-1][0] == self.num_timesteps:
            return
        assert isinstance(self.model, SAC)
        policy = _squashed_actor(self.model, self._scale)
        score, success, length = self._try(policy)
        if not self._rows or score > max(row[1] for row in self._rows):
            self.best = policy
        self._rows.append((self.num_timesteps, score, success, length))
        finished = self.training_env.take_finished()  # type: ignore[attr-defined]
        mean = float(np.mean(finished)) if finished else float("nan")
        self._returns.append((self.num_timesteps, mean, len(finished)))
        total = self._settings.total_steps
        self._progress(min(self.num_timesteps, total), total, f"success {success:.2f}, {length:.0f} steps")

    def _try(self, policy: Policy) -> tuple[float, float, float]:
        count = self._settings.checkpoint_episodes
        running = Episodes(self._plant, self._task, count, np.random.default_rng(self._seed))
        observations = running.begin()
        alive, score = np.ones(count, dtype=np.bool_), np.zeros(count)
        succeeded = np.zeros(count, dtype=np.bool_)
        length = np.full(count, self._task.max_steps)
        for k in range(self._task.max_steps):
            rewards, terminated, _ = running.step(policy.act(observations))
            score += np.where(alive, rewards, 0.0) * self._settings.checkpoint_gamma**k
            length[alive & terminated] = k + 1
            if isinstance(self._task, GoalReaching):
                # Leaving the floor ends an episode, too.
                succeeded |= alive & self._task.reached(running.states, running.context)
            alive &= ~terminated
            if not alive.any():
                break
            observations = running.observe()
        return float(score.mean()), float(succeeded.mean()), float(length.mean())

    def curve(self) -> LearningCurve:
        """Returns in training between the checkpoints."""
        steps, means, episodes = zip(*self._returns, strict=True)
        return LearningCurve(np.array(steps), np.array(means), np.array(episodes))

    def checkpoints(self) -> Checkpoints:
        """Every evaluation."""
        steps, score, success, length = zip(*self._rows, strict=True)
        return Checkpoints(np.array(steps), np.array(score), np.array(success), np.array(length))


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
