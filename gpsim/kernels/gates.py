"""Where and when a term acts: shares of a substep for lanes of rows (see `gpsim.effects.term.Gate`)."""

from __future__ import annotations

import math

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.codes import (
    CHANNEL,
    EPISODE,
    FINE,
    GATE,
    GATE_END,
    HIGH,
    KIND,
    KNOTS,
    KNOTS_END,
    LOW,
    REGION,
    SCHEME,
    SINCE,
    TERMS,
    UNTIL,
    WRAPS,
)
from gpsim.kernels.compiling import compiled
from gpsim.kernels.curves import channel, hat
from gpsim.kernels.lanes import AHEAD, H, T, X
from gpsim.kernels.scalars import larger, smaller, wrapped


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
def find_shares(
    b: FloatArray,
    lanes: int,
    layout: IntArray,
    terms: IntArray,
    conditions: IntArray,
    knots: FloatArray,
    v: FloatArray,
    shares: FloatArray,
) -> None:
    """Fill shares with how much of the substep each term behind a gate acts.

    The base simulator's own step takes what acts at its start.
    """
    looking = 1.0 if layout[SCHEME] == FINE else 0.0
    for n in range(layout[TERMS]):
        if terms[n, GATE] == terms[n, GATE_END]:
            continue
        for i in range(lanes):
            shares[n, i] = 1.0
        for c in range(terms[n, GATE], terms[n, GATE_END]):
            kind, low, high = conditions[c, KIND], conditions[c, LOW], conditions[c, HIGH]
            begin, end = channel(conditions[c, CHANNEL], X), channel(conditions[c, CHANNEL], AHEAD)
            for i in range(lanes):
                if kind == REGION:
                    edge, other, one, two = v[low, i], v[high, i], b[begin + i], b[end + i]
                    if conditions[c, WRAPS]:
                        turns = 2.0 * math.pi * np.rint((one - 0.5 * (edge + other)) / (2.0 * math.pi))
                        one, two = one - turns, two - turns
                    acts = between(one, two, edge, other)
                elif kind == SINCE:
                    acts = after(v[low, i], b[T + i], looking * b[H + i])
                elif kind == UNTIL:
                    acts = 1.0 - after(v[low, i], b[T + i], looking * b[H + i])
                elif kind == EPISODE:
                    acts = 1.0 if v[high, i] >= v[low, i] else 0.0
                else:
                    x = wrapped(b[begin + i]) if conditions[c, WRAPS] else b[begin + i]
                    acts = hat(x, knots, conditions[c, KNOTS], conditions[c, KNOTS_END], low)
                shares[n, i] *= acts
