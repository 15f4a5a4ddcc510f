"""Judges: sums of squared errors, by block and channel, of whatever account they are asked about.

Rollouts over held-out time, a horizon long and begun every few samples; or windows whose start states are fitted anew
where no rollout shows the mismatch. All accounts are judged on the same blocks, so that differences are paired.

Rollouts begin in measured states where these are good enough for that, and in no reading at its range's end. Else
before each lie a few samples from which every account says for itself where the rollout begins: a measured velocity may
be mostly noise, a differentiated one is late, and some states nobody measures. Those that begin a horizon apart are two
to twenty in a real log, too few for any interval; those that overlap are not independent, and blocks of a horizon's
length are what a bootstrap draws (Kuensch 1989).

The share of a channel's mismatch that an account takes off is 1 - (after^2 - floor^2) / (before^2 - floor^2), clipped
to [0, 1]; over channels it is the mean, each weighed by its excess before^2 - floor^2 in units of its own variance: a
channel in which the simulator is far off says more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray, difference
from gpsim.diagnosis.data import Windows, at, rms, stretches, typical
from gpsim.diagnosis.fitting import Fit, Hypothesis, Noise, Problem, Shooting, fit, predicted
from gpsim.diagnosis.setup import PreparedProblem, telling
from gpsim.effects import closed
from gpsim.findings import JudgedOn, Share
from gpsim.recordings import Recording, evenly
from gpsim.residuals import first_held_out

JUDGED_ROLLOUTS_OF_A_ROBOT = 40  # rollouts that an account is judged on, evenly spread, at most
ROLLOUT_STRIDE = 3  # between the starts of two rollouts [samples]
FOLDS = 5  # parts of the whole recording, each judged by what the others say
SHORT_PART = 0.25
"""Of the time, that may lie in stretches too short for a rollout, before rollouts are cut shorter."""
BEYOND_IMPACTS = 2  # times a window of what stands, that a rollout of it lasts
LEAD = 12  # before a rollout, from which each account says where that begins [transitions]
LEAD_ROUNDS = 3  # of the fit that says so
LEAST_NOISE = 1e-3  # of a channel's size: what starts are fitted by where less noise is known
NOISY_BEGINNING = 0.05
"""Of the base's squares in any channel, that noise may make of rollouts that begin in measured states."""
WORST_ERROR = 20.0  # of a channel: an error that is larger counts as large as that [standard deviations]
FEWEST_BLOCKS = 8
"""Blocks of a rollout's length: with fewer held out the whole recording is judged on in turn, with fewer in it there
are no intervals."""
LOW = 0.05  # quantile of the draws that is an interval's lower end (usual: 90 %)
HIGH = 0.95  # quantile of the draws that is its upper end (usual: 90 %)

TINY = 1e-300  # guards divisions by sums of squares that are 0
ROUNDING = 1e-18  # of a channel's variance: squares that are less are those of rounding, and no mismatch


@dataclass(frozen=True)
class Mismatch:
    """Sums of squares (B, S) by block and channel: of the base's errors and of what noise alone makes.

    scale: (S,) the variance of each channel; seen: (S,) which are judged; times: the base's root mean square must be
    so many times the noise's, 0 where any excess counts; drawn: (D, B) how often every draw holds every block.
    """

    before: FloatArray
    floor: FloatArray
    scale: FloatArray
    seen: BoolArray
    times: float
    drawn: FloatArray

    @cached_property
    def counts(self) -> BoolArray:
        """(S,) channels in which the mismatch stands out of the noise."""
        before, floor = self.before.sum(axis=0), self.floor.sum(axis=0)
        excess = self.drawn @ (self.before - self.floor)
        sure = np.quantile(excess, LOW, axis=0) > 0
        return np.asarray(self.seen & sure & self._stands_out(before, floor))

    def _stands_out(self, before: FloatArray, floor: FloatArray) -> BoolArray:
        """(..., S): of which sums of squares the base's are more than noise, or rounding, makes."""
        least = np.maximum(self.times**2 * floor, ROUNDING * self.scale)
        return np.asarray(before > np.maximum(least, TINY))

    def by_channel(self, after: FloatArray) -> FloatArray:
        """(..., 1 + D, S) clipped shares of an account's sums of squares (..., B, S); first those of all blocks.

        Where a draw holds no mismatch that stands out, as without the few moments in which an axis met its stop, it
        tells nothing: what is explained there is as of all blocks.
        """
        before, floor, left = (self.sums(sums) for sums in (self.before, self.floor, after))
        shares = np.clip(1.0 - (left - floor) / np.maximum(before - floor, TINY), 0.0, 1.0)
        return np.asarray(np.where(self._stands_out(before, floor), shares, shares[..., :1, :]))

    def overall(self, after: FloatArray) -> FloatArray:
        """(..., 1 + D) the same over all channels that count."""
        before, floor = self.sums(self.before), self.sums(self.floor)
        weights = np.maximum(before - floor, 0.0) / np.maximum(self.scale, TINY) * self.counts
        total = np.maximum(weights.sum(axis=-1), TINY)
        return np.asarray((self.by_channel(after) * weights).sum(axis=-1) / total)

    def share(self, values: FloatArray) -> Share:
        """Of (1 + D,) values, the first of which is that of all blocks."""
        return share_of(values, len(self.before) >= FEWEST_BLOCKS)

    def sums(self, sums: FloatArray) -> FloatArray:
        """(..., 1 + D, S): over all blocks, then over those of each draw."""
        return np.concatenate([sums.sum(axis=-2, keepdims=True), self.drawn @ sums], axis=-2)


def share_of(values: FloatArray, known: bool) -> Share:
    """Of (1 + D,) values, that of all data and those of the draws; known: whether these make an interval."""
    return Share(float(values[0]), *interval_of(values[1:], known))


def interval_of(drawn: FloatArray, known: bool) -> tuple[float, float] | tuple[None, None]:
    """The interval of (D,) values, none where it is not `known` or not finite."""
    low, high = np.quantile(drawn, [LOW, HIGH])
    return (float(low), float(high)) if known and np.isfinite(high) else (None, None)


def draws(blocks: int, count: int, rng: np.random.Generator) -> FloatArray:
    """(D, B) how often each of B blocks is drawn, B times with replacement."""
    return rng.multinomial(blocks, np.full(blocks, 1.0 / blocks), count).astype(float)


@dataclass(frozen=True)
class RolloutWindows:
    """Where rollouts begin, W of them.

    places: episode and first sample; lead: transitions before the rollout begins; length: all transitions; block: (W,)
    from 0, ascending; fold: (W,) which part of the recording must not be learnt from where a rollout judges, all 0
    where what is held out is judged on.
    """

    places: tuple[tuple[int, int], ...]
    lead: int
    length: int
    block: IntArray
    fold: IntArray
    judged_on: JudgedOn

    def __len__(self) -> int:
        return len(self.places)

    @property
    def blocks(self) -> int:
        """How many blocks there are."""
        return int(self.block.max(initial=-1)) + 1

    def windows(self, recording: Recording) -> Windows:
        """Those of a recording, the question's as a hypothesis completes it."""
        return at(recording, self.places, self.length)


def rollout_windows(question: PreparedProblem, lead: int = 0) -> RolloutWindows:
    """Held-out ones; where they make too few blocks those of the whole recording, in folds of neighbouring blocks.

    lead: transitions before each, from which an account says where it begins; 0: in the measured state.
    """
    held, every = first_held_out(question.recording), stretches(question.recording)
    out = [s for s in every if s[1] >= held[s[0]]]
    found = _cut(question, out or every, lead)
    if out and found.blocks >= FEWEST_BLOCKS:
        return found
    found = _cut(question, every, lead)
    fold = found.block * min(FOLDS, max(found.blocks, 1)) // max(found.blocks, 1)
    return replace(found, fold=fold, judged_on="cross-fitted rollouts")


def rollouts_in(question: PreparedProblem, source: int, lead: int = 0) -> RolloutWindows:
    """Those of all of one of several recordings, for an account that was learnt from the others."""
    episodes = question.recording.episodes
    parts = [s for s in stretches(question.recording) if episodes[s[0]].source == source]
    return _cut(question, parts, lead)


def horizon_of(question: PreparedProblem) -> int:
    """Transitions of a rollout, where the stretches are long enough.

    Of what stands hardly longer than between impacts: what begins alike comes down elsewhere, by whatever account.
    """
    settings, problem = question.run.settings, question.everything
    if problem.simulator.heights and problem.simulator.stands(
        problem.windows.measured[problem.windows.valid]
    ):
        return BEYOND_IMPACTS * problem.windows.length
    usual = max(round(settings.rollouts.horizon / question.recording.dt), settings.windows.length)
    return min(usual, settings.rollouts.longest)


def _cut(question: PreparedProblem, parts: Sequence[tuple[int, int, int]], lead: int) -> RolloutWindows:
    """Evenly spread rollouts in stretches (episode, first, last sample): of the horizon, or what most of them allow."""
    spans = sorted(last - first for _, first, last in parts)
    upper = spans[np.searchsorted(np.cumsum(spans), SHORT_PART * sum(spans))] if spans else 0
    length = max(2, min(lead + horizon_of(question), int(upper)))
    lead = min(lead, length // 2)
    starts: list[tuple[int, int]] = []
    block: list[int] = []
    tells = telling(question.recording)
    for episode, first, last in parts:
        own = np.arange(first, last - length + 1, ROLLOUT_STRIDE)
        told = np.array([tells[episode][k : k + lead + 1].all() for k in own], dtype=np.bool_)
        own = own[told] if told.any() else own
        before = block[-1] + 1 if block else 0
        starts += [(episode, int(k)) for k in own]
        block += [before + int(k - first) // (length - lead) for k in own]
    dear = closed(question.everything.simulator) is not None
    rows = evenly(len(starts), JUDGED_ROLLOUTS_OF_A_ROBOT if dear else question.run.settings.rollouts.most)
    _, blocks = np.unique(np.array(block, dtype=np.int64)[rows], return_inverse=True)
    places, fold = tuple(starts[i] for i in rows), np.zeros(len(rows), np.int64)
    return RolloutWindows(places, lead, length, blocks, fold, "held-out rollouts")


class LossEvaluator(Protocol):
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
    begun: dict[int, Shooting] = field(default_factory=dict)

    @property
    def judged_on(self) -> JudgedOn:
        """Held-out time, or all of it in turn."""
        return self.places.judged_on

    def squares(self, accounts: Sequence[Sequence[Hypothesis]]) -> FloatArray:
        """See `LossEvaluator`."""
        return _rolled(self.problem, self.windows, self.places, self.worst, accounts, self.begun)


@dataclass(frozen=True)
class WindowJudge:
    """The windows that were learnt from, each a block; start states are fitted to every account."""

    problem: Problem
    like: Fit
    mismatch: Mismatch
    leaders: tuple[Hypothesis, ...]
    judged_on: JudgedOn = "fit windows"

    def squares(self, accounts: Sequence[Sequence[Hypothesis]]) -> FloatArray:
        """See `LossEvaluator`."""
        out = []
        for account in accounts:
            found = fit(self.problem, account[0].frozen(), self.like.starts, 4, self.like.noise)
            out.append((found.residuals**2).sum(axis=1))
        return np.array(out)


def rollout_judge(
    question: PreparedProblem, leader: Fit, null: Fit, rng: np.random.Generator
) -> tuple[RolloutJudge, FloatArray]:
    """On held-out time, or all of it in turn, and the sensors' noise (S,). null: the base, integrated as the leader.

    Rollouts begin in measured states, unless some were not measured, or their noise makes too much of the errors.
    """
    noise = sensor_noise(question, leader)
    simulator = question.everything.simulator
    if (question.everything.observed | np.isin(simulator.state.names, simulator.settled)).all():
        found = judge_at(question, leader, null, noise, rng, rollout_windows(question))
        mismatch = found.mismatch
        before, floor = mismatch.before.sum(axis=0), mismatch.floor.sum(axis=0)
        quiet = (floor <= NOISY_BEGINNING * before)[mismatch.counts]
        if quiet.size and quiet.all():
            return found, noise
    return judge_at(question, leader, null, noise, rng, rollout_windows(question, LEAD)), noise


def judge_at(
    question: PreparedProblem,
    leader: Fit,
    null: Fit,
    noise: FloatArray,
    rng: np.random.Generator,
    places: RolloutWindows,
) -> RolloutJudge:
    """Rollouts that begin at given places. noise: (S,) of the sensors; null: as `rollout_judge` has it."""
    problem, windows = question.everything, places.windows(question.recording)
    scale = np.maximum(windows.measured.reshape(-1, len(noise)).var(axis=0), problem.scale**2)
    worst = WORST_ERROR * np.sqrt(scale)
    leaders = _learnt_without(problem, leader, places, windows)
    floor = _floor(problem, windows, places, leader.hypothesis, noise, rng)
    before = _rolled(problem, windows, places, worst, [(null.hypothesis,)])[0]
    settings = question.run.settings
    drawn = draws(len(before), settings.rollouts.draws, rng)
    mismatch = Mismatch(before, floor, scale, problem.observed, settings.verdict.stands_out, drawn)
    return RolloutJudge(problem, windows, places, worst, mismatch, leaders)


def window_judge(
    question: PreparedProblem, leader: Fit, null: Fit, noise: FloatArray, rng: np.random.Generator
) -> WindowJudge:
    """On the windows that were learnt from, where no channel of a rollout stands out of the noise."""
    problem = question.everything
    share = problem.counts / np.maximum(problem.counted.sum(axis=(0, 1)), 1.0)
    counts = problem.counted.sum(axis=1) * share
    before = (null.residuals**2).sum(axis=1)
    floor = counts * np.maximum(noise, problem.floor) ** 2
    # No noise is louder than what the account leaves.
    left = (leader.residuals**2).sum(axis=1)
    floor = np.where(left.sum(axis=0) < floor.sum(axis=0), left, floor)
    drawn = draws(len(before), question.run.settings.rollouts.draws, rng)
    mismatch = Mismatch(before, floor, problem.scale**2, problem.observed, 0.0, drawn)
    return WindowJudge(problem, leader, mismatch, (leader.hypothesis,))


def sensor_noise(question: PreparedProblem, leader: Fit) -> FloatArray:
    """(S,) standard deviation of every recorded channel's noise, 0 of hidden ones.

    What the recording states, else what second differences of the leader's residual show: a smooth error of the model
    does not move them.
    """
    problem = question.everything
    names = problem.simulator.state.names
    stated = np.array([question.recording.noise.get(name, 0.0) for name in names])
    second, counted = np.diff(leader.residuals, n=2, axis=1) / np.sqrt(6.0), problem.counted
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
    begun: dict[int, Shooting] | None = None,
) -> FloatArray:
    """(N, B, S) sums of squares of rollouts, each part's by the hypothesis that did not learn from it.

    begun: who fits the start states of each part, -1: of all of it, which is kept from one account to the next.
    """
    out, begun = [], {} if begun is None else begun
    for account in accounts:
        said = np.empty_like(windows.measured)
        for part, hypothesis in enumerate(account):
            key = part if len(account) > 1 else -1
            rows = np.flatnonzero((places.fold == part) | (key < 0))
            some = windows.take(rows)
            if places.lead and key not in begun:
                begun[key] = _beginning(problem, some, places.lead)
            said[rows] = foretold(problem, some, places.lead, hypothesis, begun.get(key))
        errors = difference(windows.measured, said, problem.simulator.state) * _counted(windows)
        out.append(_by_block(np.clip(np.nan_to_num(errors, nan=np.inf), -worst, worst), places))
    return np.array(out)


def _counted(windows: Windows) -> BoolArray:
    """(W, L + 1, S) without what pads a window, and without samples that say nothing."""
    valid = windows.valid[..., None]
    return valid if windows.weights is None else valid & (windows.weights > 0)


def _by_block(errors: FloatArray, places: RolloutWindows) -> FloatArray:
    """(B, S) sums of the squares of errors (W, L + 1, S) after the lead."""
    out = np.zeros((places.blocks, errors.shape[-1]))
    np.add.at(out, places.block, (errors[:, places.lead + 1 :] ** 2).sum(axis=1))
    return out


def foretold(
    problem: Problem, windows: Windows, lead: int, hypothesis: Hypothesis, begun: Shooting | None = None
) -> FloatArray:
    """(W, L + 1, S) what the sensors would say, from where the first `lead` transitions say that each window began.

    Without a lead from the states that were measured there. begun: who says so, where that is known already.
    """
    if not lead:
        return predicted(problem, windows, hypothesis)
    shooting = begun or _beginning(problem, windows, lead)
    rounds = LEAD_ROUNDS if closed(problem.simulator) is None else 1  # of robots each is dear
    point = shooting.at(hypothesis.frozen(), np.array(shooting.problem.windows.measured[:, 0]))
    return predicted(problem, windows, hypothesis, starts=shooting.fit(point, rounds).starts)


def _beginning(problem: Problem, windows: Windows, lead: int) -> Shooting:
    """Fits of where windows began, to their first `lead` transitions."""
    begun = replace(
        windows,
        measured=windows.measured[:, : lead + 1],
        actions=windows.actions[:, :lead],
        t=windows.t[:, : lead + 1],
        valid=windows.valid[:, : lead + 1],
        weights=None if windows.weights is None else windows.weights[:, : lead + 1],
    )
    part, white = problem.on(begun), np.maximum(problem.floor, LEAST_NOISE * problem.scale)
    return Shooting(part, Noise(white, np.ones(len(white)), np.asarray(part.counted, dtype=float)))


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
    return _by_block(np.nan_to_num(errors), places)
