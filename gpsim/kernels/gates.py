"""Where and when a term acts: the share of a substep, one row at a time (see `gpsim.effects.term.Gate`)."""

from __future__ import annotations

import math

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    CHANNEL,
    EPISODE,
    HAT,
    HIGH,
    KIND,
    KNOTS,
    KNOTS_END,
    LOW,
    REGION,
    SINCE,
    UNTIL,
    WRAPS,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.curves import channel, hat
from gpsim.kernels.scalars import larger, smaller, wrapped
from gpsim.kernels.systems import State


@compiled
def between(begin: float, end: float, low: float, high: float) -> float:
    """The share of the way from begin to end that lies in [low, high]."""
    way = larger(begin, end) - smaller(begin, end)
    if not way > 0.0:
        return 1.0 if begin >= low and begin <= high else 0.0
    inside = smaller(larger(begin, end), high) - larger(smaller(begin, end), low)
    return smaller(larger(inside / way, 0.0), 1.0)


@compiled
def after(moment: float, t: float, step: float) -> float:
    """The share of the time from t to t + step that lies after a moment."""
    late = larger(t, t + step) - moment
    if abs(step) > 0.0:
        return smaller(larger(late / abs(step), 0.0), 1.0)
    return 1.0 if late >= 0.0 else 0.0


@compiled
def share(
    first: int,
    last: int,
    conditions: IntArray,
    knots: FloatArray,
    v: FloatArray,
    begin: State,
    end: State,
    u: tuple[float, float],
    t: float,
    step: float,
) -> float:
    """Of the conditions first to last: how much of the time from t to t + step all of them hold."""
    out = 1.0
    for i in range(first, last):
        about = conditions[i]
        kind = about[KIND]
        if kind == REGION:
            low, high = v[about[LOW]], v[about[HIGH]]
            a, b = channel(begin, u, about[CHANNEL]), channel(end, u, about[CHANNEL])
            if about[WRAPS]:
                turns = 2.0 * math.pi * np.rint((a - 0.5 * (low + high)) / (2.0 * math.pi))
                a, b = a - turns, b - turns
            out *= between(a, b, low, high)
        elif kind == SINCE:
            out *= after(v[about[LOW]], t, step)
        elif kind == UNTIL:
            out *= 1.0 - after(v[about[LOW]], t, step)
        elif kind == EPISODE:
            out *= 1.0 if v[about[HIGH]] >= v[about[LOW]] else 0.0
        else:
            x = channel(begin, u, about[CHANNEL])
            x = wrapped(x) if about[WRAPS] else x
            out *= hat(x, knots, about[KNOTS], about[KNOTS_END], about[LOW])
    return out
