"""What nobody measured, by what a hypothesis says that it was: hidden states, and velocities behind a filter.

A window's start state is estimated together with the parameters, so a channel that was not observed needs no more than
a guess to begin with. Where values are needed at every sample (single steps, rollouts, the Gaussian process, bins),
they are those of the windows' simulation after their start states were fitted to the channels that were measured.

Velocities that were differentiated from positions, by a central difference or a Savitzky-Golay filter, are the mean
velocity of some steps, with the commands of all of them. Where the motion bends that is not the velocity at the sample,
and a model that is exact is off by as much in every single step. The filter is linear, so the recording shows which one
it was, v_k = sum_j w_j q_(k + j); what it does to the motion that a hypothesis predicts around a sample is what it did
to the recorded one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.data import Windows, at, cut_in_parts, stretches
from gpsim.diagnosis.fitting import Hypothesis, Problem, fit, predicted
from gpsim.effects import closed, even
from gpsim.recordings import Recording
from gpsim.simulators import Simulator

COMPLETION_ITERATIONS = 8  # of the fit of start states that a recording is completed with
COMPLETED_DEARLY = 3  # the same, where each simulation is dear
COMPLETED_GAIN = 0.05
"""That a round must gain where only start states are fitted, to complete a recording [nats a window]."""

WIDEST_FILTER = 5  # samples to either side of a filter
EXACT_MISFIT = 1e-3  # of a velocity's typical size: how closely a filter has to say what was written down
AS_GOOD = 2.0  # times the misfit of the widest filter, that a narrower one may have
MOST_ROWS = 20_000  # samples that a filter is fitted to
ROWS_PER_WEIGHT = 4  # samples for each weight of the widest filter, that there must be
FIT_ITERATIONS = 5  # of the fit of the motion around a sample, to which the filter is applied


def smoothed(
    problem: Problem, recording: Recording, hypothesis: Hypothesis, hidden: Sequence[str]
) -> Recording:
    """The completed recording with its hidden channels as the hypothesis's own windows say."""
    if not hidden:
        return recording
    columns = [recording.state.index(name) for name in hidden]
    known: dict[int, list[tuple[FloatArray, FloatArray]]] = {}  # episode -> moments, and what is said of them
    for part in cut_in_parts(recording, problem.run.settings.windows):
        windows = completed(problem.on(part), hypothesis, hidden)
        for index in np.unique(windows.episode):
            rows = windows.episode == index
            valid = windows.valid[rows]
            said = windows.measured[rows][valid][:, columns]
            known.setdefault(int(index), []).append((windows.t[rows][valid], said))
    episodes = list(recording.episodes)
    for index, parts in known.items():
        t, said = map(np.concatenate, zip(*parts, strict=True))
        states = np.array(episodes[index].states)
        for i, column in enumerate(columns):  # between and beyond windows straight on from the neighbours
            states[:, column] = np.interp(episodes[index].t, t, said[:, i])
        episodes[index] = replace(episodes[index], states=states)
    return replace(recording, episodes=tuple(episodes))


def completed(problem: Problem, hypothesis: Hypothesis, hidden: Sequence[str]) -> Windows:
    """The problem's windows with their hidden channels as the hypothesis says, its start states fitted."""
    windows = problem.windows
    if not hidden:
        return windows
    tolerance = COMPLETED_GAIN * len(windows)
    rounds = COMPLETION_ITERATIONS if closed(problem.simulator) is None else COMPLETED_DEARLY
    found = fit(problem, hypothesis.frozen(), rounds=rounds, tolerance=tolerance)
    columns = [problem.simulator.state.index(name) for name in hidden]
    measured = np.array(windows.measured)
    said = predicted(problem, windows, found.hypothesis, starts=found.starts)
    measured[..., columns] = said[..., columns]
    return replace(windows, measured=measured)


class Completions:
    """A recording as each hypothesis completes it: worked out once for each, whoever asks.

    account: the leading one, which completes it for all where every step is dear.
    """

    def __init__(
        self, problem: Problem, recording: Recording, hidden: Sequence[str], account: Hypothesis
    ) -> None:
        self._asked = problem, recording, hidden
        self._for_all = account if closed(problem.simulator) is not None else None
        self._known: list[tuple[Hypothesis, Recording]] = []

    def by(self, hypothesis: Hypothesis) -> Recording:
        """The recording with its hidden channels as the hypothesis's own windows say."""
        hypothesis = self._for_all or hypothesis
        for known, recording in self._known:
            if known == hypothesis:
                return recording
        problem, recording, hidden = self._asked
        self._known.append((hypothesis, smoothed(problem, recording, hypothesis, hidden)))
        return self._known[-1][1]


@dataclass(frozen=True)
class Filter:
    """Weights (2 J + 1,) 1/s of the positions around a sample that make its velocity, by their columns."""

    position: int
    velocity: int
    weights: FloatArray

    @property
    def reach(self) -> int:
        """J: samples to either side."""
        return len(self.weights) // 2


def filters(recording: Recording, simulator: Simulator) -> list[Filter]:
    """How every velocity was made of its position; none where one was not, or not by such a filter.

    Nor on an uneven clock, on which a filter's weights would depend.
    """
    if recording.velocities != "differentiated":
        return []
    steps = np.concatenate(
        [np.diff(recording.episodes[i].t[low : high + 1]) for i, low, high in stretches(recording)]
    )
    if not even(steps, np.median(steps, keepdims=True)):  # dt may be rounded
        return []
    names = simulator.state.names
    found = [_filter(recording, names.index(c.name), names.index(c.velocity)) for c in simulator.coordinates]
    return [f for f in found if f is not None] if all(found) else []


def undone(
    problem: Problem,
    recording: Recording,
    windows: Windows,
    hypothesis: Hypothesis,
    made_by: Sequence[Filter],
) -> Windows:
    """Single transitions with the velocities at both ends as the hypothesis says they were before the filters.

    Those too near to the end of a stretch, where filters do something else, are left out, unless all of them are.
    """
    reach = max(f.reach for f in made_by)
    rows, places = _inside(recording, windows, reach)
    if not places:
        return windows
    around = problem.on(at(recording, places, 2 * reach + 1))
    found = fit(around, hypothesis.frozen(), rounds=FIT_ITERATIONS)
    said = predicted(around, around.windows, found.hypothesis, starts=found.starts)
    windows = windows.take(rows)
    measured = np.array(windows.measured)
    for made in made_by:
        for end in (0, 1):
            middle = reach + end
            near = said[:, middle - made.reach : middle + made.reach + 1, made.position]
            measured[:, end, made.velocity] -= near @ made.weights - said[:, middle, made.velocity]
    return replace(windows, measured=measured)


def _filter(recording: Recording, position: int, velocity: int) -> Filter | None:
    """The narrowest filter that says the velocity about as well as the widest does."""
    widest = WIDEST_FILTER
    q, v = _samples(recording, position, velocity)
    if len(v) < ROWS_PER_WEIGHT * (2 * widest + 1):
        return None
    narrower = [q[:, widest - j : widest + j + 1] for j in range(1, widest + 1)]
    weights = [np.asarray(np.linalg.lstsq(part, v, rcond=None)[0]) for part in narrower]
    misfit = [float(np.sqrt(np.mean((part @ w - v) ** 2))) for part, w in zip(narrower, weights, strict=True)]
    rounding = 1e-9 * float(np.abs(v).mean())
    if misfit[-1] > EXACT_MISFIT * float(np.abs(v).mean()):
        return None
    best = next(i for i, error in enumerate(misfit) if error <= AS_GOOD * misfit[-1] + rounding)
    chosen = weights[best]
    chosen[len(chosen) // 2] -= chosen.sum()  # no velocity depends on where it is
    return Filter(position, velocity, chosen)


def _samples(recording: Recording, position: int, velocity: int) -> tuple[FloatArray, FloatArray]:
    """Positions (N, 2 J + 1) around samples, from the middle one, and velocities (N,) there."""
    widest = WIDEST_FILTER
    around, there = [np.empty((0, 2 * widest + 1))], [np.empty(0)]
    angle = list(recording.state)[position].unit == "rad"
    for index, low, high in stretches(recording):
        if high - low < 2 * widest:
            continue
        states = recording.episodes[index].states[low : high + 1]
        q = np.unwrap(states[:, position]) if angle else states[:, position]
        near = sliding_window_view(q, 2 * widest + 1)
        around.append(near - near[:, widest : widest + 1])  # a filter of velocities does not see where it is
        there.append(states[widest : len(states) - widest, velocity])
        if sum(map(len, there)) > MOST_ROWS:
            break
    return np.concatenate(around), np.concatenate(there)


def _inside(recording: Recording, windows: Windows, reach: int) -> tuple[IntArray, list[tuple[int, int]]]:
    """The windows with `reach` samples on both sides in their stretch, and (episode, sample) where those begin."""
    within: dict[int, list[tuple[int, int]]] = {}
    for index, low, high in stretches(recording):
        within.setdefault(index, []).append((low, high))
    rows, places = [], []
    for row, (episode, begin) in enumerate(zip(windows.episode.tolist(), windows.t[:, 0], strict=True)):
        first = int(np.searchsorted(recording.episodes[episode].t, begin)) - reach
        if any(low <= first and first + 2 * reach + 1 <= high for low, high in within.get(episode, [])):
            rows.append(row)
            places.append((episode, first))
    return np.array(rows, dtype=np.int64), places
