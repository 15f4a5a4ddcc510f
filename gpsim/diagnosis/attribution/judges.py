"""Judges: sums of squared errors, by block and channel, of whatever account they are asked about.

Rollouts from measured states over held-out time, or windows whose start states are fitted anew where no rollout shows
the mismatch. Both judge an account on the same blocks as its rivals, so that differences are paired.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from gpsim.channels import BoolArray, FloatArray, difference
from gpsim.diagnosis.attribution.noise import sensor_noise
from gpsim.diagnosis.attribution.rollout_windows import RolloutWindows, rollout_windows
from gpsim.diagnosis.attribution.shares import Mismatch, draws
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit, predicted, quadratic, state_jacobian
from gpsim.diagnosis.report import JudgedOn
from gpsim.diagnosis.settings import schedules
from gpsim.diagnosis.setup import Question
from gpsim.effects import closed

LEAD = 12  # before a rollout, from which each account says where that begins [transitions]
NOISY_BEGINNING = 0.05
"""Of the base's squares in any channel, that noise may make of rollouts that begin in measured states."""
WORST_ERROR = 20.0  # of a channel: an error that is larger counts as large as that [standard deviations]
STANDS_OUT = 2.0
"""Times the root mean square that noise alone makes: a channel's mismatch that is less does not count."""

LEAD_STEPS = 3  # of a fit of start states alone, by slopes that are known and learn from its steps


class Judge(Protocol):
    """What an account is judged by.

    leaders: the account as it was learnt without each part of the data, one where no part is left out.
    """

    @property
    def mismatch(self) -> Mismatch:
        """What there is to explain."""
        ...

    @property
    def leaders(self) -> tuple[Hypothesis, ...]:
        """The account, part by part."""
        ...

    @property
    def judged_on(self) -> JudgedOn:
        """Which data judge."""
        ...

    def squares(self, accounts: Sequence[Sequence[Hypothesis]]) -> FloatArray:
        """(N, B, S) of N accounts, each one hypothesis for all parts or one a part."""
        ...


@dataclass(frozen=True)
class RolloutJudge:
    """Rollouts: `windows` (W) of them, cut at `places`.

    worst: (S,) the largest error that counts: far off is far off, wherever an unstable simulation ends.
    """

    problem: Problem
    windows: Windows
    places: RolloutWindows
    worst: FloatArray
    mismatch: Mismatch
    leaders: tuple[Hypothesis, ...]

    @property
    def judged_on(self) -> JudgedOn:
        """Held-out time, or all of it in turn."""
        return self.places.judged_on

    def squares(self, accounts: Sequence[Sequence[Hypothesis]]) -> FloatArray:
        """See `Judge`; those of several accounts side by side."""
        shared = (self.problem, self.windows, self.places, self.worst)
        chunks = _chunks(accounts, self.problem.run.workers.count)
        return np.concatenate(self.problem.run.side_by_side(_rolled, [(*shared, chunk) for chunk in chunks]))


@dataclass(frozen=True)
class WindowJudge:
    """The windows that were learnt from, each a block; start states are fitted to every account."""

    problem: Problem
    starts: FloatArray
    mismatch: Mismatch
    leaders: tuple[Hypothesis, ...]
    judged_on: JudgedOn = "fit windows"

    def squares(self, accounts: Sequence[Sequence[Hypothesis]]) -> FloatArray:
        """See `Judge`."""
        calls = [(self.problem, account[0], self.starts) for account in accounts]
        return np.array(self.problem.run.side_by_side(_fitted, calls))


def rollout_judge(
    question: Question, leader: Fit, null: Fit, rng: np.random.Generator
) -> tuple[RolloutJudge, FloatArray]:
    """On held-out time, or all of it in turn, and the sensors' noise (S,). null: the base, integrated as the leader.

    Rollouts begin in measured states, unless some were not measured, or their noise makes too much of the errors.
    """
    noise = sensor_noise(question, leader)
    if question.everything.observed.all():
        found = judge_at(question, leader, null, noise, rng, rollout_windows(question))
        if _well_begun(found.mismatch, NOISY_BEGINNING):
            return found, noise
    return judge_at(question, leader, null, noise, rng, rollout_windows(question, LEAD)), noise


def judge_at(
    question: Question,
    leader: Fit,
    null: Fit,
    noise: FloatArray,
    rng: np.random.Generator,
    places: RolloutWindows,
) -> RolloutJudge:
    """Rollouts that begin at given places. noise: (S,) of the sensors; null: as `rollout_judge` has it."""
    problem, settings = question.everything, question.run.settings.attribution
    windows = places.windows(question.recording)
    scale = np.maximum(windows.measured.reshape(-1, len(noise)).var(axis=0), problem.scale**2)
    worst = WORST_ERROR * np.sqrt(scale)
    leaders = _learnt_without(problem, leader, places, windows)
    floor = _floor(problem, windows, places, leader.hypothesis, noise, rng)
    before = _rolled(problem, windows, places, worst, [(null.hypothesis,)])[0]
    drawn = draws(len(before), settings.draws, rng)
    mismatch = Mismatch(before, floor, scale, problem.observed, STANDS_OUT, drawn, settings)
    return RolloutJudge(problem, windows, places, worst, mismatch, leaders)


def _well_begun(mismatch: Mismatch, most: float) -> bool:
    """Whether noise makes little of the errors of every channel in which the base is off."""
    before, floor = mismatch.before.sum(axis=0), mismatch.floor.sum(axis=0)
    return bool(mismatch.counts.any() and (floor <= most * before)[mismatch.counts].all())


def window_judge(
    question: Question, leader: Fit, null: Fit, noise: FloatArray, rng: np.random.Generator
) -> WindowJudge:
    """On the windows that were learnt from, where no channel of a rollout stands out of the noise."""
    problem, settings = question.everything, question.everything.run.settings.attribution
    share = problem.counts / np.maximum(problem.counted.sum(axis=(0, 1)), 1.0)
    counts = problem.counted.sum(axis=1) * share
    before = (null.residuals**2).sum(axis=1)
    floor = counts * np.maximum(noise, problem.floor) ** 2
    drawn = draws(len(before), settings.draws, rng)
    mismatch = Mismatch(before, floor, problem.scale**2, problem.observed, 0.0, drawn, settings)
    return WindowJudge(problem, leader.starts, mismatch, (leader.hypothesis,))


def _learnt_without(
    problem: Problem, leader: Fit, places: RolloutWindows, judged: Windows
) -> tuple[Hypothesis, ...]:
    """The leader's laws with the values that the other parts of the recording say, part by part.

    As they are where none of them was learnt: a robot's true model has what is known of it.
    """
    folds = int(places.fold.max(initial=0)) + 1
    if places.judged_on == "held-out rollouts" or not leader.hypothesis.parameters:
        return (leader.hypothesis,) * folds
    kept = []
    for part in range(folds):
        rows = np.flatnonzero(~_touched(problem.windows, judged.take(places.fold == part)))
        enough = len(rows) >= problem.run.settings.prepare.fewest
        kept.append(rows if enough else np.arange(len(problem.windows)))
    if closed(problem.simulator) is not None:  # every fit is dear, and few windows move it little
        around = quadratic(problem, leader)
        return tuple(around.learnt_from(rows) for rows in kept)
    calls = [(problem.on(problem.windows.take(r)), leader.hypothesis, leader.starts[r]) for r in kept]
    return tuple(problem.run.side_by_side(_again, calls))


def _again(problem: Problem, hypothesis: Hypothesis, starts: FloatArray) -> Hypothesis:
    return fit(problem, hypothesis, starts, iterations=schedules.REFIT, near=True).hypothesis


def _touched(windows: Windows, judged: Windows) -> BoolArray:
    """(W,) which windows share time with any that is judged."""
    out = np.zeros(len(windows), dtype=np.bool_)
    first, last = windows.t[:, 0], windows.t[:, -1]
    for episode in np.unique(judged.episode):
        rows = judged.episode == episode
        begun, ended = judged.t[rows, 0].min(), judged.t[rows, -1].max()
        out |= (windows.episode == episode) & (first <= ended) & (last >= begun)
    return out


def _rolled(
    problem: Problem,
    windows: Windows,
    places: RolloutWindows,
    worst: FloatArray,
    accounts: Sequence[Sequence[Hypothesis]],
) -> FloatArray:
    """(N, B, S) sums of squares of rollouts, each part's by the hypothesis that did not learn from it."""
    out = np.zeros((len(accounts), places.blocks, len(worst)))
    slopes: dict[int | None, FloatArray | None] = {}
    for n, account in enumerate(accounts):
        for part in np.unique(places.fold) if len(account) > 1 else (None,):
            rows = np.flatnonzero(places.fold == part) if part is not None else np.arange(len(windows))
            own, hypothesis = windows.take(rows), account[int(part or 0)]
            if part not in slopes:
                slopes[part] = _slopes(problem, own, places.lead, hypothesis)
            said = foretold(problem, own, places.lead, hypothesis, slopes[part])
            errors = difference(own.measured, said, problem.simulator.state) * _counted(own)
            squares = np.clip(errors, -worst, worst)[:, places.lead + 1 :] ** 2
            np.add.at(out[n], places.block[rows], squares.sum(axis=1))
    return out


def _counted(windows: Windows) -> BoolArray:
    """(W, L + 1, S) without what pads a window, and without samples that say nothing."""
    valid = windows.valid[..., None]
    return valid if windows.weights is None else valid & (windows.weights > 0)


def foretold(
    problem: Problem, windows: Windows, lead: int, hypothesis: Hypothesis, known: FloatArray | None = None
) -> FloatArray:
    """(W, L + 1, S) what the sensors would say, from where the first `lead` transitions say that each window began.

    Without a lead from the states that were measured there. known: see `fit`.
    """
    if not lead:
        return predicted(problem, windows, hypothesis)
    part = _led(windows, lead)
    begun = problem.on(part), hypothesis.frozen(), part.measured[:, 0]
    count = schedules.GLANCE if known is None else LEAD_STEPS
    starts = fit(*begun, iterations=count, tolerance=schedules.ROUGH, known=known).starts
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    theta = hypothesis.theta[None]
    said = problem.simulated(chain, windows, starts[None], hypothesis.spread, theta)
    return np.asarray(said[0])


def _slopes(problem: Problem, windows: Windows, lead: int, like: Hypothesis) -> FloatArray | None:
    """The slopes by start states that serve every account where steps are dear: the base simulator's."""
    if not lead or closed(problem.simulator) is None:
        return None
    led, base = problem.on(_led(windows, lead)), Hypothesis(scheme=like.scheme)
    starts = led.windows.measured[:, 0]
    residual = led.residuals(base, base.theta[None], starts[None])[0]
    return state_jacobian(led, base, starts, residual)


def _led(windows: Windows, lead: int) -> Windows:
    """The first transitions of every window."""
    return replace(
        windows,
        measured=windows.measured[:, : lead + 1],
        actions=windows.actions[:, :lead],
        t=windows.t[:, : lead + 1],
        valid=windows.valid[:, : lead + 1],
        weights=None if windows.weights is None else windows.weights[:, : lead + 1],
    )


def _floor(
    problem: Problem,
    windows: Windows,
    places: RolloutWindows,
    hypothesis: Hypothesis,
    noise: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """(B, S) sums of squares that noise makes of a perfect simulation: where it begins, what it is read by."""
    known = _slopes(problem, windows, places.lead, hypothesis)
    clean = foretold(problem, windows, places.lead, hypothesis, known)
    drawn = rng.normal(size=windows.measured.shape) * noise
    noisy = replace(windows, measured=windows.measured + drawn)
    disturbed = foretold(problem, noisy, places.lead, hypothesis, known)
    errors = difference(disturbed - drawn, clean, problem.simulator.state) * _counted(windows)
    out = np.zeros((places.blocks, errors.shape[-1]))
    np.add.at(out, places.block, (errors[:, places.lead + 1 :] ** 2).sum(axis=1))
    return out


def _fitted(problem: Problem, hypothesis: Hypothesis, starts: FloatArray) -> FloatArray:
    """(W, S) sums of squares where the start states alone are fitted."""
    found = fit(problem, hypothesis.frozen(), starts, iterations=schedules.SETTLE)
    return np.asarray((found.residuals**2).sum(axis=1))


def _chunks(accounts: Sequence[Sequence[Hypothesis]], count: int) -> list[Sequence[Sequence[Hypothesis]]]:
    size = max(1, -(-len(accounts) // max(count, 1)))
    return [accounts[i : i + size] for i in range(0, len(accounts), size)]
