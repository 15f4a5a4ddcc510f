"""Judges: sums of squared errors, by block and channel, of whatever account they are asked about.

Rollouts over held-out time, from measured states or from where a few samples before say that they begin; or windows
whose start states are fitted anew where no rollout shows the mismatch. All accounts are judged on the same blocks, so
that differences are paired.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from gpsim.channels import BoolArray, FloatArray, difference
from gpsim.diagnosis.data import Windows, rms, typical
from gpsim.diagnosis.fitting import Fit, Hypothesis, Noise, Problem, fit, predicted
from gpsim.diagnosis.judging.rollout_windows import RolloutWindows, rollout_windows
from gpsim.diagnosis.judging.shares import Mismatch, draws
from gpsim.diagnosis.report import JudgedOn
from gpsim.diagnosis.setup import Question

LEAD = 12  # before a rollout, from which each account says where that begins [transitions]
LEAD_ROUNDS = 3  # of the fit that says so
NOISY_BEGINNING = 0.05
"""Of the base's squares in any channel, that noise may make of rollouts that begin in measured states."""
WORST_ERROR = 20.0  # of a channel: an error that is larger counts as large as that [standard deviations]
STANDS_OUT = 2.0
"""Times the root mean square that noise alone makes: a channel's mismatch that is less does not count."""


class Judge(Protocol):
    """What an account is judged by. leaders: the account as it was learnt without each part of the data."""

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
    """Rollouts: `windows` (W) of them, cut at `places`; worst: (S,) the largest error that counts."""

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
        """See `Judge`."""
        return _rolled(self.problem, self.windows, self.places, self.worst, accounts)


@dataclass(frozen=True)
class WindowJudge:
    """The windows that were learnt from, each a block; start states are fitted to every account."""

    problem: Problem
    like: Fit
    mismatch: Mismatch
    leaders: tuple[Hypothesis, ...]
    judged_on: JudgedOn = "fit windows"

    def squares(self, accounts: Sequence[Sequence[Hypothesis]]) -> FloatArray:
        """See `Judge`."""
        out = []
        for account in accounts:
            found = fit(self.problem, account[0].frozen(), self.like.starts, 4, self.like.noise)
            out.append((found.residuals**2).sum(axis=1))
        return np.array(out)


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
    problem, settings = question.everything, question.run.settings.rollouts
    windows = places.windows(question.recording)
    scale = np.maximum(windows.measured.reshape(-1, len(noise)).var(axis=0), problem.scale**2)
    worst = WORST_ERROR * np.sqrt(scale)
    leaders = _learnt_without(problem, leader, places, windows)
    floor = _floor(problem, windows, places, leader.hypothesis, noise, rng)
    before = _rolled(problem, windows, places, worst, [(null.hypothesis,)])[0]
    drawn = draws(len(before), settings.draws, rng)
    mismatch = Mismatch(before, floor, scale, problem.observed, STANDS_OUT, drawn)
    return RolloutJudge(problem, windows, places, worst, mismatch, leaders)


def _well_begun(mismatch: Mismatch, most: float) -> bool:
    """Whether noise makes little of the errors of every channel in which the base is off."""
    before, floor = mismatch.before.sum(axis=0), mismatch.floor.sum(axis=0)
    return bool(mismatch.counts.any() and (floor <= most * before)[mismatch.counts].all())


def window_judge(
    question: Question, leader: Fit, null: Fit, noise: FloatArray, rng: np.random.Generator
) -> WindowJudge:
    """On the windows that were learnt from, where no channel of a rollout stands out of the noise."""
    problem = question.everything
    share = problem.counts / np.maximum(problem.counted.sum(axis=(0, 1)), 1.0)
    counts = problem.counted.sum(axis=1) * share
    before = (null.residuals**2).sum(axis=1)
    floor = counts * np.maximum(noise, problem.floor) ** 2
    drawn = draws(len(before), question.run.settings.rollouts.draws, rng)
    mismatch = Mismatch(before, floor, problem.scale**2, problem.observed, 0.0, drawn)
    return WindowJudge(problem, leader, mismatch, (leader.hypothesis,))


def sensor_noise(question: Question, leader: Fit) -> FloatArray:
    """(S,) standard deviation of every recorded channel's noise, 0 of hidden ones.

    What the recording states, else what second differences of the leader's residual show: a smooth error of the model
    does not move them.
    """
    problem = question.everything
    names = problem.simulator.state.names
    stated = np.array([question.recording.noise.get(name, 0.0) for name in names])
    said = predicted(problem, problem.windows, leader.hypothesis) if not len(leader.starts) else None
    residual = leader.residuals if said is None else problem.windows.measured - said
    second, counted = np.diff(residual, n=2, axis=1) / np.sqrt(6.0), problem.counted
    sound = counted[:, 2:] & counted[:, 1:-1] & counted[:, :-2]
    columns = [second[..., i][sound[..., i]] for i in range(len(names))]
    # Of a quantised channel the median may be 0.
    jumps = np.array([typical(column) or rms(column) if column.size else 0.0 for column in columns])
    hidden = np.array([name in question.hidden for name in names])
    return np.asarray(np.where(hidden, 0.0, np.where(stated > 0, stated, jumps)))


def _learnt_without(
    problem: Problem, leader: Fit, places: RolloutWindows, judged: Windows
) -> tuple[Hypothesis, ...]:
    """The leader's laws with the values that the other parts of the recording say, a step from the whole."""
    folds = int(places.fold.max(initial=0)) + 1
    if places.judged_on == "held-out rollouts" or not leader.hypothesis.parameters:
        return (leader.hypothesis,) * folds
    kept = []
    for part in range(folds):
        rows = np.flatnonzero(~_touched(problem.windows, judged.take(places.fold == part)))
        enough = len(rows) >= problem.run.settings.windows.fewest
        kept.append(rows if enough else np.arange(len(problem.windows)))
    return tuple(leader.learnt_from(rows) for rows in kept)


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
    for n, account in enumerate(accounts):
        for part in np.unique(places.fold) if len(account) > 1 else (None,):
            rows = np.flatnonzero(places.fold == part) if part is not None else np.arange(len(windows))
            own, hypothesis = windows.take(rows), account[int(part or 0)]
            said = foretold(problem, own, places.lead, hypothesis)
            errors = difference(own.measured, said, problem.simulator.state) * _counted(own)
            squares = np.clip(np.nan_to_num(errors, nan=np.inf), -worst, worst)[:, places.lead + 1 :] ** 2
            np.add.at(out[n], places.block[rows], squares.sum(axis=1))
    return out


def _counted(windows: Windows) -> BoolArray:
    """(W, L + 1, S) without what pads a window, and without samples that say nothing."""
    valid = windows.valid[..., None]
    return valid if windows.weights is None else valid & (windows.weights > 0)


def foretold(problem: Problem, windows: Windows, lead: int, hypothesis: Hypothesis) -> FloatArray:
    """(W, L + 1, S) what the sensors would say, from where the first `lead` transitions say that each window began.

    Without a lead from the states that were measured there.
    """
    if not lead:
        return predicted(problem, windows, hypothesis)
    part = problem.on(_led(windows, lead))
    ones = np.ones(len(problem.scale))
    noise = Noise(
        np.maximum(problem.floor, LEAST_NOISE * problem.scale), ones, np.asarray(part.counted, dtype=float)
    )
    starts = fit(part, hypothesis.frozen(), part.windows.measured[:, 0], LEAD_ROUNDS, noise).starts
    return predicted(problem, windows, hypothesis, starts=starts)


LEAST_NOISE = 1e-3  # of a channel's size: what starts are fitted by where less noise is known


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
    clean = foretold(problem, windows, places.lead, hypothesis)
    drawn = rng.normal(size=windows.measured.shape) * noise
    noisy = replace(windows, measured=windows.measured + drawn)
    disturbed = foretold(problem, noisy, places.lead, hypothesis)
    errors = difference(disturbed - drawn, clean, problem.simulator.state) * _counted(windows)
    out = np.zeros((places.blocks, errors.shape[-1]))
    np.add.at(out, places.block, (np.nan_to_num(errors)[:, places.lead + 1 :] ** 2).sum(axis=1))
    return out
