"""What a stretch of a later recording says of an old account: its parameters anew, and what it leaves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.assessment import covariance, posed
from gpsim.diagnosis.fitting import Hypothesis, Problem, fit, mean_squares
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Settings
from gpsim.posterior import LeftOpen
from gpsim.recordings import Recording

STEPS = 8  # of a refit from the account's values, which are near
FEWEST = 4  # windows of a stretch of which something can be said
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
    judged = posed(recording, account.plant, None, _run_for(recording))
    problem, origin = judged.question.everything, judged.question.origin
    for rows, begin in _stretches(problem, seconds):
        if begin + 1e-9 < after:
            continue
        part = problem.on(problem.windows.take(rows))
        first, last = rows[0], rows[-1]
        theta, deviation, share, left = _judged(account, part)
        yield Stretch(
            recording.episodes[int(problem.windows.episode[first])].name,
            float(problem.windows.t[first, 0] + origin),
            float(problem.windows.t[last, -1] + origin),
            _seconds(problem, rows),
            theta,
            deviation,
            share,
            left,
        )


def _run_for(recording: Recording) -> Run:
    """Settings under which every window of a long recording is looked at."""
    settings = Settings()
    windows = recording.transition_count // settings.windows.length + 1
    wanted = max(windows, settings.windows.fitted)
    return Run(replace(settings, windows=replace(settings.windows, fitted=wanted)))


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


def _seconds(problem: Problem, rows: IntArray) -> float:
    return float(problem.windows.valid[rows].sum() * problem.dt)


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
