"""Trips to a goal: how a vehicle gets there, and whether a path exists at all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.environments import Act
from gpsim.evaluation.returns import bootstrap_interval, play
from gpsim.simulators import Plant
from gpsim.tasks import GoalReaching, Start

ARCS = np.deg2rad(np.arange(0.0, 360.0, 15.0))
LEGS = np.arange(0.0, 2.01, 0.2)
"""How long the first arc [rad] and the first straight [m] of the tried paths are."""
POINTS = np.linspace(0.0, 1.0, 13)


def solvable(
    states: FloatArray, goals: FloatArray, radius: float, half_floor: float, longest: float
) -> BoolArray:
    """(N,) True where a path of arc, straight, arc and straight, forwards, leads to the goal without crossing the edge.

    states (N, 3) poses, goals (N, 2); both arcs have the least radius [m], either way round; the floor is the square
    |x|, |y| <= half_floor [m]; paths are at most `longest` [m]. The last arc ends where the car faces the goal (as
    Dubins paths with a free final heading do); False proves nothing, a finer family may find more.
    """
    each = zip(states, goals, strict=True)
    return np.array([bool(_found(*pair, radius, half_floor, longest).any()) for pair in each])


def _found(state: FloatArray, goal: FloatArray, radius: float, half: float, longest: float) -> BoolArray:
    """(P,) which of the tried paths do."""
    side, arc, leg, last = (
        grid.ravel() for grid in np.meshgrid([1.0, -1.0], ARCS, LEGS, [1.0, -1.0], indexing="ij")
    )
    pose = np.tile(state, (len(side), 1))
    inside = np.ones(len(side), dtype=np.bool_)
    pose, inside = _turn(pose, side, arc, radius, half, inside)
    pose = pose + np.column_stack([leg * np.cos(pose[:, 2]), leg * np.sin(pose[:, 2]), 0.0 * leg])
    inside &= (np.abs(pose[:, :2]) <= half).all(axis=1)
    turn, straight = _last_turn(pose, goal, last, radius)
    pose, inside = _turn(pose, last, np.nan_to_num(turn), radius, half, inside)
    length = radius * (arc + np.nan_to_num(turn)) + leg + np.nan_to_num(straight)
    return np.asarray(inside & np.isfinite(turn) & (length <= longest))


def _turn(
    pose: FloatArray, side: FloatArray, angle: FloatArray, radius: float, half: float, inside: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """The pose after an arc to the left (side 1) or right (-1), and which arcs stay on the floor."""
    yaw = pose[:, 2:3] + (side * angle)[:, None] * POINTS
    x = pose[:, :1] + (side * radius)[:, None] * (np.sin(yaw) - np.sin(pose[:, 2:3]))
    y = pose[:, 1:2] - (side * radius)[:, None] * (np.cos(yaw) - np.cos(pose[:, 2:3]))
    stays = (np.abs(x) <= half).all(axis=1) & (np.abs(y) <= half).all(axis=1)
    return np.column_stack([x[:, -1], y[:, -1], yaw[:, -1]]), np.asarray(inside & stays)


def _last_turn(
    pose: FloatArray, goal: FloatArray, side: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """How far to turn [rad] until the car faces the goal, and how far it is then [m]; NaN: inside the circle."""
    centre = pose[:, :2] + (side * radius)[:, None] * np.column_stack(
        [-np.sin(pose[:, 2]), np.cos(pose[:, 2])]
    )
    offset = goal - centre
    distance = np.hypot(*offset.T)
    with np.errstate(invalid="ignore"):
        straight = np.sqrt(distance**2 - radius**2)
        # At the tangent point the goal lies `straight` ahead and `radius` to the inner side of the circle's centre.
        facing = np.arctan2(offset[:, 1], offset[:, 0]) + side * np.arctan2(radius, straight)
    return np.asarray((side * (facing - pose[:, 2])) % (2.0 * np.pi)), straight


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
    reached = np.zeros(len(start.states), dtype=np.bool_)
    returns, steps = np.zeros((2, len(start.states)))
    paths = [start.states]
    for running, alive, earned in play(plant, task, act, start, rng):
        paths.append(np.where(alive[:, None], running.states, np.nan))
        returns += earned
        steps += alive
        reached |= alive & task.reached(running.states, running.context)
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
