"""Whether an account still holds: cumulative sums of what differs beyond what is tolerated (CUSUM; Page 1954).

Of each parameter a sum of its deviations upwards and one downwards; of each channel one of how much more the refitted
account leaves in it than it did: what no parameter of the account explains, as a sensor that got loose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.watching.account import Account, Stretch


@dataclass(frozen=True)
class WatchSettings:
    """See conf/watch/default.yaml."""

    stretch: float = 60.0
    tolerated: float = 0.05
    allowance: float = 0.5
    threshold: float = 8.0
    louder: float = 2.0

    def __post_init__(self) -> None:
        for name in ("stretch", "threshold", "louder"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be more than 0, got {getattr(self, name):g}")
        for name in ("tolerated", "allowance"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} must be at least 0, got {getattr(self, name):g}")


@dataclass(frozen=True)
class Alarm:
    """What no longer holds. what: an effect's parameter, or what is left in a channel; was, now: its sizes.

    since: the recording, and s on its clock, from which its sum has grown.
    """

    what: str
    was: float
    now: float
    since: tuple[str, float]


@dataclass
class Sum:
    """A cumulative sum, and where it began to grow."""

    value: float = 0.0
    since: tuple[str, float] | None = None

    def add(self, score: float, place: tuple[str, float]) -> None:
        """Add what exceeds the allowance; it never falls below 0."""
        self.value = max(self.value + score, 0.0)
        self.since = None if self.value == 0.0 else self.since or place


@dataclass
class Monitor:
    """The sums over all stretches so far; `state` and `resume` carry them over from one call to the next."""

    account: Account
    settings: WatchSettings
    sums: dict[str, Sum] = field(default_factory=dict)

    def see(self, recording: str, stretch: Stretch) -> list[Alarm]:
        """Take a stretch into account; what no longer holds."""
        place, alarms = (recording, stretch.begin), []
        hypothesis, settings = self.account.hypothesis, self.settings
        known = self.account.deviations
        for j, (effect, name) in enumerate(self.account.names):
            was, now = float(hypothesis.theta[j]), float(stretch.theta[j])
            size = max(abs(was), SHARE_OF_SCALE * hypothesis.parameters[j].scale)
            band = settings.tolerated * size + SURE * known[j]
            for sign, way in ((1.0, "up"), (-1.0, "down")):
                score = (sign * (now - was) - band) / max(float(stretch.deviation[j]), TINY)
                key = f"{effect}: {name} {way}"
                if self._over(key, score, place):
                    alarms.append(Alarm(f"{effect}: {name}", was, now, self._since(key)))
        for name, left in stretch.left.items():
            was = self.account.posterior.left[name]
            score = (2.0 * np.log(max(left, TINY) / max(was, TINY)) - np.log(settings.louder)) / SCATTER
            key = f"what is left in {name}"
            if self._over(key, float(score), place):
                alarms.append(Alarm(key, was, left, self._since(key)))
        return alarms

    def _over(self, key: str, score: float, place: tuple[str, float]) -> bool:
        settings, one = self.settings, self.sums.setdefault(key, Sum())
        counted = min(score - settings.allowance, MOST * settings.threshold)
        one.add(counted if np.isfinite(counted) else 0.0, place)
        return one.value > settings.threshold

    def _since(self, key: str) -> tuple[str, float]:
        since = self.sums[key].since
        assert since is not None
        return since

    @property
    def state(self) -> dict[str, Any]:
        """The sums as plain data."""
        return {key: [one.value, *(one.since or ())] for key, one in self.sums.items() if one.value > 0.0}

    def resume(self, state: Mapping[str, Any]) -> None:
        """Go on where `state` was; raises UsageError."""
        try:
            self.sums = {
                str(key): Sum(float(value), (str(since[0]), float(since[1])) if since else None)
                for key, (value, *since) in state.items()
            }
        except (TypeError, ValueError, AttributeError, IndexError) as error:
            raise UsageError(f"not the sums of a monitor: {state!r}"[:200]) from error


MOST = 0.4  # of the threshold, that one stretch adds at the most: no single one is an alarm
SURE = 2.0  # standard deviations of the account's own estimate, within which nothing counts
SHARE_OF_SCALE = 0.1  # of a parameter's typical size: what is less is judged as if it were as large
SCATTER = 0.15  # of the logarithm of a mean square over a stretch
TINY = 1e-300
