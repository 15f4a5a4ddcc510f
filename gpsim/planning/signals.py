"""Candidate commands: what identification plays, at random sizes and frequencies. They begin and end at rest.

Multisines of random frequencies, with Schroeder's phases, which keep the peaks low (Schroeder 1970), or random ones;
chirps; pseudo-random binary sequences and steps; ramps through zero; dwells at a level; and periodic Fourier series,
whose position, speed and acceleration vanish at both ends (Swevers and others 1997), as arms are excited.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from gpsim.channels import FloatArray

Shape = Callable[[FloatArray, float, float, np.random.Generator], FloatArray]
"""shape(t (L,), slowest Hz, fastest Hz, rng) -> (L,) in about [-1, 1]."""
HARMONICS = 5
TAPER = 0.1  # of a piece at each end, in which a wave grows and fades


def multisine(t: FloatArray, slow: float, fast: float, rng: np.random.Generator) -> FloatArray:
    """A sum of up to twelve sines between two random frequencies."""
    low, high = np.sort(_frequencies(slow, fast, 2, rng))
    count = int(rng.integers(3, 13))
    frequency = np.linspace(low, max(high, 1.2 * low), count)
    k = np.arange(count)
    phase = -np.pi * k * (k + 1) / count if rng.random() < 0.5 else rng.uniform(0.0, 2 * np.pi, count)
    return _unit(np.sin(2 * np.pi * frequency * t[:, None] + phase).sum(axis=1)) * _tapered(t)


def chirp(t: FloatArray, slow: float, fast: float, rng: np.random.Generator) -> FloatArray:
    """A sine whose frequency grows, or falls, from one to another."""
    begin, end = _frequencies(slow, fast, 2, rng)
    return swept(t, float(begin), float(end)) * _tapered(t)


def swept(t: FloatArray, begin: float, end: float) -> FloatArray:
    """A sine whose frequency goes evenly in its logarithm."""
    ratio, length = np.log(end / begin), max(float(t[-1]), 1e-9)
    if abs(ratio) < 1e-3:
        return np.asarray(np.sin(2 * np.pi * begin * t))
    return np.asarray(np.sin(2 * np.pi * begin * length / ratio * (np.exp(ratio * t / length) - 1.0)))


def binary(t: FloatArray, slow: float, fast: float, rng: np.random.Generator) -> FloatArray:
    """Full size one way or the other, held for random times."""
    return held_levels(t, float(_frequencies(slow, fast, 1, rng)[0]), rng, np.array([-1.0, 1.0]))


def levels(t: FloatArray, slow: float, fast: float, rng: np.random.Generator) -> FloatArray:
    """Random levels, nothing among them, held for random times."""
    return held_levels(t, float(_frequencies(slow, fast, 1, rng)[0]), rng, np.linspace(-1.0, 1.0, 9))


def held_levels(t: FloatArray, rate: float, rng: np.random.Generator, among: FloatArray) -> FloatArray:
    """Levels that change about `rate` times a second."""
    dt = float(t[1] - t[0])
    changes = rng.random(len(t)) < min(2.0 * rate * dt, 1.0)
    changes[0] = True
    return np.asarray(among[rng.integers(0, len(among), int(changes.sum()))][np.cumsum(changes) - 1])


def ramps(t: FloatArray, slow: float, fast: float, rng: np.random.Generator) -> FloatArray:
    """A triangle wave: slowly up and down through nothing."""
    frequency = float(_frequencies(slow, max(fast / 8.0, slow), 1, rng)[0])
    return np.asarray(rng.choice((-1.0, 1.0)) * 2.0 / np.pi * np.arcsin(np.sin(2 * np.pi * frequency * t)))


def dwell(t: FloatArray, slow: float, fast: float, rng: np.random.Generator) -> FloatArray:
    """One level, then its opposite."""
    sign, share = rng.choice((-1.0, 1.0)), rng.uniform(0.3, 0.7)
    return np.asarray(np.where(t < share * t[-1], sign, -sign))


def fourier(t: FloatArray, slow: float, fast: float, rng: np.random.Generator) -> FloatArray:
    """A finite Fourier series that begins and ends with no size, slope or curvature."""
    base = 2 * np.pi / max(float(t[-1]), 1e-9)
    highest = max(int(fast * 2 * np.pi / base), HARMONICS)
    k = np.sort(rng.choice(np.arange(1, highest + 1), HARMONICS, replace=False))
    parts = np.hstack([np.sin(base * t[:, None] * k), np.cos(base * t[:, None] * k)])
    zero, one = np.zeros(HARMONICS), np.ones(HARMONICS)
    # At both ends: size, slope and curvature of the sum.
    ends = np.array([[*zero, *one], [*k, *zero], [*zero, *(k**2)]], dtype=np.float64)
    drawn = rng.standard_normal(2 * HARMONICS)
    free = drawn - np.linalg.pinv(ends) @ (ends @ drawn)
    return _unit(parts @ free)


SHAPES: Mapping[str, Shape] = {
    "multisine": multisine,
    "chirp": chirp,
    "binary sequence": binary,
    "steps": levels,
    "ramps": ramps,
    "dwell": dwell,
    "Fourier series": fourier,
}


FIXED = ("chirp", "PRBS", "random walk")
HIGHEST, HELD = 5.0, 0.2  # Hz that a usual chirp ends at; s of a level of a usual binary sequence


def usual(kind: str, t: FloatArray, slow: float, rng: np.random.Generator) -> FloatArray:
    """What is usually played."""
    dt = float(t[1] - t[0])
    if kind == "chirp":
        return swept(t, slow, min(HIGHEST, 0.4 / dt))
    if kind == "PRBS":
        held = max(round(HELD / dt), 1)
        return np.asarray(np.repeat(rng.choice((-1.0, 1.0), len(t) // held + 1), held)[: len(t)])
    return _unit(np.cumsum(rng.standard_normal(len(t))))


def there_and_back(shape: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Now and then a piece is a short course, its opposite, and both the other way round.

    A body that nothing holds is where it was, and at rest, after that.
    """
    if rng.random() < 0.5:
        return shape
    quarter = shape[: max(len(shape) // 4, 1)]
    out = np.zeros_like(shape)
    both = np.concatenate([quarter, -quarter, -quarter, quarter])[: len(shape)]
    out[: len(both)] = both
    return out


def _frequencies(slow: float, fast: float, count: int, rng: np.random.Generator) -> FloatArray:
    """(count,) Hz, evenly in the logarithm."""
    return np.asarray(np.exp(rng.uniform(np.log(slow), np.log(max(fast, slow)), count)))


def _unit(course: FloatArray) -> FloatArray:
    return np.asarray(course / max(float(np.abs(course).max()), 1e-12))


def _tapered(t: FloatArray) -> FloatArray:
    """(L,) how large a wave is: it grows and fades."""
    share = t / max(float(t[-1]), 1e-9)
    return np.asarray(np.clip(np.minimum(share, 1.0 - share) / TAPER, 0.0, 1.0))
