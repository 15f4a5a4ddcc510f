"""How often `gpsim watch` raises a false alarm, and after how many minutes it finds a drift of 15 % or a loose sensor.

    python benchmarks/watch.py [HOURS] [CHANGES]

A slider on a spring with viscous friction, driven by random waves and levels, is diagnosed from two minutes. Then it is
watched for so many hours in recordings of ten minutes without a change, and in so many recordings with each change:
friction that grows by 15 % at once after two minutes, friction that grows by 15 % over five minutes, a sensor whose
noise doubles after two minutes. An alarm ends a recording; the sums begin anew with the next alarm-free hour.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

import gpsim
from gpsim.planning import Account, Monitor, WatchSettings, looked_at
from gpsim.recordings import Recording
from gpsim.stages.diagnose import read_corrected, read_left_open

DT, SUBSTEPS, SPRING, DAMPING, NOISE = 0.02, 5, 1.0, 0.8, (0.002, 0.01)
Course = Callable[[float], float]


def driven(minutes: float, seeds: list[int], damping: Course, louder: Course) -> list[pd.DataFrame]:
    """A log a seed, all driven side by side."""
    steps, count = round(minutes * 60 / DT), len(seeds)
    commands, noise = np.empty((steps + 1, count)), np.empty((steps + 1, count, 2))
    t = DT * np.arange(steps + 1)
    for i, seed in enumerate(seeds):
        rng = np.random.default_rng(seed)
        frequency, phase = rng.uniform(0.05, 1.2, 8), rng.uniform(0, 2 * np.pi, 8)
        waves = 0.3 * np.sin(2 * np.pi * frequency * t[:, None] + phase).sum(axis=1)
        commands[:, i] = waves + np.repeat(rng.uniform(-0.5, 0.5, steps // 50 + 2), 50)[: steps + 1]
        noise[:, i] = rng.standard_normal((steps + 1, 2)) * NOISE
    q, v, h = np.zeros(count), np.zeros(count), DT / SUBSTEPS
    seen = np.empty((steps + 1, count, 2))
    for k in range(steps + 1):
        seen[k, :, 0], seen[k, :, 1] = q, v
        b = damping(t[k])
        for _ in range(SUBSTEPS):
            v = v + h * (commands[k] - b * v - SPRING * q)
            q = q + h * v
    seen += noise * np.array([louder(x) for x in t])[:, None, None]
    names = ("q", "q_dot")
    return [
        pd.DataFrame({"t": t, **{n: seen[:, i, c] for c, n in enumerate(names)}, "force": commands[:, i]})
        for i in range(count)
    ]


def still(t: float) -> float:
    """No change."""
    return 1.0


CHANGES: dict[str, tuple[Course, Course, float]] = {
    "friction + 15 % at once": (lambda t: DAMPING * (1.15 if t > 120 else 1.0), still, 120.0),
    "friction + 15 % over five minutes": (
        lambda t: DAMPING * (1 + 0.15 * min(max(t - 120, 0.0) / 300, 1.0)), still, 120.0,
    ),
    "noise of the sensors doubles": (lambda t: DAMPING, lambda t: 2.0 if t > 120 else 1.0, 120.0),
}  # fmt: skip
"""Damping and noise over time, and when the change begins [s]."""


def recording_of(frame: pd.DataFrame) -> Recording:
    """A log as a recording."""
    return gpsim.recording_from_frame(frame, {"q": "m", "q_dot": "m/s", "force": "N"}, "slider")


def main() -> None:
    hours, changes = (float(sys.argv[1]) if len(sys.argv) > 1 else 10.0), int((sys.argv[2:] or ["10"])[0])
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "account"
        first = driven(2.0, [0], lambda t: DAMPING, still)[0]
        gpsim.diagnose(recording_of(first), "slider").save(found)
        account = Account(read_corrected(found), read_left_open(found))
    settings = WatchSettings()
    monitor, alarms, stretches = Monitor(account, settings), 0, 0
    for number in range(round(hours * 6)):
        frame = driven(10.0, [1000 + number], lambda t: DAMPING, still)[0]
        for stretch in looked_at(account, recording_of(frame), settings.stretch):
            stretches += 1
            if said := monitor.see(str(number), stretch):
                alarms += 1
                print(f"  false alarm after {stretches} minutes: {said}")
                monitor = Monitor(account, settings)
        if number % 6 == 5:
            largest = max((s.value for s in monitor.sums.values()), default=0.0)
            print(f"{stretches} minutes: {alarms} false alarms, largest sum {largest:.1f}", flush=True)
    for name, (damping, louder, begin) in CHANGES.items():
        taken = []
        for frame in driven(15.0, list(range(2000, 2000 + changes)), damping, louder):
            monitor, minutes = Monitor(account, settings), np.inf
            for stretch in looked_at(account, recording_of(frame), settings.stretch):
                if monitor.see("", stretch):
                    minutes = (stretch.end - begin) / 60
                    break
            taken.append(minutes)
        print(
            f"{name}: found after {np.median(taken):.1f} minutes (median), {max(taken):.1f} (most)",
            flush=True,
        )


if __name__ == "__main__":
    main()
