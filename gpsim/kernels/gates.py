"""Where and when a term acts: shares of a substep for lanes of rows (see `gpsim.effects.term.Gate`)."""

from __future__ import annotations

import math

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.kernels.circular import WHOLE
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

TURN = 2.0 * math.pi


@compiled
def between(begin: float, end: float, low: float, high: float) -> float:
    """The share of the way from begin to end that lies in [low, high]."""
    first, last = smaller(begin, end), larger(begin, end)
    way = last - first
    inside = smaller(last, high) - larger(first, low)
    share = smaller(larger(inside / way, 0.0), 1.0)
    return share if way > 0.0 else (1.0 if (begin >= low) & (begin <= high) else 0.0)


@compiled
def after(moment: float, t: float, step: float) -> float:
    """The share of the time from t to t + step that lies after a moment."""
    late = larger(t, t + step) - moment
    if abs(step) > 0.0:
        return smaller(larger(late / abs(step), 0.0), 1.0)
    return 1.0 if late >= 0.0 else 0.0


@compiled
def holds(
    conditions: IntArray,
    c: int,
    knots: FloatArray,
    v: FloatArray,
    i: int,
    begin: float,
    end: float,
    t: float,
    step: float,
) -> float:
    """The share of the time from t to t + step in which a condition holds; its channel goes from begin to end."""
    kind, low, high = conditions[c, KIND], conditions[c, LOW], conditions[c, HIGH]
    if kind == REGION:
        edge, other = v[low, i], v[high, i]
        if conditions[c, WRAPS]:
            turns = 2.0 * math.pi * np.rint((begin - 0.5 * (edge + other)) / (2.0 * math.pi))
            begin, end = begin - turns, end - turns
        return between(begin, end, edge, other)
    if kind == SINCE:
        return after(v[low, i], t, step)
    if kind == UNTIL:
        return 1.0 - after(v[low, i], t, step)
    if kind == EPISODE:
        return 1.0 if v[high, i] >= v[low, i] else 0.0
    x = wrapped(begin) if conditions[c, WRAPS] else begin
    return hat(x, knots, conditions[c, KNOTS], conditions[c, KNOTS_END], low)


@compiled
def share_of(
    first: int,
    last: int,
    conditions: IntArray,
    knots: FloatArray,
    v: FloatArray,
    i: int,
    path: FloatArray,
    t: float,
    step: float,
) -> float:
    """The share in which all of the conditions first to last hold; path: (2, 6) the channels at both ends."""
    out = 1.0
    for c in range(first, last):
        column = conditions[c, CHANNEL]
        out *= holds(conditions, c, knots, v, i, path[0, column], path[1, column], t, step)
    return out


@compiled
def multiply(
    b: FloatArray,
    lanes: int,
    conditions: IntArray,
    c: int,
    knots: FloatArray,
    v: FloatArray,
    looking: float,
    to: FloatArray,
) -> None:
    """Multiply `to` (lanes,) with the share of the substep in which a condition holds.

    looking: 1 where all of the substep counts, 0 where its begin does.
    """
    begin, end = channel(conditions[c, CHANNEL], X), channel(conditions[c, CHANNEL], AHEAD)
    kind, low, high = conditions[c, KIND], conditions[c, LOW], conditions[c, HIGH]
    if kind == REGION and conditions[c, WRAPS]:
        for i in range(lanes):
            middle = 0.5 * (v[low, i] + v[high, i])
            turns = TURN * (((b[begin + i] - middle) / TURN + WHOLE) - WHOLE)
            to[i] *= between(b[begin + i] - turns, b[end + i] - turns, v[low, i], v[high, i])
    elif kind == REGION:
        for i in range(lanes):
            to[i] *= between(b[begin + i], b[end + i], v[low, i], v[high, i])
    else:
        for i in range(lanes):
            step = looking * b[H + i]
            to[i] *= holds(conditions, c, knots, v, i, b[begin + i], b[end + i], b[T + i], step)


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
            multiply(b, lanes, conditions, c, knots, v, looking, shares[n])
