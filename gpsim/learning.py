"""How policies are trained: settings and learning curves, without the library that does it (slow to load)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Progress = Callable[[int, int, str], None]
"""progress(done, total, note): called now and then while something long runs."""


@dataclass(frozen=True)
class PpoSettings:
    """Proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347) as stable-baselines3 runs it."""

    total_steps: int = 300_000  # environment steps over all environments
    n_envs: int = 10  # parallel environments
    n_steps: int = 512  # steps an environment contributes to one update
    batch_size: int = 128
    n_epochs: int = 10
    learning_rate: float = 1e-3  # falls linearly to 0 if `anneal`
    clip_range: float = 0.2  # falls linearly to 0 if `anneal`
    anneal: bool = True
    gamma: float = 0.99
    gae_lambda: float = 0.95
    ent_coef: float = 0.0
    hidden: Sequence[int] = (64, 64)  # tanh units, for the actor and for the critic
    observation_scale: Sequence[float] = ()  # observations are divided by it; empty: 1
    reward_scale: float = (
        1.0  # rewards are multiplied by it while training; a critic learns small targets faster
    )


@dataclass(frozen=True)
class LearningCurve:
    """Training returns: mean over the episodes that ended in each update. All (updates,)."""

    steps: NDArray[np.int64]
    mean_return: NDArray[np.float64]
    episodes: NDArray[np.int64]
