"""How late the state answers its commands, gathered over episodes at the pace of the source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gpsim.channels import FloatArray
from gpsim.recordings import clock
from gpsim.recordings.clock import Lag, estimate_lag
from gpsim.recordings.episodes import Interval
from gpsim.recordings.mapping import ImportMapping
from gpsim.recordings.tracks import Track, samples

STEP = 0.01  # finest grid of the correlation [s]
MOST = 20_000_000  # samples of a piece; one that is far longer than its pace lets expect tells nothing


class Pieces:
    """Command and response signals of all episodes on one even grid; a response is the rate of a channel."""

    def __init__(self) -> None:
        self.step: float | None = None
        self.pairs: dict[tuple[str, str], list[tuple[FloatArray, FloatArray]]] = {}

    def add(self, tracks: Mapping[str, Track], mapping: ImportMapping, intervals: Sequence[Interval]) -> None:
        """Take what the episodes in `intervals` show."""
        measured = mapping.measured
        pace = [float(np.median(np.diff(tracks[s.track].t))) for s in measured if len(tracks[s.track].t) > 1]
        if self.step is None:
            self.step = max([STEP, *pace])
        for a, b in intervals:
            if (b - a) / self.step > MOST:
                continue
            at = np.arange(a, b, self.step)
            if len(at) < 20:
                continue
            signals = {
                s.name: clock.linear(at, tracks[s.track].t, samples(s, tracks[s.track])) for s in measured
            }
            responses = _responses(signals, self.step)
            for source in mapping.action:
                track = tracks[source.track]
                command = clock.held(at, track.t, samples(source, track))
                for name, response in responses.items():
                    self.pairs.setdefault((source.name, name), []).append((command, response))

    def estimates(self) -> list[Lag]:
        """For every command that moves, the response that follows it best."""
        found: dict[str, Lag] = {}
        for names, pieces in self.pairs.items():
            assert self.step is not None
            longest = max(len(command) for command, _ in pieces) * self.step
            lag = estimate_lag(names, pieces, self.step, within=min(max(1.0, 5 * self.step), 0.25 * longest))
            known = found.get(lag.command)
            if known is None or abs(lag.correlation) > abs(known.correlation):
                found[lag.command] = lag
        return [lag for lag in found.values() if lag.correlation != 0.0]


def _responses(signals: Mapping[str, FloatArray], step: float) -> dict[str, FloatArray]:
    """Rate of every channel, and a pose's speed along its heading; the filter is even, so it adds no lag."""
    rates = {
        name: np.gradient(gaussian_filter1d(v, 2.0, mode="nearest"), step) for name, v in signals.items()
    }
    out = {f"rate of {name}": rate for name, rate in rates.items()}
    if {"x", "y", "yaw"} <= set(signals):
        yaw = signals["yaw"]
        out["forward speed"] = rates["x"] * np.cos(yaw) + rates["y"] * np.sin(yaw)
    return out
