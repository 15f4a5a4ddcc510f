"""What stands along the way: a force that repeats, found by a scan over positions, and what pushes back at its ends.

What the base simulator misses of the forces is taken off smooth functions of position, speed and command by least
squares; what is left is held against sines of the position, one wave number after another (Lomb 1976, "Least-squares
frequency analysis of unequally spaced data", Astrophysics and Space Science 39). What is missed bends at an edge: a
straight line of the position and the depth behind the edge are held against it, one edge after another.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray

FOUND = 3  # periods that are told, the strongest first
SHORTEST = 80.0  # periods in the way that was visited, of the last wave number
REPEATS = 2.5
"""Periods in the way between the outer hundredths of positions, of the first wave number: what was not seen to repeat
is no ripple, but any curve (beside a cubic spring it followed smooth laws of no family within the noise, three times of
8 worlds of seed 2060, with 1.7 to 2.3 periods; one of them is left that repeats as often)."""
WAVES = 400  # wave numbers that are tried
APART = 0.6  # periods in the way by which two that are told differ at least
A_SAMPLE = 3.0  # samples that a period takes at a usual speed, at least: what is faster is only its mean
WHOLE = 0.9  # of a turn, that a body reaches which turns on and on
CHANCE = 0.05  # with which noise alone makes one that is told; that costs time alone, as it is fitted and has to pay
ROWS = 2000  # transitions that are looked at
TURN = 2.0 * np.pi  # rad, a whole turn
EDGES = 60  # positions, between the middle and an end, at which an edge is tried
OUTER, FEWEST = 0.08, 8
"""Of the rows, at most, that are beyond an edge, and rows at least (of stops 1.6 to 6.8 % are; of smooth forces of
position that no family has, in seven of the nine places where an edge stood out, 9.5 % and more)."""
LEAST = 0.01
"""Of what a straight line leaves, that an edge takes off (by hand, the twelve worlds of seed 2061 with stops: 1.2 to
75 %; seventeen of seed 2060 without: less than 0.6 %, but 3 % in one, of Stribeck friction in a region)."""
Edges = tuple[float | None, float | None]
"""The lower and the upper one; None where there is none."""


def ripples(
    q: FloatArray, speed: FloatArray, force: FloatArray, actions: FloatArray, dt: float, wraps: bool
) -> tuple[tuple[float, float], ...]:
    """(period, phase) of the strongest ripples of a force (N,) along q (N,), which may be an angle that wraps.

    actions: (N, A). Nothing where too little moves, or where noise would make as strong a one.
    """
    pick = np.linspace(0, len(q) - 1, min(len(q), ROWS)).astype(int)
    q, speed, force, actions = q[pick], speed[pick], force[pick], actions[pick]
    way = TURN if wraps else float(np.ptp(q))
    usual = float(np.quantile(np.abs(speed), 0.5))
    if len(q) < 50 or way <= 0.0 or usual <= 0.0:
        return ()
    left = _without_smooth(q, speed, force, actions)
    least, most = _fewest(q, way, wraps), min(SHORTEST, way / (A_SAMPLE * usual * dt))
    if most < least:
        return ()
    counts = np.arange(np.ceil(least), most + 1.0) if wraps else np.linspace(least, most, WAVES)
    found: list[tuple[float, float, float]] = []
    for count in counts:
        angle = TURN * count * q / way
        columns = np.stack([np.sin(angle), np.cos(angle)], axis=1)
        size, *_ = np.linalg.lstsq(columns, left, rcond=None)
        found.append((float((columns @ size) @ left), count, float(np.arctan2(size[1], size[0]))))
    chance = (
        2.0 * np.log(len(counts) / CHANCE) * float(np.mean(left**2))
    )  # of the largest of so many, by noise
    if max(found)[0] < chance:
        return ()
    chosen: list[tuple[float, float]] = []
    for _, count, phase in sorted(found, reverse=True):
        if all(abs(count - way / period) >= APART for period, _ in chosen):
            chosen.append((way / count, phase))
        if len(chosen) == FOUND:
            break
    return tuple(chosen)


def _fewest(q: FloatArray, way: float, wraps: bool) -> float:
    """Periods in the way of a ripple that is seen to repeat: one where the body turns on and on."""
    low, high = np.quantile(q, [0.01, 0.99])
    seen = max(float(high - low) / way, 1.0 / SHORTEST)
    return 1.0 if wraps and seen > WHOLE else REPEATS / seen


def pushed_back(q: FloatArray, force: FloatArray) -> Edges:
    """Where, towards the lower and the upper end of the way q (N,), a missed force (N,) begins to point inward."""
    below, above = _edge(-q, -force), _edge(q, force)
    return None if below is None else -below, above


def _edge(q: FloatArray, force: FloatArray) -> float | None:
    """The position beyond which a force falls off a straight line of positions; None where chance makes as much.

    Nor where that is no end: what bends long before is a law of the position.
    """
    line = np.stack([np.ones_like(q), q - q.mean()], axis=1)
    best, edge = max(LEAST, 2.0 * float(np.log(EDGES / CHANCE)) / len(q)), float("inf")
    left = _unlike(line, force)
    for at in np.linspace(float(np.median(q)), float(q.max()), EDGES + 1)[:-1]:
        beyond = np.maximum(q - at, 0.0)
        if np.count_nonzero(beyond) < FEWEST:
            break
        depth = _unlike(line, beyond)
        along = float(depth @ left)
        share = along**2 / max(float((depth @ depth) * (left @ left)), 1e-300)
        if along < 0.0 and share > best:
            best, edge = share, float(at)
    return edge if 0 < np.count_nonzero(q > edge) <= OUTER * len(q) else None


def _unlike(line: FloatArray, values: FloatArray) -> FloatArray:
    """(N,) what no combination of the columns (N, C) makes of values."""
    return np.asarray(values - line @ np.linalg.lstsq(line, values, rcond=None)[0])


def _without_smooth(q: FloatArray, speed: FloatArray, force: FloatArray, actions: FloatArray) -> FloatArray:
    """(N,) the force without what a smooth law of position, speed and command could be."""
    x, v = (a / max(float(np.std(a)), 1e-300) for a in (q - q.mean(), speed))
    columns = [np.ones_like(x), x, x**2, x**3, v, v * np.abs(v), np.sign(v), np.sin(q), np.cos(q), *actions.T]
    return _unlike(np.stack(columns, axis=1), force)
