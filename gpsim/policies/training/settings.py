"""How policies are trained: settings and learning curves, without the library that does it (slow to load)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray

from gpsim.errors import UsageError

Progress = Callable[[int, int, str], None]
"""progress(done, total, note): called now and then while something long runs."""

TRAINING_FORMAT = 3
"""Part of every trained policy's key. To be raised when the code of a training changes what it makes: policies that
older code has trained are then trained again, and not kept."""


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
    reward_scale: float = 1.0  # of rewards while training: a critic learns small targets faster
    expert_rounds: int = 0  # of expert iteration that follow (expert_iteration.py); 0: none
    expert_states: int = 6000  # that the expert is asked about in each
    expert_width: int = 16  # states that its search keeps
    expert_horizon: int = 30  # steps that it looks ahead

    def __post_init__(self) -> None:
        _check(self, "be at least 1", "total_steps", "n_envs", "n_steps", "n_epochs")
        _check(
            self, "be at least 2", "batch_size"
        )  # advantages are scaled to unit variance, which one does not have
        _check(self, "be at least 0", "ent_coef")
        _check(self, "be positive", "learning_rate", "clip_range", "reward_scale")
        _check(self, "lie in [0, 1]", "gamma", "gae_lambda")
        _check_layers(self.hidden)
        _check(self, "be at least 0", "expert_rounds")
        _check(self, "be at least 1", "expert_states", "expert_width", "expert_horizon")
        if self.expert_rounds and self.gamma == 1.0:
            raise ValueError("gamma must be below 1 with expert_rounds, because they use the critic")
        if self.n_envs * self.n_steps < 2:
            raise ValueError("n_envs times n_steps must be at least 2")


@dataclass(frozen=True)
class SacSettings:
    """Soft actor-critic (Haarnoja et al. 2018, arXiv:1812.05905) as stable-baselines3 runs it, on many environments."""

    total_steps: int = 400_000  # environment steps over all environments
    n_envs: int = 64  # parallel environments
    gradient_steps: int = 8  # updates after each step of all environments
    batch_size: int = 256
    buffer_size: int = 300_000  # transitions
    learning_starts: int = 2000  # steps of random actions before the first update
    learning_rate: float = 3e-4  # falls linearly to 0 if `anneal`
    anneal: bool = True
    gamma: float = 0.99
    tau: float = 0.005  # share of the critic that the target critic takes over at each update
    n_step: int = 1  # decisions whose rewards count before the critic takes over
    action_repeat: int = 5  # control steps that an action is held while training; it is deployed at every one
    initial_entropy: float = 0.1  # first value of the entropy coefficient, which then adapts
    target_entropy: float = -2.0  # what it adapts to, for all actions together
    final_entropy: float | None = None  # it falls to this, linearly, near the end; None: it stays
    final_part: float = 0.4  # share of the training over which it falls
    hidden: Sequence[int] = (64, 64)  # rectified units, for the actor and for each critic
    observation_scale: Sequence[float] = ()  # observations are divided by it; empty: 1
    reward_scale: float = 1.0  # rewards are multiplied by it while training
    checkpoint_every: int = 10_000  # steps between evaluations in the simulator, the best of which is kept
    checkpoint_episodes: int = 200
    checkpoint_gamma: float = 0.995  # an evaluation's score is the mean return discounted by this a step

    def __post_init__(self) -> None:
        _check(
            self,
            "be at least 1",
            "total_steps",
            "n_envs",
            "gradient_steps",
            "batch_size",
            "buffer_size",
            "n_step",
        )
        _check(self, "be at least 1", "action_repeat", "checkpoint_every", "checkpoint_episodes")
        _check(self, "be at least 0", "learning_starts")
        _check(
            self, "be positive", "learning_rate", "tau", "initial_entropy", "reward_scale", "checkpoint_gamma"
        )
        _check(self, "lie in [0, 1]", "gamma", "tau", "checkpoint_gamma")
        _check_layers(self.hidden)
        if not 0.0 < self.final_part <= 1.0:
            raise ValueError(f"final_part is {self.final_part}: it must be more than 0 and at most 1")

    def entropy_at(self, done: int) -> float:
        """The target entropy after `done` steps."""
        if self.final_entropy is None:
            return self.target_entropy
        left = max(1.0 - done / self.total_steps, 0.0)
        share = max(1.0 - left / self.final_part, 0.0)
        return self.target_entropy + share * (self.final_entropy - self.target_entropy)


RULES: Mapping[str, Callable[[float], bool]] = {
    "be at least 0": lambda value: value >= 0,
    "be at least 1": lambda value: value >= 1,
    "be at least 2": lambda value: value >= 2,
    "be positive": lambda value: value > 0,
    "lie in [0, 1]": lambda value: 0 <= value <= 1,
}


def _check(settings: object, rule: str, *names: str) -> None:
    for name in names:
        if not RULES[rule](value := getattr(settings, name)):
            raise ValueError(f"{name} must {rule}, got {value}")


def _check_layers(hidden: Sequence[int]) -> None:
    if not hidden or min(hidden) < 1:
        raise ValueError(f"hidden must name the units of each layer, as [64, 64], got {list(hidden)}")


@dataclass(frozen=True)
class Checkpoints:
    """Evaluations of the most probable actions in the training simulator. All (evaluations,).

    score: mean discounted return; success: share of episodes that reached the goal; length: mean steps.
    """

    steps: NDArray[np.int64]
    score: NDArray[np.float64]
    success: NDArray[np.float64]
    length: NDArray[np.float64]


@dataclass(frozen=True)
class LearningCurve:
    """Training returns: mean over the episodes that ended in each update. All (updates,)."""

    steps: NDArray[np.int64]
    mean_return: NDArray[np.float64]
    episodes: NDArray[np.int64]


def observation_scale(space: Space[Any], given: Sequence[float]) -> NDArray[np.float32]:
    """(O,) what a task's observations are divided by; raises UsageError where the numbers given do not fit them."""
    (size,) = space.shape or (0,)
    scale = np.asarray(given or np.ones(size), dtype=np.float32)
    if scale.shape != (size,) or not (scale > 0).all():
        raise UsageError(
            f"policy.observation_scale: expected {size} positive numbers, or none, got {list(given)}"
        )
    return scale
