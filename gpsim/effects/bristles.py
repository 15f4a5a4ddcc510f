"""Bristles: friction that yields before it slides, with one hidden number a coordinate, how far the bristles are bent.

Canudas de Wit, Olsson, Astrom and Lischinsky (1995): z' = v - k |v| z / g(v), force -(k z + d z'). Over a substep the
speed is taken for constant. Then the bend is known exactly, whatever the stiffness: with the way s = v h and
a = k |s| / g(v) it goes from z to z e^-a + s (1 - e^-a) / a. So is its mean, and with both the mean force. The speed
itself is the mean of those at the substep's ends, of which the later one depends on the force: one equation for one
number, whose solution is bracketed. So a step is stable however stiff the bristles are.

Damping is no parameter: d = sqrt(k m), m the inertia that the coordinate has there, as in the example of that paper.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import Values

ROUNDS = 60  # of the search, at most: usually it takes eight
EXACT = 1e-12  # of the speeds: how exact it is


def level(speed: FloatArray, values: Values) -> FloatArray:
    """(B,) what slides at a speed: the sliding force, and more the slower."""
    more = np.maximum(values.get("static_force", 0.0) - values["force"], 0.0)
    fall = np.exp(-((speed / values.get("stribeck_velocity", 1.0)) ** 2))
    return np.asarray(np.maximum(values["force"] + more * fall, 1e-300))


def bent(
    bend: FloatArray, way: FloatArray, speed: FloatArray, values: Values
) -> tuple[FloatArray, FloatArray]:
    """(B,) each: how far the bristles are bent after a way at a speed, and how far in the mean."""
    stiffness = values["stiffness"]
    a = stiffness * np.abs(way) / level(speed, values)
    few = np.maximum(a, 1e-5)
    first = np.where(a < 1e-5, 1.0 - a / 2, -np.expm1(-few) / few)
    some = np.maximum(a, 1e-3)
    second = np.where(a < 1e-3, 0.5 - a / 6 + a * a / 24, (1.0 + np.expm1(-some) / some) / some)
    return np.asarray(bend * np.exp(-a) + way * first), np.asarray(bend * first + way * second)


def mean_force(
    bend: FloatArray, speed: FloatArray, own: FloatArray, reacts: FloatArray, step: FloatArray, values: Values
) -> FloatArray:
    """(B,) the mean force over a substep (B,) s, in which a coordinate begins at a speed and is accelerated.

    own: (B,) its acceleration without bristles; reacts: (B,) by how much a unit force changes that. Where time runs
    backwards the bristles stay as they are.
    """
    stiffness, backwards = values["stiffness"], step < 0.0
    step = np.maximum(np.abs(step), 1e-9)
    damping, free = np.sqrt(stiffness / reacts), speed + step / 2 * own

    def missed(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        end, mean = bent(bend, at * step, at, values)
        force = -(stiffness * mean + damping * (end - bend) / step)
        return at - free - step / 2 * reacts * force, force

    furthest = np.maximum(np.abs(bend), level(np.zeros_like(speed), values) / stiffness)
    most = step / 2 * reacts * (stiffness + 2 * damping / step) * furthest
    low, high = free - most, free + most
    (left, _), (right, force) = missed(low), missed(high)
    close = EXACT * (np.abs(speed) + np.abs(free) + most)
    for _ in range(ROUNDS):
        at = high - right * (high - low) / np.where(right == left, 1.0, right - left)
        off, force = missed(at)
        if (np.abs(off) <= close).all():
            break
        crossed = off * right < 0.0
        low, left = np.where(crossed, high, low), np.where(crossed, right, 0.5 * left)
        high, right = at, off
    return np.asarray(np.where(backwards, -stiffness * bend, force))
