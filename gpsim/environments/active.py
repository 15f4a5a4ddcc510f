"""Active data collection: drive to reachable states of which a Gaussian process is least sure, refit, go on.

Thesis, section 5.3; the plan is random shooting in the corrected simulator: of many sequences of held actions the one
along which the process would learn most (Buisson-Fenet et al. 2020, "Actively learning Gaussian process dynamics").
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from gymnasium.spaces import Box, Discrete

from gpsim.channels import FloatArray
from gpsim.corrected import Features
from gpsim.environments.envs import Episodes
from gpsim.gp import Predictor
from gpsim.recordings import Episode
from gpsim.simulators import Plant
from gpsim.tasks import Actions, Task


@dataclass(frozen=True)
class ActiveSettings:
    """transitions: in all; first: of them at random, before anything is known; refit: after so many more.

    horizon: control steps that a plan looks ahead; candidates: sequences that are compared; hold: control steps that an
    action is held in them, and that are played before the next plan; n_train: rows that a fit is conditioned on.
    """

    transitions: int = 2000
    first: int = 100
    refit: int = 200
    horizon: int = 25
    candidates: int = 64
    hold: int = 5
    n_train: int = 250

    def __post_init__(self) -> None:
        for name in ("transitions", "first", "refit", "horizon", "candidates", "hold", "n_train"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.first > self.transitions:
            raise ValueError(f"first={self.first} are more than transitions={self.transitions}")


@dataclass(frozen=True)
class Model:
    """What is believed after so many transitions: a simulator to plan in, and how sure its correction is."""

    plant: Plant
    predictor: Predictor
    features: Features

    def learns(self, states: FloatArray, actions: FloatArray) -> FloatArray:
        """(B,) nats that one observation at states (B, S) under actions (B, A) would tell of the rates, each alone."""
        _, variance = self.predictor.mean_and_variance(self.features(np.hstack([states, actions])))
        noise = np.maximum(self.predictor.noise_variances, np.finfo(float).tiny)
        return np.asarray(0.5 * np.log1p(variance / noise).sum(axis=1))


Refit = Callable[[Sequence[Episode]], Model]


def collect_actively(
    target: Plant,
    task: Task,
    refit: Refit,
    settings: ActiveSettings,
    rng: np.random.Generator,
    note: Callable[[int, int, str], None] = lambda done, total, text: None,
) -> tuple[Episode, ...]:
    """Episodes of `settings.transitions` in all, one after the other; the last one may be cut."""
    done: list[Episode] = []
    count, known, fitted_at = 0, None, 0
    running = Episodes(target, task, 1, rng)
    while count < settings.transitions:
        running.begin()
        states, over = [running.states[0]], False
        actions: list[FloatArray] = []
        plan: list[Actions] = []
        while not over and count < settings.transitions:
            if known is None or count - fitted_at >= settings.refit:
                now = [*done, _episode("now", states, actions, target.dt)] if actions else done
                recorded = sum(map(len, now))
                if recorded >= settings.first:  # else the last model, or none, while there is too little
                    known, fitted_at = refit(now), recorded
                plan = []
            if not plan:
                plan = _planned(known, task, running, settings, rng)
            action = plan.pop(0)
            _, terminated, truncated = running.step(action)
            states.append(running.states[0])
            actions.append(task.command(action)[0])
            over, count = bool((terminated | truncated)[0]), count + 1
        done.append(_episode(str(len(done)), states, actions, target.dt))
        note(count, settings.transitions, f"{len(done)} episodes")
    return tuple(done)


def _planned(
    known: Model | None, task: Task, running: Episodes, settings: ActiveSettings, rng: np.random.Generator
) -> list[Actions]:
    """The actions until the next plan, each for a batch of one."""
    if known is None:
        return [_drawn(task, 1, rng)] * settings.hold
    count = settings.candidates
    measured = running.plant.measure(running.states, running.memory, rng)
    states = np.repeat(measured, count, axis=0)
    context = np.repeat(running.context, count, axis=0)
    memory, alive, learnt = known.plant.begin(count, rng), np.ones(count, dtype=np.bool_), np.zeros(count)
    played: list[Actions] = []
    for step in range(settings.horizon):
        if step % settings.hold == 0:
            action = _drawn(task, count, rng)
        command = task.command(action)
        learnt += np.where(alive, known.learns(states, command), 0.0)
        with np.errstate(over="ignore", invalid="ignore"):
            states = known.plant.step(states, command, memory, rng)
        alive &= ~task.terminated(states, context) & np.isfinite(states).all(axis=1)
        states = np.where(alive[:, None], states, measured)  # nothing runs away where nobody looks
        if step < settings.hold:
            played.append(action)
    best = int(np.argmax(learnt))
    return [action[best : best + 1] for action in played]


def _drawn(task: Task, count: int, rng: np.random.Generator) -> Actions:
    space = task.action_space
    if isinstance(space, Discrete):
        return rng.integers(0, int(space.n), count)
    assert isinstance(space, Box)
    return rng.uniform(space.low, space.high, (count, *space.shape))


def _episode(name: str, states: Sequence[FloatArray], actions: Sequence[FloatArray], dt: float) -> Episode:
    t = np.asarray(dt * np.arange(len(states)), dtype=np.float64)
    return Episode(name, t, np.array(states), np.array(actions))
