"""Scalar forms of NumPy's functions, with its ways with what is not a number."""

from __future__ import annotations

import math

from gpsim.kernels.compiling import compiled

FAR = 1e6  # what a diverging simulation is clipped to: far beyond any state, and its square is still a number


@compiled
def place(at: int) -> int:
    """An offset that is not negative, which the compiler then knows: no index is counted from an array's end.

    Loops over lanes from an offset that is found while it runs become vectors only so.
    """
    return max(at, 0)


@compiled
def larger(a: float, b: float) -> float:
    """As np.maximum: not a number where one of them is not."""
    return a if a >= b or a != a else b


@compiled
def smaller(a: float, b: float) -> float:
    """As np.minimum."""
    return a if a <= b or a != a else b


@compiled
def clipped(x: float, low: float, high: float) -> float:
    """As np.clip."""
    return smaller(larger(x, low), high)


@compiled
def sign(x: float) -> float:
    """As np.sign: 0 of both zeros."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else (0.0 if x == 0.0 else x))


@compiled
def wrapped(angle: float) -> float:
    """As `gpsim.channels.wrap_angle`: [rad] in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@compiled
def tamed(x: float) -> float:
    """A state that may have diverged, within FAR."""
    return FAR if x != x else min(max(x, -FAR), FAR)


@compiled
def blended(share: float, acted: float, untouched: float) -> float:
    """As `gpsim.effects.actuation.blended`."""
    return acted if share == 1.0 else share * acted + (1.0 - share) * untouched
