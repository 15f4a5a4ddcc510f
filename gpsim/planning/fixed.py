"""What is usually played, each as large as is safe: what a plan is compared with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.planning.information import separations, unvisited
from gpsim.planning.search import Candidate, Search
from gpsim.planning.signals import held_levels, swept

FIXED = ("chirp", "PRBS", "random walk")
LEVELS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.1, 0.05)  # at which one is tried, until it is safe
PRBS_RATE = 0.1  # changes of a binary sequence a control step


def fixed_nats(search: Search, kind: str, count: int) -> FloatArray:
    """(pairs,) nats of a fixed excitation, each of `count` pieces as large as is safe."""
    rng = np.random.default_rng(0)
    at, blank = search.begin(unvisited(np.zeros((1, 1)))), len(search.t) + search.settled
    for _ in range(count):
        drive = np.zeros((blank, len(search.limits.low)))
        for a in range(drive.shape[1]):
            drive[: len(search.t), a] = fixed_shape(search, kind, rng)
        tried = search.tried(at, [Candidate(kind, level * drive) for level in (*LEVELS, 0.0)])
        safe = np.flatnonzero(tried.safe)
        best = int(safe[0]) if safe.size else len(LEVELS)
        sums = at.sums.plus(tried.sums.only(best))
        starts = at.starts if search.anew else tuple(t[:, best, -1] for t in tried.true)
        at = replace(at, starts=starts, sums=sums)
    return np.asarray(separations(search.models, at.sums)[0])


def fixed_shape(search: Search, kind: str, rng: np.random.Generator) -> FloatArray:
    """(L,) in [-1, 1]: what is usually played."""
    t, dt = search.t, search.models[0].machine.dt
    if kind == "chirp":
        slow, fast = search.settings.slowest, search.settings.fastest / dt
        return swept(t, slow, min(fast, 5.0))
    if kind == "PRBS":
        return held_levels(t, PRBS_RATE / dt / 2.0, rng, np.array([-1.0, 1.0]))
    walk = np.cumsum(rng.standard_normal(len(t)))
    return np.asarray(walk / max(float(np.abs(walk).max()), 1e-12))
