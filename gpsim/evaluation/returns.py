"""Layer 3: what a policy earns on the target.

How a policy does where it does worst: the mean of the worst tenth of its episodes beside the mean of all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.environments import Act, Episodes
from gpsim.evaluation.statistics import bootstrap_interval, interquartile_mean
from gpsim.simulators import Plant
from gpsim.tasks import Start, Task


def episode_returns(plant: Plant, task: Task, act: Act, start: Start, rng: np.random.Generator) -> FloatArray:
    """(N,): the undiscounted return of one episode from every start."""
    running = Episodes(plant, task, len(start.states), rng)
    observations = running.begin(start)
    returns, alive = np.zeros(len(start.states)), np.ones(len(start.states), dtype=np.bool_)
    for _ in range(task.max_steps):
        rewards, terminated, _ = running.step(act(observations))
        returns += np.where(alive, rewards, 0.0)
        alive &= ~terminated
        if not alive.any():
            break
        observations = running.observe()
    return returns


def summarise(returns: FloatArray, starts: BoolArray) -> dict[str, Any]:
    """Mean, spread and interval of returns (seeds, N) over the chosen starts (N,).

    std is over all episodes; the interval of the mean is a 95 % bootstrap over seeds and starts; iqm is the
    interquartile mean over all runs, with its interval; by_seed the mean of each seed.
    """
    chosen = returns[:, starts]
    if not chosen.size:
        return {"episodes": 0}
    return {
        "mean": float(chosen.mean()),
        "std": float(chosen.std()),
        "episodes": int(chosen.size),
        "interval": list(bootstrap_interval(chosen, lambda r: float(r.mean()))),
        "iqm": interquartile_mean(chosen),
        "iqm_interval": list(bootstrap_interval(chosen, interquartile_mean)),
        "by_seed": chosen.mean(axis=1).tolist(),
    }


def summarise_all(returns: Mapping[str, FloatArray], starts: BoolArray) -> dict[str, dict[str, Any]]:
    """`summarise` for every policy."""
    return {name: summarise(values, starts) for name, values in returns.items()}


TENTH = 0.1


def worst_tenth(returns: FloatArray) -> float:
    """The mean of the lowest tenth, of one episode at least (the conditional value at risk)."""
    flat = np.sort(np.asarray(returns, dtype=np.float64).ravel())
    return float(flat[: max(1, round(TENTH * flat.size))].mean())


def mean_and_worst(returns: FloatArray) -> dict[str, Any]:
    """Mean and worst tenth of returns (N,), each with the 95 % bootstrap interval over starts."""
    one = returns[None]
    return {
        "mean": float(returns.mean()),
        "interval": list(bootstrap_interval(one, lambda r: float(r.mean()))),
        "worst_tenth": worst_tenth(returns),
        "worst_tenth_interval": list(bootstrap_interval(one, worst_tenth)),
        "episodes": int(returns.size),
    }


def robustness_lines(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> list[str]:
    """A line a policy and place."""
    return [
        f"on {'the target' if where == 'target' else 'draws of the posterior'}, {name}: mean {of['mean']:.1f}, worst "
        f"tenth {of['worst_tenth']:.1f} ({of['worst_tenth_interval'][0]:.1f} to {of['worst_tenth_interval'][1]:.1f})"
        for where, policies in found.items()
        for name, of in policies.items()
    ]
