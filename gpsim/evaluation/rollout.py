"""Layer 2: the same start and the same actions in several plants, and how far they drift from the target."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gpsim.channels import Channels, FloatArray, difference
from gpsim.simulators import Memory, Plant


def roll_out(
    plant: Plant,
    start: FloatArray,
    actions: FloatArray,
    rng: np.random.Generator,
    memory: Memory | None = None,
) -> FloatArray:
    """(B, T + 1, S): states under the actions (B, T, A), nothing terminates. memory: the plant's, which begins anew."""
    states = [start]
    if memory is None:
        memory = plant.begin(len(start), rng)
    with np.errstate(over="ignore", invalid="ignore"):  # a simulator may run away; what did so is counted
        for k in range(actions.shape[1]):
            states.append(plant.step(states[-1], actions[:, k], memory, rng))
    return np.stack(states, axis=1)


def divergence(trajectories: FloatArray, target: FloatArray, channels: Channels) -> FloatArray:
    """(B, T + 1, S): absolute distance to the target's trajectories, angles the short way round.

    Infinite where a trajectory has ceased to be finite, so that quantiles count it among the farthest.
    """
    with np.errstate(invalid="ignore"):
        distance = np.abs(difference(trajectories, target, channels))
    return np.where(np.isfinite(distance), distance, np.inf)


def compare(trajectories: FloatArray, target: FloatArray, channels: Channels) -> dict[str, Any]:
    """Root mean squares and bands of the divergence, and how many rollouts ceased to be finite."""
    distance = divergence(trajectories, target, channels)
    return {
        "rms": root_mean_square(distance, channels),
        "bands": bands(distance, channels),
        "not_finite": int((~np.isfinite(distance)).any(axis=(1, 2)).sum()),
    }


def bands(distance: FloatArray, channels: Channels) -> dict[str, Mapping[str, list[float]]]:
    """Median and the 10 % and 90 % quantiles over the rollouts, per channel and time step."""
    with np.errstate(invalid="ignore"):  # between infinities lies nothing
        low, median, high = np.quantile(distance, [0.1, 0.5, 0.9], axis=0)
    return {
        name: {"q10": low[:, i].tolist(), "median": median[:, i].tolist(), "q90": high[:, i].tolist()}
        for i, name in enumerate(channels.names)
    }


def root_mean_square(distance: FloatArray, channels: Channels) -> dict[str, float]:
    """Root mean square over rollouts and time, per channel."""
    return {name: float(np.sqrt(np.mean(distance[:, :, i] ** 2))) for i, name in enumerate(channels.names)}
