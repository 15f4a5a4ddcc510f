"""Layer 3 of a task with a goal: whether a policy gets there, in how many steps, and how far it drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.environments import Act, Episodes
from gpsim.evaluation.statistics import bootstrap_interval
from gpsim.simulators import Plant
from gpsim.tasks import GoalReaching, Start


@dataclass(frozen=True)
class Trips:
    """One trip from each start, all (N,) but paths.

    reached: whether the goal was; steps: control steps until it was over; path: metres driven; returns: undiscounted;
    paths: (N, T + 1, S) true states, NaN after the end.
    """

    reached: BoolArray
    steps: FloatArray
    path: FloatArray
    returns: FloatArray
    paths: FloatArray


def take_trips(plant: Plant, task: GoalReaching, act: Act, start: Start, rng: np.random.Generator) -> Trips:
    """Drive from every start until the goal, the edge or the last step."""
    count = len(start.states)
    running = Episodes(plant, task, count, rng)
    observations = running.begin(start)
    alive, reached = np.ones(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    returns, steps = np.zeros(count), np.zeros(count)
    paths = [running.states]
    for _ in range(task.max_steps):
        rewards, terminated, _ = running.step(act(observations))
        paths.append(np.where(alive[:, None], running.states, np.nan))
        returns += np.where(alive, rewards, 0.0)
        steps += alive
        reached |= alive & task.reached(running.states, running.context)
        alive &= ~terminated
        if not alive.any():
            break
        observations = running.observe()
    states = np.stack(paths, axis=1)
    return Trips(reached, steps, path_length(states), returns, states)


def path_length(states: FloatArray) -> FloatArray:
    """(N,) metres along paths (N, T + 1, S) whose first two columns are x and y; NaN rows count for nothing."""
    return np.asarray(np.nansum(np.hypot(*np.moveaxis(np.diff(states[..., :2], axis=1), -1, 0)), axis=1))


def behind(task: GoalReaching, start: Start) -> BoolArray:
    """(N,): starts that face away from the goal, by more than a right angle."""
    return np.asarray(np.abs(task.bearing(start.states, start.context)) > np.pi / 2)


@dataclass(frozen=True)
class AllTrips:
    """Trips of every policy and seed: reached, steps, path by policy (seeds, N); behind: (N,) starts that face away."""

    reached: Mapping[str, BoolArray]
    steps: Mapping[str, FloatArray]
    path: Mapping[str, FloatArray]
    behind: BoolArray


def success_by_set(trips: AllTrips, sets: Mapping[str, BoolArray]) -> dict[str, dict[str, Any]]:
    """success, success_all and success_certified, on the sets of starts keyed as the returns are: policy to summary."""
    return {
        key.replace("returns", "success"): {
            name: summarise_trips(trips, name, starts) for name in trips.reached
        }
        for key, starts in sets.items()
    }


def summarise_trips(trips: AllTrips, name: str, starts: BoolArray) -> dict[str, Any]:
    """A policy's success, steps and metres over the chosen starts (N,).

    rate, by_seed, interval (95 % bootstrap over seeds and starts): share of trips that reached the goal; behind and
    ahead: from starts that face away from the goal, and from the others. steps and path are means over the trips that
    reached it; of_target compares their sums on the trips that the Target policy of the same seed completed too.
    """
    chosen = trips.reached[name][:, starts]
    if not chosen.size:
        return {"episodes": 0}
    there = trips.reached[name] & starts
    found: dict[str, Any] = {
        "rate": float(chosen.mean()),
        "episodes": int(chosen.size),
        "interval": list(bootstrap_interval(chosen.astype(np.float64), lambda r: float(r.mean()))),
        "by_seed": chosen.mean(axis=1).tolist(),
        "behind": _mean(trips.reached[name][:, starts & trips.behind]),
        "ahead": _mean(trips.reached[name][:, starts & ~trips.behind]),
        "steps": _mean(trips.steps[name][there]),
        "path": _mean(trips.path[name][there]),
    }
    if "Target" in trips.reached:
        both = there & trips.reached["Target"]
        found["of_target"] = {
            "trips": int(both.sum()),
            "steps": _ratio(trips.steps[name][both], trips.steps["Target"][both]),
            "path": _ratio(trips.path[name][both], trips.path["Target"][both]),
        }
    return found


def _mean(values: FloatArray | BoolArray) -> float | None:
    return float(np.mean(values)) if np.size(values) else None


def _ratio(mine: FloatArray, theirs: FloatArray) -> float | None:
    return float(mine.sum() / theirs.sum()) if mine.size else None
