"""Soft actor-critic (Haarnoja et al. 2018, arXiv:1801.01290) by stable-baselines3: continuous actions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback

from gpsim.environments import BatchedEnv, Episodes
from gpsim.policies import Policy
from gpsim.policies.training.sb3 import (
    StableBaselinesEnv,
    arrays,
    event_log,
    falling,
    hidden_layers,
    layers_of,
    note,
)
from gpsim.policies.training.settings import (
    Checkpoints,
    LearningCurve,
    Progress,
    SacSettings,
    observation_scale,
)
from gpsim.tasks import GoalReaching


def train_sac(
    env: BatchedEnv, settings: SacSettings, seed: int, progress: Progress, events: Path | None = None
) -> tuple[Policy, LearningCurve, Checkpoints]:
    """Train on one torch thread; returns the checkpoint that did best in the training simulator, and all their scores.

    Every `checkpoint_every` steps the most probable actions are tried there, at every control step, on starts of
    their own that are the same each time. events: a folder for event files.
    """
    torch.set_num_threads(1)
    scale = observation_scale(env.single_observation_space, settings.observation_scale)
    judge = _Judge(env, scale, settings, seed, progress)
    model = SAC(
        "MlpPolicy",
        StableBaselinesEnv(env, scale, settings.reward_scale),
        learning_rate=falling(settings.learning_rate, settings.anneal),
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
    with event_log(events) as log:
        model.set_logger(log)
        model.learn(settings.total_steps, callback=judge)
        judge.judge()
    return judge.best, judge.curve(), judge.checkpoints()


def _squashed_actor(model: SAC, scale: NDArray[np.float32]) -> Policy:
    """The last layer holds the mean's rows above the log spread's."""
    state = arrays(model.actor)
    for part in ("weight", "bias"):
        state[f"last.{part}"] = np.concatenate([state[f"mu.{part}"], state[f"log_std.{part}"]])
    weights = layers_of(state, [*hidden_layers(state, "latent_pi."), "last"])
    space = model.action_space
    assert isinstance(space, Box)
    return Policy(weights, scale, np.stack([space.low, space.high]).astype(np.float32), "relu")


class _Judge(BaseCallback):
    """Evaluates in the training simulator now and then and keeps the best policy.

    It lets the target entropy fall near the end: exploration was for learning, and blurs what was learnt.
    """

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
        assert isinstance(self.model, SAC)
        self.model.target_entropy = self._settings.entropy_at(self.num_timesteps)
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
        note(
            self.logger, mean_return=mean, episodes=len(finished), score=score, success=success, length=length
        )
        self.logger.dump(self.num_timesteps)
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
        return LearningCurve(*map(np.array, zip(*self._returns, strict=True)))

    def checkpoints(self) -> Checkpoints:
        """Every evaluation."""
        return Checkpoints(*map(np.array, zip(*self._rows, strict=True)))
