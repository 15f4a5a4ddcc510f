"""A drive that is elastic: a motor of its own inertia turns a load through a spring and a damper.

J w' = u - T, T = k z + d z', and the load is accelerated by a + m T, where a is what all else does to it and m what a
unit of command does. So the twist z, by which the motor is ahead, obeys z'' = u / J - a - (1 / J + m) T: an oscillator
that is pushed. Over a substep the push is taken for constant. Then twist and rate are known exactly, whatever the
stiffness, and so is the mean of T, which is what the load gets: no stiffness makes a step unstable.

A twist (B, 2) is z and z'. J, k and d are counted in units of the command, which is a force or is turned into one.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import Values

CRITICAL = 1e-6  # of the frequencies: nearer to each other both roots are one


def waves(gamma: FloatArray, square: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(B,) each: e^-gh cosh(r h) and e^-gh sinh(r h) / r, r^2 = g^2 - square, of an oscillator."""
    root = np.sqrt(np.abs(gamma**2 - square))
    angle, faded = root * step, np.exp(-gamma * step)
    few = np.maximum(root, 1e-300)
    slow = np.exp(-square / (gamma + few) * step)  # gamma - root, without cancellation
    fast = np.exp(-(gamma + root) * step)
    over = gamma**2 > square
    cosh = np.where(over, (slow + fast) / 2, faded * np.cos(angle))
    sinh = np.where(over, (slow - fast) / 2, faded * np.sin(angle)) / few
    return np.asarray(cosh), np.asarray(np.where(angle < CRITICAL, faded * step, sinh))


def twisted(
    twist: FloatArray, push: FloatArray, reacts: FloatArray, step: FloatArray, values: Values
) -> tuple[FloatArray, FloatArray]:
    """(B, 2) the twist after a substep (B,) s under a push (B,), and (B,) the mean of what it transmits.

    reacts: (B,) m, by how much a unit of command accelerates the load.
    """
    light = 1.0 / values["inertia"] + reacts
    square, gamma = light * values["stiffness"], light * values["damping"] / 2
    cosh, sinh = waves(gamma, square, step)
    rest = push / square
    z, rate = twist[:, 0] - rest, twist[:, 1]
    end = rest + (cosh + gamma * sinh) * z + sinh * rate
    speed = -square * sinh * z + (cosh - gamma * sinh) * rate
    return np.stack([end, speed], axis=1), np.asarray((push - (speed - rate) / step) / light)


def transmitted(
    twist: FloatArray, u: FloatArray, own: FloatArray, reacts: FloatArray, step: FloatArray, values: Values
) -> FloatArray:
    """(B,) the mean of what reaches the load over a substep (B,) s; own: (B,) its acceleration without it.

    Where time runs backwards the twist stays as it is.
    """
    _, mean = twisted(twist, u / values["inertia"] - own, reacts, np.maximum(step, 1e-9), values)
    held = values["stiffness"] * twist[:, 0] + values["damping"] * twist[:, 1]
    return np.asarray(np.where(step < 0.0, held, mean))


def turned(
    twist: FloatArray, u: FloatArray, moved: FloatArray, reacts: FloatArray, step: FloatArray, values: Values
) -> FloatArray:
    """(B, 2) the twist after a substep (B,) s in which the load was accelerated by `moved` (B,) in the mean.

    What else acted on the load follows from that, friction included: the mean is linear in it.
    """
    h = np.maximum(step, 1e-9)
    free = u / values["inertia"]
    _, mean = twisted(twist, free, reacts, h, values)
    _, less = twisted(np.zeros_like(twist), np.ones_like(free), reacts, h, values)
    own = (moved - reacts * mean) / (1.0 - reacts * less)
    after, _ = twisted(twist, free - own, reacts, h, values)
    return np.asarray(np.where((step < 0.0)[:, None], twist, after))
