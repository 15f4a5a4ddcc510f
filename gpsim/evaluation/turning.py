"""Which starts a car with a least turning radius can solve on a floor with edges: geometry alone, nothing learnt."""

from __future__ import annotations

import numpy as np

from gpsim.channels import BoolArray, FloatArray

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
    return np.array(
        [
            bool(_found(state, goal, radius, half_floor, longest).any())
            for state, goal in zip(states, goals, strict=True)
        ]
    )


def _found(state: FloatArray, goal: FloatArray, radius: float, half: float, longest: float) -> BoolArray:
    """(P,) which of the tried paths do."""
    side, arc, leg, last = (
        grid.ravel() for grid in np.meshgrid([1.0, -1.0], ARCS, LEGS, [1.0, -1.0], indexing="ij")
    )
    pose = np.tile(state, (len(side), 1))
    inside = np.ones(len(side), dtype=np.bool_)
    pose, inside = _turn(pose, side, arc, radius, half, inside)
    pose = pose + np.column_stack([leg * np.cos(pose[:, 2]), leg * np.sin(pose[:, 2]), 0.0 * leg])
    inside &= _within(pose, half)
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


def _within(pose: FloatArray, half: float) -> BoolArray:
    return np.asarray((np.abs(pose[:, :2]) <= half).all(axis=1))


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
