"""Driving a plant and writing down what happened.

What sensors make of episodes that were driven: noise, and samples that are lost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray

from gpsim.channels import Channels, FloatArray
from gpsim.environments.envs import Episodes
from gpsim.policies import Policy
from gpsim.recordings import Episode
from gpsim.simulators import Plant
from gpsim.tasks import Actions, Task

HOLD_CHANGE = 0.1
Act = Callable[[NDArray[np.float32]], Actions]
"""act(observations (B, O)) -> actions of the batch."""


def policy_actor(policy: Policy, rng: np.random.Generator | None = None) -> Act:
    """Act with a policy: its most probable action, or drawn from its distribution when `rng` is given."""
    return lambda observations: policy.act(observations, rng)


def random_actor(task: Task, rng: np.random.Generator) -> Act:
    """Uniform random actions; continuous ones are held, with a chance of HOLD_CHANGE a step to be drawn anew.

    A command that changes ten times a second would average to its middle before any machine could follow it.
    """
    space = task.action_space
    if isinstance(space, Discrete):
        choices = int(space.n)
        return lambda observations: rng.integers(0, choices, len(observations))
    assert isinstance(space, Box)
    held: list[Actions] = []

    def act(observations: NDArray[np.float32]) -> Actions:
        shape = (len(observations), *space.shape)
        fresh = rng.uniform(space.low, space.high, shape)
        again = rng.random(len(observations)) < HOLD_CHANGE
        held[:] = [np.where(again[:, None], fresh, held[0]) if held else fresh]
        return held[0]

    return act


def dithered_actor(actor: Act, task: Task, share: float, rng: np.random.Generator) -> Act:
    """`actor`, but each action is replaced by a uniform random one with probability `share`."""
    random = random_actor(task, rng)

    def act(observations: NDArray[np.float32]) -> Actions:
        mixed = rng.random(len(observations)) < share
        drawn, chosen = random(observations), actor(observations)
        return np.where(mixed.reshape(-1, *[1] * (drawn.ndim - 1)), drawn, chosen)

    return act


def collect_episodes(
    plant: Plant, task: Task, act: Act, count: int, rng: np.random.Generator
) -> tuple[Episode, ...]:
    """Run `count` episodes to their end as one batch; each has a clock of its own, from 0."""
    running = Episodes(plant, task, count, rng)
    observations = running.begin()
    states, actions = [running.states], []
    lengths = np.full(count, task.max_steps, dtype=np.int64)
    ended = np.zeros(count, dtype=np.bool_)
    for step in range(task.max_steps):
        chosen = act(observations)
        _, terminated, _ = running.step(chosen)
        actions.append(task.command(chosen))
        states.append(running.states)
        lengths[terminated & ~ended] = step + 1
        ended |= terminated
        if ended.all():
            break
        observations = running.observe()
    all_states, all_actions = np.stack(states, axis=1), np.stack(actions, axis=1)
    return tuple(
        Episode(str(i), plant.dt * np.arange(n + 1), all_states[i, : n + 1], all_actions[i, :n])
        for i, n in enumerate(np.minimum(lengths, len(actions)))
    )


def as_sensed(
    episodes: Sequence[Episode], state: Channels, noise: float, missing: float, rng: np.random.Generator
) -> tuple[tuple[Episode, ...], dict[str, float]]:
    """Episodes with Gaussian noise and lost samples, and the noise's standard deviation by channel.

    noise: share of each channel's spread over all episodes; missing: share of the samples inside an episode. Of 0 and 0
    they are as they were, and nothing is said of the noise.
    """
    if not noise and not missing:
        return tuple(episodes), {}
    spread = noise * np.concatenate([episode.states for episode in episodes]).std(axis=0)
    sensed = tuple(_sensed(episode, spread, missing, rng) for episode in episodes)
    said = dict(zip(state.names, spread.tolist(), strict=True)) if noise else {}
    return sensed, {name: value for name, value in said.items() if value > 0.0}


def _sensed(episode: Episode, spread: FloatArray, missing: float, rng: np.random.Generator) -> Episode:
    states = episode.states + spread * rng.standard_normal(episode.states.shape)
    kept = rng.random(len(states)) >= missing
    kept[[0, -1]] = True
    rows = np.flatnonzero(kept)
    return Episode(episode.name, episode.t[rows], states[rows], episode.actions[rows[:-1]])


def first_of(episodes: Sequence[Episode], transitions: int | None) -> tuple[Episode, ...]:
    """The first so many transitions, the last episode cut where they end; None: all."""
    if transitions is None:
        return tuple(episodes)
    out: list[Episode] = []
    left = transitions
    for episode in episodes:
        if left <= 0:
            break
        count = min(left, len(episode))
        out.append(
            Episode(
                episode.name, episode.t[: count + 1], episode.states[: count + 1], episode.actions[:count]
            )
        )
        left -= count
    return tuple(out)
