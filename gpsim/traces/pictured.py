"""What the pictures of a diagnosis show: rollouts beside what was measured, and the error over the recording.

Everything starts from measured states, as the table of errors does; the base simulator takes its own step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.diagnosis.data import Windows, cut, held_out_mask, shortest
from gpsim.diagnosis.fitting import Hypothesis, Problem, predicted
from gpsim.diagnosis.setup import PreparedProblem, completed, smoothed
from gpsim.effects import PRE_ROLL
from gpsim.recordings import Episode, HeldOut, evenly

MOST_CUT = 6000  # windows that are cut, evenly spread
STRETCHES = 40  # held out, among which the worst and the median are looked for
MOST_ROLLOUTS = 12  # rollouts of a stretch; a longer one is shown in parts
MOST_ROLLOUTS_ALONE = 4  # rollouts of a part where that would be the only stretch
CHANNELS_SHOWN = 3  # that are shown: those that make most of the mismatch

BASE, EFFECTS = "base", "base + effects"


@dataclass(frozen=True)
class Trace:
    """A held-out stretch as it was measured, and rollouts beside it, each from a measured state over the horizon.

    t: (N,) s since the recording's start; measured, said[model]: (N, C) of the shown channels; a row of NaN ends a
    rollout. errors: model -> (C,) root mean square over the stretch. place: which of how many, empty of the only one;
    whole: whether it is a whole episode.
    """

    name: str
    place: str
    whole: bool
    t: FloatArray
    measured: FloatArray
    said: Mapping[str, FloatArray]
    errors: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Traces:
    """The worst and the median stretch, or the only one.

    shown: the columns of the state, first those that make most of the mismatch; horizon: s.
    """

    shown: tuple[int, ...]
    horizon: float
    held_out: bool
    traces: tuple[Trace, ...]


@dataclass(frozen=True)
class Course:
    """One channel's root mean square error within the windows that the diagnosis learnt from, model by model.

    t: (W,) s since the recording's start, when they begin; session: whether t runs on over the episodes.
    """

    channel: int
    seconds: float
    session: bool
    t: FloatArray
    sizes: Mapping[str, FloatArray]


@dataclass(frozen=True)
class _Stretch:
    """Samples first to last of an episode; begin: the moment [s] of the first."""

    episode: int
    first: int
    last: int
    begin: float


def traces(question: PreparedProblem, leader: Hypothesis, horizon: float) -> Traces:
    """The held-out stretches in which the best model does worst and middling; of everything where none is held out."""
    length = max(2, round(horizon / question.recording.dt))
    stretches, held_out = _stretches(question, length)
    models = models_of(question, leader)
    parts = {kind: _rolled(question, stretches, model, length) for kind, model in models.items()}
    problem, best = question.everything, list(models)[-1]
    seen = np.array([name not in question.hidden for name in problem.simulator.state.names])
    errors = {kind: _errors(problem, *part, len(stretches)) for kind, part in parts.items()}
    rank = (np.nan_to_num(errors[best] / problem.scale, nan=-1.0) ** 2 * seen).sum(axis=1)
    known = np.flatnonzero(np.isfinite(errors[best]).all(axis=1))
    off = ((errors[BASE][known] ** 2).mean(axis=0) - problem.floor**2) / problem.scale**2
    off = np.where(seen, np.nan_to_num(off, nan=np.inf), -np.inf)  # a base that ran away is furthest off
    most = np.argsort(-off, kind="stable")[:CHANNELS_SHOWN]
    shown = tuple(int(i) for i in most if seen[i])
    order = known[np.argsort(rank[known])][::-1]
    places = {f"worst of {len(order)}": 0, f"median of {len(order)}": len(order) // 2}
    if len(order) < 2:
        places = {"": 0} if len(order) else {}
    made = tuple(
        _trace(question, stretches[order[at]], place, int(order[at]), shown, parts, errors)
        for place, at in places.items()
    )
    return Traces(shown, length * question.recording.dt, held_out, made)


def course(question: PreparedProblem, leader: Hypothesis) -> Course:
    """Where in the recording the base is off, in the channel in which that stands out most from the noise."""
    problem, sizes = question.everything, {}
    for kind, model in models_of(question, leader).items():
        windows = completed(problem, model, question.hidden)  # what is hidden each model guesses for itself
        squares, counts = _squares(problem, windows, predicted(problem, windows, model))
        sizes[kind] = np.sqrt(squares / counts)
    ratio = np.sqrt(np.mean(sizes[BASE] ** 2, axis=0)) / problem.floor
    channel = int(np.argmax(np.where(problem.observed, ratio, -1.0)))
    begin = problem.windows.t[:, 0]
    return Course(
        channel,
        problem.windows.length * problem.dt,
        bool((np.diff(begin) > 0).all()),
        begin,
        {kind: size[:, channel] for kind, size in sizes.items()},
    )


def models_of(question: PreparedProblem, leader: Hypothesis) -> dict[str, Hypothesis]:
    """What is compared: the base simulator with its own step, and with the effects, where there are any."""
    base = Hypothesis(scheme=question.recording.integrator)  # type: ignore[arg-type]  # `prepare` has checked it
    return {BASE: base, EFFECTS: leader} if leader.terms else {BASE: base}


def _stretches(question: PreparedProblem, length: int) -> tuple[list[_Stretch], bool]:
    """Held-out episodes, or what is held out of them, in parts of so many rollouts at most, evenly spread."""
    recording, settings = question.recording, question.everything.run.settings
    windows = cut(recording, settings.windows, length, most=MOST_CUT)
    held = held_out_mask(recording, windows)
    some = windows.take(held if held.any() else ~held)
    rests = []
    for index in np.unique(some.episode).tolist():
        first = np.searchsorted(recording.episodes[index].t, some.t[some.episode == index, 0].min())
        rests.append((index, recording.episodes[index].t, int(first)))
    for most in (MOST_ROLLOUTS, MOST_ROLLOUTS_ALONE):
        found = []
        for index, t, first in rests:  # cut into equal parts where it is long
            rollouts = max(1, round((len(t) - first) / (length + 1)))
            each = int(np.ceil(rollouts / np.ceil(rollouts / most))) * (length + 1)
            lows = list(range(first, max(first + 1, len(t) - shortest(length)), each))
            found += [
                _Stretch(index, low, end - 1, float(t[low]))
                for low, end in zip(lows, [*lows[1:], len(t)], strict=True)
            ]
        if len(found) > 1:
            break
    return [found[i] for i in evenly(len(found), STRETCHES)], bool(held.any())


def _rolled(
    question: PreparedProblem, stretches: Sequence[_Stretch], model: Hypothesis, length: int
) -> tuple[Windows, FloatArray]:
    """The stretches in windows of the horizon (their `episode` is the stretch), and what the model says in them.

    Before each comes what actuators and sensors may remember, whole windows of it.
    """
    problem, parts, step = question.everything, list[Episode](), length + 1
    for stretch in stretches:
        back = min(int(np.ceil(PRE_ROLL / step)), stretch.first // step) * step
        first, episode = stretch.first - back, question.recording.episodes[stretch.episode]
        rows, actions = slice(first, stretch.last + 1), episode.actions[first : stretch.last]
        parts.append(
            replace(episode, t=episode.t[rows], states=episode.states[rows], actions=actions, weights=None)
        )
    no_boundary = HeldOut(episodes_from=0)  # in them
    alone = replace(question.recording, episodes=tuple(parts), held_out=no_boundary)
    windows = cut(smoothed(problem, alone, model, question.hidden), problem.run.settings.windows, length)
    begins = np.array([stretch.begin for stretch in stretches])
    windows = windows.take(windows.t[:, 0] >= begins[windows.episode])
    return windows, predicted(problem, windows, model)


def _errors(problem: Problem, windows: Windows, said: FloatArray, count: int) -> FloatArray:
    """(count, S) root mean square of measured minus simulated in each stretch, NaN where no window fits into it."""
    squares, counts = _squares(problem, windows, said)
    out = np.full((count, squares.shape[1]), np.nan)
    for index in np.unique(windows.episode):
        mine = windows.episode == index
        out[index] = np.sqrt(squares[mine].sum(axis=0) / counts[mine].sum())
    return out


def _squares(problem: Problem, windows: Windows, said: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(W, S) sums of squares of measured minus simulated, over (W, 1) samples: those after a window's first one.

    That is where the rollout starts.
    """
    valid = np.array(windows.valid)[..., None]
    valid[:, 0] = False
    off = difference(windows.measured, said, problem.simulator.state)
    return np.where(valid, off**2, 0.0).sum(axis=1), valid.sum(axis=1)


def _trace(
    question: PreparedProblem,
    stretch: _Stretch,
    place: str,
    index: int,
    shown: Sequence[int],
    parts: Mapping[str, tuple[Windows, FloatArray]],
    errors: Mapping[str, FloatArray],
) -> Trace:
    columns, episode, windows = list(shown), question.recording.episodes[stretch.episode], parts[BASE][0]
    mine = windows.episode == index

    def joined(pieces: FloatArray) -> FloatArray:
        """Pieces (P, L + 1, C) one after the other, a row of NaN after each."""
        gap = np.full((1, pieces.shape[2]), np.nan)
        each = zip(pieces[mine], windows.valid[mine], strict=True)
        return np.concatenate([part for piece, ok in each for part in (piece[ok], gap)])

    return Trace(
        episode.name,
        place,
        stretch.first == 0 and stretch.last == len(episode.t) - 1,
        joined(windows.t[..., None])[:, 0],
        joined(windows.measured[..., columns]),
        {k: joined(said[..., columns]) for k, (_, said) in parts.items()},
        {k: error[index][columns] for k, error in errors.items()},
    )
