"""Heavy tails: a few samples that are far wilder than a channel's noise must not rule a fit.

What a Student's t does by iteration in every fit is done once, between the search and the fits on all windows: a sample
that lies z > core standard deviations off its neighbours, as the best of the search takes them on, weighs (core / z)^2,
so that it counts as one at the core's edge (Huber's psi of 1964, as a weight); all others weigh 1. The weights belong
to the data and not to a hypothesis: given them the likelihood is a Gaussian one with known relative variances, so
profiled variances, gains, prices and tests for whiteness stay what they are, and all hypotheses are judged by the same.
With weights of their own, as in a Student's t, a poorer hypothesis would call heavy-tailed what it cannot explain.

Missing physics must not be taken for a tail. It is smooth: samples are measured off the line through seven of them.
And it depends on what happens: where wild samples come at other states or commands than usual ones (Kolmogorov and
Smirnov), they are physics. The core stays Gaussian; where there is no tail, or one that physics may have made, there
are no weights at all, and every answer is what it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import median_filter

from gpsim.channels import BoolArray, FloatArray, difference
from gpsim.diagnosis.data import Windows, cut_in_parts
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, predicted, rescored
from gpsim.diagnosis.report import LogFact
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.selection.beam import Found
from gpsim.diagnosis.setup import Question
from gpsim.recordings import Episode

CORE = 3.0
"""Of the core: a sample farther out counts as one there [standard deviations] (0.3 % of a Gaussian's samples lie
beyond, their squares are 3 % of all)."""
FAR_OUT = 5.0  # of the core, beyond which a Gaussian has no samples [standard deviations]
FEWEST_FAR_OUT = 10  # samples so far out, that make a tail (with fewer nobody can tell on what they depend)
ABOVE_SIMULATION_ERROR = 2.0
"""Times the simulation's error, that a core must be to be a sensor's noise, where none is stated."""
LEAST_SHARE_FAR_OUT = 0.001  # of the samples so far out, that make a tail
MOST_SHARE_BEYOND_CORE = 0.05
"""Of the samples beyond the core: where more lie there it is no tail, but what the model lacks."""
BY_CHANCE = 0.005
"""P-value below which samples far out depend on a state or a command, and are physics (Kolmogorov and Smirnov's test,
two for each input)."""

NORMAL_MEDIAN = 0.6745  # median of a standard normal's absolute value
FEWEST_OF_A_SIGN = 3  # samples: of fewer no test says anything
HALF = 3  # samples on either side through which a line is drawn: a sensor's accidents are shorter


@dataclass(frozen=True)
class _Judge:
    """What samples are measured by: a hypothesis, and channel (its column) -> standard deviation of its core."""

    problem: Problem
    hypothesis: Hypothesis
    scales: Mapping[int, float]

    def distances(self, windows: Windows) -> dict[int, FloatArray]:
        """Column -> (W, L + 1) how far each sample lies off, in standard deviations."""
        off = np.abs(_off(self.problem, windows, self.hypothesis))
        return {i: off[..., i] / scale for i, scale in self.scales.items()}

    def weighed(self, windows: Windows) -> Windows:
        """The windows with their samples' weights."""
        core = CORE
        weights = np.ones(windows.measured.shape) if windows.weights is None else np.array(windows.weights)
        for i, z in self.distances(windows).items() if len(windows) else ():
            weights[..., i] *= (core / np.maximum(z, core)) ** 2
        return replace(windows, weights=weights)


def without_tails(question: Question, found: Found) -> tuple[Question, Found]:
    """The question in which wild samples weigh little, and what was found under it; both as given without any."""
    problem, best = question.everything, found.fits[0].hypothesis
    scales = _tails(problem, best)
    if not scales:
        return question, found
    judge = _Judge(problem, best, scales)
    problems = (question.everything, question.searched, question.held_out, found.problem)
    everything, searched, held_out, own = (p.on(judge.weighed(p.windows)) for p in problems)
    episodes, far = _of_the_recording(question, judge)
    question = replace(
        question,
        recording=replace(question.recording, episodes=episodes),
        everything=everything,
        searched=searched,
        held_out=held_out,
        facts=_counted(question.facts, far),
    )
    fits = [_under(own, f) for f in found.fits]
    return question, replace(found, fits=fits, null=_under(own, found.null), problem=own)


def _under(problem: Problem, found: Fit) -> Fit:
    """A fit under the problem's weights."""
    return rescored(problem, replace(found, residuals=found.residuals * problem.root_weights))


def _tails(problem: Problem, hypothesis: Hypothesis) -> dict[int, float]:
    """Column -> standard deviation of the core, of every observed channel that has a heavy tail."""
    windows = problem.windows
    off, scales = _off(problem, windows, hypothesis), dict[int, float]()
    for i in np.flatnonzero(problem.observed).tolist():
        counted, own = problem.counted[:, :, i], np.abs(off[..., i])
        core = float(np.median(own[counted])) / NORMAL_MEDIAN
        if not problem.stated[i] and core < ABOVE_SIMULATION_ERROR * problem.floor[i]:
            continue  # the simulation's error is all there is
        scale = max(core, float(problem.floor[i]))
        far = counted & (own > FAR_OUT * scale)
        share = float(far.sum()) / max(int(counted.sum()), 1)
        outside = float((own[counted] > CORE * scale).mean()) if counted.any() else 0.0
        if int(far.sum()) < FEWEST_FAR_OUT or share < LEAST_SHARE_FAR_OUT or outside > MOST_SHARE_BEYOND_CORE:
            continue
        if _by_chance(problem, off[..., i] > 0, far, counted & ~far):
            scales[i] = scale
    return scales


def _of_the_recording(question: Question, judge: _Judge) -> tuple[tuple[Episode, ...], dict[str, int]]:
    """The recording's episodes with their samples' weights, and channel -> how many lie far out."""
    settings, names = judge.problem.run.settings, judge.problem.simulator.state.names
    given = question.recording.episodes
    weights = [np.ones(e.states.shape) if e.weights is None else np.array(e.weights) for e in given]
    far = {names[i]: 0 for i in judge.scales}
    least = (CORE / FAR_OUT) ** 2  # what is far out weighs less
    for windows in cut_in_parts(question.recording, settings.windows):
        weighed = np.asarray(judge.weighed(windows).weights)
        for i in judge.scales:
            wild = (weighed[..., i] > 0) & (weighed[..., i] < least) & windows.valid
            far[names[i]] += int(wild.sum())
        for row, episode in enumerate(windows.episode.tolist()):
            first = int(np.searchsorted(given[episode].t, windows.t[row, 0]))
            count = int(windows.valid[row].sum())
            weights[episode][first : first + count] = weighed[row, :count]
    return tuple(replace(e, weights=w) for e, w in zip(given, weights, strict=True)), far


def _counted(facts: tuple[LogFact, ...], far: Mapping[str, int]) -> tuple[LogFact, ...]:
    """The facts with these outliers among them."""
    known = {fact.channel: fact.count for fact in facts if fact.kind == "outliers"}
    others = tuple(fact for fact in facts if fact.kind != "outliers" or fact.channel not in far)
    return (*(LogFact("outliers", name, count + known.get(name, 0)) for name, count in far.items()), *others)


def _off(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    """(W, L + 1, S) how far each sample lies off its neighbours, as the hypothesis takes them on from the first."""
    alone = replace(
        problem, run=Run(settings=problem.run.settings)
    )  # what it costs is no effort of the search
    residual = difference(windows.measured, predicted(alone, windows, hypothesis), problem.simulator.state)
    residual = np.where(np.isfinite(residual), residual, 0.0)
    off, counts = np.zeros_like(residual), windows.valid.sum(axis=1)
    for count in np.unique(counts).tolist():  # what pads a window is no neighbour
        rows = counts == count
        off[rows, :count] = _off_neighbours(residual[rows, :count])
    return off


def _off_neighbours(residual: FloatArray) -> FloatArray:
    """(W, K, S) each sample off the line through the seven around it, at the ends through the first or last seven."""
    size = 2 * HALF + 1
    if residual.shape[1] < size:
        return np.zeros_like(residual)
    lines = _off_line(np.moveaxis(sliding_window_view(residual, size, axis=1), -1, 2))
    first, middle, last = lines[:, 0, :HALF], lines[:, :, HALF], lines[:, -1, HALF + 1 :]
    return np.concatenate([first, middle, last], axis=1)


def _off_line(samples: FloatArray) -> FloatArray:
    """(W, N, K, S) K samples off the line through them that most of them are near to (Theil 1950, Sen 1968)."""
    at = np.arange(samples.shape[2], dtype=np.float64)
    i, j = np.triu_indices(len(at), k=1)
    slopes = (samples[:, :, j] - samples[:, :, i]) / (at[j] - at[i])[:, None]
    level = samples - np.median(slopes, axis=2, keepdims=True) * at[:, None]
    return np.asarray(level - np.median(level, axis=2, keepdims=True))


def _by_chance(problem: Problem, above: BoolArray, far: BoolArray, usual: BoolArray) -> bool:
    """Whether samples far off (W, L + 1) come at the same states and commands as the usual ones.

    So must those of them that lie `above` (W, L + 1) and those that lie below: a law has a sign.
    """
    from scipy.stats import ks_2samp  # here: half a second that most diagnoses need not wait for

    windows, chance = problem.windows, BY_CHANCE
    smooth = median_filter(windows.measured, size=(1, 2 * HALF + 1, 1), mode="nearest")
    states = difference(smooth, np.zeros_like(smooth), problem.simulator.state)
    given = np.concatenate([windows.before_actions[:, -2:], windows.actions], axis=1)
    before, changed = given[:, 1:], np.abs(np.diff(given, axis=1))
    inputs = np.concatenate([states, np.abs(states), before, np.abs(before), changed], axis=-1)
    columns = (inputs[..., i] for i in range(inputs.shape[-1]))
    pairs = [(far, usual)]
    if min(int((far & above).sum()), int((far & ~above).sum())) >= FEWEST_OF_A_SIGN:
        pairs.append((far & above, far & ~above))
    return all(ks_2samp(x[a], x[b]).pvalue > chance for x in columns if np.ptp(x) > 0 for a, b in pairs)
