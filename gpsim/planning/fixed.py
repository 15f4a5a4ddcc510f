"""What is usually played, each as large as is safe: what a plan is compared with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.planning.information import separations, unvisited
from gpsim.planning.search import Candidate, Search
from gpsim.planning.signals import usual

LEVELS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.1, 0.05)  # at which one is tried, until it is safe


def fixed_rates(search: Search, kind: str, steps: int) -> FloatArray:
    """(pairs,) nats a minute of a fixed excitation in pieces, about so many steps in all, each as large as is safe."""
    rng = np.random.default_rng(0)
    at, blank = search.begin(unvisited(np.zeros((1, 1)))), len(search.t) + search.settled
    count = max(round(steps / blank), 1)
    for _ in range(count):
        drive = np.zeros((blank, len(search.limits.low)))
        for a in range(drive.shape[1]):
            drive[: len(search.t), a] = usual(kind, search.t, search.settings.slowest, rng)
        tried = search.tried(at, [Candidate(kind, level * drive) for level in (*LEVELS, 0.0)])
        safe = np.flatnonzero(tried.safe)
        best = int(safe[0]) if safe.size else len(LEVELS)
        sums = at.sums.plus(tried.sums.only(best))
        starts = at.starts if search.anew else tuple(t[:, best, -1] for t in tried.true)
        at = replace(at, starts=starts, sums=sums)
    minutes = count * blank * search.models[0].machine.dt / 60.0
    return np.asarray(separations(search.models, at.sums)[0] / minutes)
