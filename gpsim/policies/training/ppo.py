"""Proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347), by stable-baselines3: discrete actions."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from gpsim.environments import BatchedEnv
from gpsim.policies import Policy
from gpsim.policies.training.lean_ppo import FusedAdam, LeanPPO
from gpsim.policies.training.sb3 import (
    StableBaselinesEnv,
    arrays,
    event_log,
    falling,
    hidden_layers,
    layers_of,
    note,
)
from gpsim.policies.training.settings import LearningCurve, PpoSettings, Progress, observation_scale

Watch = Callable[[int, Policy], None]


def train_ppo(
    env: BatchedEnv,
    settings: PpoSettings,
    seed: int,
    progress: Progress,
    watch: Watch | None = None,
    events: Path | None = None,
) -> tuple[Policy, LearningCurve, Policy]:
    """Train on one torch thread (two are no faster for networks of this size) and return plain arrays.

    The last is the critic: its one logit is the discounted return that it expects of the policy.
    watch(steps, policy): told before every update what the policy is by then. events: a folder for event files.
    """
    torch.set_num_threads(1)
    scale = observation_scale(env.single_observation_space, settings.observation_scale)
    watcher = _Watcher(settings.total_steps, progress, scale, watch)
    # A rollout longer than the whole budget would overshoot it (tiny budgets).
    n_steps = min(settings.n_steps, max(settings.total_steps // settings.n_envs, 2))
    with warnings.catch_warnings():
        # A last mini-batch that is smaller than the others is harmless, and tiny budgets have one.
        warnings.filterwarnings("ignore", message="You have specified a mini-batch size")
        model = _ppo(env, scale, settings, n_steps, seed)
    with event_log(events) as log:
        model.set_logger(log)
        model.learn(settings.total_steps, callback=watcher)
        log.dump(model.num_timesteps)  # of the last update
    return (
        _network(model, "policy_net", "action_net", scale),
        watcher.curve(),
        _network(model, "value_net", "value_net", scale),
    )


def _ppo(env: BatchedEnv, scale: NDArray[np.float32], settings: PpoSettings, n_steps: int, seed: int) -> PPO:
    share = n_steps * settings.n_envs / settings.total_steps
    return LeanPPO(
        "MlpPolicy",
        StableBaselinesEnv(env, scale, settings.reward_scale),
        n_steps=n_steps,
        batch_size=min(settings.batch_size, n_steps * settings.n_envs),
        n_epochs=settings.n_epochs,
        learning_rate=falling(settings.learning_rate, settings.anneal, share),
        clip_range=falling(settings.clip_range, settings.anneal, share),
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        ent_coef=settings.ent_coef,
        policy_kwargs={"net_arch": list(settings.hidden), "optimizer_class": FusedAdam},
        seed=seed,
        device="cpu",
    )


def _network(model: PPO, hidden: str, last: str, scale: NDArray[np.float32]) -> Policy:
    """The actor's layers, or the critic's."""
    state = arrays(model.policy)
    return Policy(layers_of(state, [*hidden_layers(state, f"mlp_extractor.{hidden}."), last]), scale)


class _Watcher(BaseCallback):
    """Reports progress and gathers the learning curve."""

    def __init__(
        self, total: int, progress: Progress, scale: NDArray[np.float32], watch: Watch | None
    ) -> None:
        super().__init__()
        self._total, self._progress, self._scale, self._watch = total, progress, scale, watch
        self._rows: list[tuple[int, float, int]] = []

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        finished = self.training_env.take_finished()  # type: ignore[attr-defined]
        mean = float(np.mean(finished)) if finished else float("nan")
        self._rows.append((self.num_timesteps, mean, len(finished)))
        note(self.logger, mean_return=mean, episodes=len(finished))
        self._progress(min(self.num_timesteps, self._total), self._total, f"return {mean:.0f}")
        if self._watch is not None:
            assert isinstance(self.model, PPO)
            self._watch(self.num_timesteps, _network(self.model, "policy_net", "action_net", self._scale))

    def curve(self) -> LearningCurve:
        """Everything so far."""
        return LearningCurve(*map(np.array, zip(*self._rows, strict=True)))
