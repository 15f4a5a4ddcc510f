"""How regularly a topic came: median period, rate, jitter, gaps, duplicates and steps backwards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings.raw import Series

Stamps = Literal["header", "receive"]


@dataclass(frozen=True)
class Statistics:
    """Of one topic's stamps. period: median [s]; rate: 1 / period [Hz]; jitter: half the 5-95 % range of periods [s].

    gaps: (start, length) [s] of steps longer than `gap_factor` periods, longest first; duplicates: steps of zero;
    backwards: steps below zero; unknown: stamps that are no finite number. Periods are over increasing steps only.
    """

    stamps: Stamps
    count: int
    start: float | None
    end: float | None
    period: float | None
    rate: float | None
    jitter: float | None
    gaps: tuple[tuple[float, float], ...]
    duplicates: int
    backwards: int
    unknown: int


def statistics(series: Series, stamps: Stamps | None = None, gap_factor: float = 3.0) -> Statistics:
    """Look at a topic's stamps in file order; by default its header stamps, else its receive times."""
    chosen: Stamps = stamps or ("header" if series.header is not None else "receive")
    times = series.receive if chosen == "receive" or series.header is None else series.header
    return of_stamps(times, chosen, gap_factor)


def of_stamps(times: FloatArray, stamps: Stamps, gap_factor: float = 3.0) -> Statistics:
    """The same of bare stamps (N,) s."""
    known = times[np.isfinite(times)]
    steps = np.diff(known)
    forward = steps[steps > 0]
    period = float(np.median(forward)) if len(forward) else None
    gaps: list[tuple[float, float]] = []
    if period is not None:
        for i in np.flatnonzero(steps > gap_factor * period):
            gaps.append((float(known[i]), float(steps[i])))
    return Statistics(
        stamps=stamps,
        count=len(times),
        start=float(known.min()) if len(known) else None,
        end=float(known.max()) if len(known) else None,
        period=period,
        rate=1.0 / period if period else None,
        jitter=float(np.diff(np.quantile(forward, [0.05, 0.95]))[0]) / 2.0 if len(forward) else None,
        gaps=tuple(sorted(gaps, key=lambda gap: -gap[1])),
        duplicates=int((steps == 0).sum()),
        backwards=int((steps < 0).sum()),
        unknown=len(times) - len(known),
    )
