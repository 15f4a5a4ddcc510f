"""What stands along the way: a force that repeats, found by a scan over positions, and what pushes back at its ends.

What the base simulator misses of the forces is taken off smooth functions of position, speed and command by least
squares; what is left is held against sines of the position, one wave number after another (Lomb 1976, "Least-squares
frequency analysis of unequally spaced data", Astrophysics and Space Science 39).
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import BoolArray, FloatArray

FOUND = 3  # periods that are told, the strongest first
SHORTEST = 80.0  # periods in the way that was visited, of the last wave number
REPEATS = 3.0
"""Periods in the way between the outer hundredths of positions, of the first wave number: what was not seen to repeat
is no ripple, but any curve (beside a cubic spring it followed smooth laws of no family within the noise, three times of
8 worlds of seed 2060, with 1.7 to 2.3 periods)."""
WAVES = 400  # wave numbers that are tried
APART = 0.6  # periods in the way by which two that are told differ at least
A_SAMPLE = 3.0  # samples that a period takes at a usual speed, at least: what is faster is only its mean
WHOLE = 0.9  # of a turn, that a body reaches which turns on and on
CHANCE = 0.01  # with which noise alone makes one that is told
ROWS = 2000  # transitions that are looked at
TURN = 2.0 * np.pi  # rad, a whole turn
OUTER = 0.05  # of the way that is an end of it
STANDS_OUT = 4.0  # standard deviations of what is missed elsewhere


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
    counts = np.arange(np.ceil(least), most + 1.0) if wraps else np.linspace(least, most, WAVES)
    if most < least:
        return ()
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


def pushed_back(q: FloatArray, force: FloatArray) -> tuple[bool, bool]:
    """Whether, at the lower and the upper end of the way q (N,), a missed force (N,) stands out that points inward."""
    lowest, highest = float(q.min()), float(q.max())
    edge = OUTER * (highest - lowest)
    usual = 1.48 * float(np.median(np.abs(force - np.median(force))))

    def stands_out(outward: FloatArray, where: BoolArray) -> bool:
        return bool(where.any()) and float(np.quantile(-outward[where], 0.75)) > STANDS_OUT * usual

    return stands_out(-force, q < lowest + edge), stands_out(force, q > highest - edge)


def _without_smooth(q: FloatArray, speed: FloatArray, force: FloatArray, actions: FloatArray) -> FloatArray:
    """(N,) the force without what a smooth law of position, speed and command could be."""
    x, v = (a / max(float(np.std(a)), 1e-300) for a in (q - q.mean(), speed))
    columns = [np.ones_like(x), x, x**2, x**3, v, v * np.abs(v), np.sign(v), np.sin(q), np.cos(q), *actions.T]
    basis = np.stack(columns, axis=1)
    size, *_ = np.linalg.lstsq(basis, force, rcond=None)
    return np.asarray(force - basis @ size)
