"""Whether an account still holds: cumulative sums of what differs beyond what is tolerated (CUSUM; Page 1954).

A stretch of a later recording says of an old account its parameters anew, and what they leave. Of each parameter there
is a sum of its deviations upwards and one downwards; of each channel one of how much more the refitted account leaves
in it than it did: what no parameter of the account explains, as a sensor that got loose.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.assessment import covariance, posed
from gpsim.diagnosis.fitting import Hypothesis, Problem, fit, mean_squares
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Settings
from gpsim.errors import UsageError
from gpsim.posterior import LeftOpen
from gpsim.recordings import Recording

STEPS = 8  # of a refit from the account's values, which are near
FEWEST = 4  # windows of a stretch of which something can be said
MOST = 0.4  # of the threshold, that one stretch adds at the most: no single one is an alarm
SURE = 2.0  # standard deviations of the account's own estimate, within which nothing counts
SHARE_OF_SCALE = 0.1  # of a parameter's typical size: what is less is judged as if it were as large
SCATTER = 0.15  # of the logarithm of a mean square over a stretch
TINY = 1e-300  # guards a division by squares that are 0


@dataclass(frozen=True)
class Account:
    """An old account: the corrected simulator, and what its diagnosis left open."""

    plant: EffectsPlant
    posterior: LeftOpen

    @property
    def hypothesis(self) -> Hypothesis:
        """The leading explanation."""
        return self.posterior.explanations[0].hypothesis

    @cached_property
    def names(self) -> tuple[tuple[str, str], ...]:
        """Of every parameter its effect and its name, in the order of theta."""
        return tuple(
            (f"{term.family} on {term.on}", p.name)
            for term, group in zip(self.hypothesis.terms, self.hypothesis.declared, strict=True)
            for p in group
        )

    @property
    def deviations(self) -> FloatArray:
        """(P,) how well the account knows each parameter."""
        return np.asarray(np.sqrt(np.diag(self.posterior.explanations[0].covariance)))


@dataclass(frozen=True)
class Stretch:
    """A stretch of driving: begin, end [s] on the recording's clock in an episode; theta, deviation (P,) as refitted.

    share: of the base's mismatch that the account takes off, None where there is none; left: channel -> root mean
    square that the refitted account leaves.
    """

    episode: str
    begin: float
    end: float
    seconds: float
    theta: FloatArray
    deviation: FloatArray
    share: float | None
    left: Mapping[str, float]


def looked_at(
    account: Account, recording: Recording, seconds: float, after: float = 0.0
) -> Iterator[Stretch]:
    """Stretches of so many seconds of driving, those that begin after `after` s of it; raises UsageError.

    A last one that is shorter than half of that counts where it is the only one.
    """
    settings = Settings()
    # Every window of a long recording is looked at.
    most = max(recording.transition_count // settings.windows.length + 1, settings.windows.fitted)
    run = Run(replace(settings, windows=replace(settings.windows, fitted=most)))
    judged = posed(recording, account.plant, None, run)
    problem, origin = judged.question.everything, judged.question.origin
    windows = problem.windows
    for rows, begin in _stretches(problem, seconds):
        if begin + 1e-9 >= after:
            episode = recording.episodes[int(windows.episode[rows[0]])].name
            ends = (float(windows.t[rows[0], 0] + origin), float(windows.t[rows[-1], -1] + origin))
            driven = float(windows.valid[rows].sum() * problem.dt)
            theta, deviation, share, left = _judged(account, problem.on(windows.take(rows)))
            yield Stretch(episode, *ends, driven, theta, deviation, share, left)


def _stretches(problem: Problem, seconds: float) -> Iterator[tuple[IntArray, float]]:
    """Rows of windows that together are so long, and how much was driven before them [s]."""
    windows = problem.windows
    order = np.lexsort((windows.t[:, 0], windows.episode))
    lengths = windows.valid[order].sum(axis=1) * problem.dt  # with the step to the next window
    number = ((np.cumsum(lengths) - lengths) / seconds + 1e-9).astype(np.int64)
    for k in range(int(number[-1]) + 1 if len(number) else 0):
        mine = np.flatnonzero(number == k)
        whole = lengths[mine].sum() >= 0.5 * seconds or k == 0
        if len(mine) >= FEWEST and whole:
            yield order[mine], float(k * seconds)


def _judged(account: Account, part: Problem) -> tuple[FloatArray, FloatArray, float | None, dict[str, float]]:
    hypothesis = account.hypothesis
    old = fit(part, hypothesis.frozen(), rounds=STEPS)
    base = fit(part, Hypothesis(scheme=hypothesis.scheme), rounds=STEPS, noise=old.noise)
    new = fit(part, hypothesis, old.starts, STEPS, old.noise)
    deviation = np.sqrt(np.diag(covariance(part, new)))
    before, after = (mean_squares(part, f.residuals) for f in (base, old))
    names = part.simulator.state.names
    floor = np.array([account.posterior.left.get(n, np.inf) for n in names]) ** 2
    excess = np.maximum(before - floor, 0.0) / np.maximum(part.scale**2, TINY)
    share = None
    if excess.sum() > 0.0:
        taken = 1.0 - (after - floor) / np.maximum(before - floor, TINY)
        share = float((np.clip(np.nan_to_num(taken), 0.0, 1.0) * excess).sum() / excess.sum())
    left = np.sqrt(mean_squares(part, new.residuals))
    kept = {n: float(v) for n, v in zip(names, left, strict=True) if n in account.posterior.left}
    return new.hypothesis.theta, np.asarray(deviation), share, kept


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
