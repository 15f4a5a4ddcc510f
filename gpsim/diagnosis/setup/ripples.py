"""The periods of a force that repeats along the way: a scan over the positions of a recording.

What the base simulator misses of the forces is taken off smooth functions of position, speed and command by least
squares; what is left is held against sines of the position, one wave number after another (Lomb 1976, "Least-squares
frequency analysis of unequally spaced data", Astrophysics and Space Science 39).
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray

FOUND = 3  # periods that are told, the strongest first
LONGEST, SHORTEST = 1.0, 80.0  # periods in the way that was visited: of the first and of the last wave number
WAVES = 400  # wave numbers that are tried
APART = 0.6  # periods in the way by which two that are told differ at least
A_SAMPLE = 3.0  # samples that a period takes at a usual speed, at least: what is faster is only its mean
ROWS = 2000  # transitions that are looked at
TURN = 2.0 * np.pi


def ripples(
    q: FloatArray, speed: FloatArray, force: FloatArray, actions: FloatArray, dt: float, wraps: bool
) -> tuple[tuple[float, float], ...]:
    """(period, phase) of the strongest ripples of a force (N,) along q (N,), which may be an angle that wraps.

    actions: (N, A). Nothing where too little moves.
    """
    pick = np.linspace(0, len(q) - 1, min(len(q), ROWS)).astype(int)
    q, speed, force, actions = q[pick], speed[pick], force[pick], actions[pick]
    way = TURN if wraps else float(np.ptp(q))
    usual = float(np.quantile(np.abs(speed), 0.5))
    if len(q) < 50 or way <= 0.0 or usual <= 0.0:
        return ()
    left = _without_smooth(q, speed, force, actions)
    most = min(SHORTEST, way / (A_SAMPLE * usual * dt))
    counts = np.arange(1.0, most + 1.0) if wraps else np.linspace(LONGEST, max(most, 2.0), WAVES)
    found: list[tuple[float, float, float]] = []
    for count in counts:
        angle = TURN * count * q / way
        columns = np.stack([np.sin(angle), np.cos(angle)], axis=1)
        size, *_ = np.linalg.lstsq(columns, left, rcond=None)
        found.append((float((columns @ size) @ left), count, float(np.arctan2(size[1], size[0]))))
    chosen: list[tuple[float, float]] = []
    for _, count, phase in sorted(found, reverse=True):
        if all(abs(count - way / period) >= APART for period, _ in chosen):
            chosen.append((way / count, phase))
        if len(chosen) == FOUND:
            break
    return tuple(chosen)


def _without_smooth(q: FloatArray, speed: FloatArray, force: FloatArray, actions: FloatArray) -> FloatArray:
    """(N,) the force without what a smooth law of position, speed and command could be."""
    x, v = (a / max(float(np.std(a)), 1e-300) for a in (q - q.mean(), speed))
    columns = [np.ones_like(x), x, x**2, x**3, v, v * np.abs(v), np.sign(v), np.sin(q), np.cos(q), *actions.T]
    basis = np.stack(columns, axis=1)
    size, *_ = np.linalg.lstsq(basis, force, rcond=None)
    return np.asarray(force - basis @ size)
