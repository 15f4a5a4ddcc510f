"""Rollouts on held-out data: how far every model has drifted from the measurement after the horizon.

And errors over those of the base simulator, with paired bootstrap intervals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray, Channel, FloatArray, IntArray, difference
from gpsim.diagnosis.data import Windows, cut, held_out_mask, rms, stretches, typical
from gpsim.diagnosis.fitting import Extra, Hypothesis, Problem, predicted
from gpsim.diagnosis.judging import horizon_of, interval_of, share_of
from gpsim.diagnosis.setup import Completions, PreparedProblem
from gpsim.findings import Kind, OverBefore, Ratio, Rollout, RolloutErrors, RolloutModelErrors, Share
from gpsim.recordings import Recording, evenly
from gpsim.residuals import first_held_out

ROLLOUTS_LOOKED_AT = 4000  # windows evenly spread, from which these are taken
BLOCK = 25  # samples in a row that are drawn together (a usual window)
FEWEST_BLOCKS = 8  # shorter ones are drawn, or no interval is told, where there are fewer [blocks]
DRAWS = 400  # of all blocks
LONGEST_FREE = 3000  # transitions of a free run, and how many are made: time
MOST_FREE = 8
FORESEEN = 0.3  # of a channel's spread: a simulation that errs by more is lost there
TINY = 1e-300  # guards divisions by errors that are 0

MODELS: tuple[Kind, ...] = ("before", "tuned", "gp", "after", "after_gp")


@dataclass(frozen=True)
class Model:
    """A hypothesis, and rates that are added to it."""

    hypothesis: Hypothesis
    extra: Extra | None = None


def base_of(question: PreparedProblem) -> Hypothesis:
    """The base simulator with its own step."""
    return Hypothesis(scheme=question.recording.integrator)  # type: ignore[arg-type]  # `prepare` has checked it


def drifts(
    question: PreparedProblem,
    models: Mapping[str, Model],
    noise: FloatArray,
    rng: np.random.Generator,
    completions: Completions,
) -> dict[str, FloatArray]:
    """(W, S) how far every model has drifted at the ends of W rollouts; empty where no held-out stretch is as long.

    Of `noise_floor` what the sensors' noise (S,) makes of the last model's rollouts, at their start and end.
    """
    problem = question.everything
    windows: dict[str, Windows] = {}
    for kind, model in models.items():
        if question.hidden or not windows:  # what is hidden each model guesses for itself
            own = whole_windows(question, completions.by(model.hypothesis))
        if not len(own):
            return {}
        windows[kind] = own
    ends = {kind: _ends(problem, windows[kind], model) for kind, model in models.items()}
    state = problem.simulator.state
    errors = {kind: difference(windows[kind].measured[:, -1], end, state) for kind, end in ends.items()}
    kind, model = list(models.items())[-1]
    start, end = (rng.normal(size=ends[kind].shape) * noise for _ in range(2))
    noisy = replace(windows[kind], measured=windows[kind].measured + start[:, None])
    errors["noise_floor"] = difference(_ends(problem, noisy, model), ends[kind], state) + end
    return errors


def rollouts(
    question: PreparedProblem, errors: Mapping[str, FloatArray], box: str | None, rng: np.random.Generator
) -> Rollout:
    """Root mean square errors of every measured channel after the horizon. errors: as `drifts` has them.

    box: the model that is the `black_box`. `typical` holds the same from the median, which rare glitches of a sensor do
    not move.
    """
    out: dict[str, RolloutErrors] = {}
    for i, channel in shown_channels(question) if errors else ():
        own = {kind: errors[kind][:, i] for kind in (*MODELS, "noise_floor")}
        over = OverBefore(**over_before({kind: own[kind] for kind in MODELS}, rng, correlated=False))
        out[channel.name] = RolloutErrors(
            **{kind: rms(e) for kind, e in own.items()},
            unit=channel.unit,
            typical=RolloutModelErrors(**{kind: typical(e) for kind, e in own.items()}),
            over_before=over,
            after_over_before=over.after,
            black_box=None if box is None else rms(errors[box][:, i]),
        )
    return Rollout(_length(question) * question.recording.dt, out)


def shown_channels(question: PreparedProblem) -> list[tuple[int, Channel]]:
    """Which channels were measured, by their columns."""
    state = enumerate(question.everything.simulator.state)
    return [(i, channel) for i, channel in state if channel.name not in question.hidden]


def _ends(problem: Problem, windows: Windows, model: Model) -> FloatArray:
    """(W, S): where a model says that the windows end."""
    return predicted(problem, windows, model.hypothesis, model.extra)[:, -1]


def rolled(problem: Problem, windows: Windows, model: Model) -> FloatArray:
    """(W, S) how far the model has drifted from what was measured at the windows' ends."""
    return difference(windows.measured[:, -1], _ends(problem, windows, model), problem.simulator.state)


def whole_windows(question: PreparedProblem, recording: Recording, learnt_from: bool = False) -> Windows:
    """Evenly spread ones of the horizon in the held-out part, or in what is `learnt_from`.

    All is both where nothing is held out. recording: the question's, completed where channels are hidden.
    """
    settings = question.everything.run.settings
    windows = cut(recording, settings.windows, _length(question), most=ROLLOUTS_LOOKED_AT)
    held = held_out_mask(recording, windows)
    windows = windows.take(held if held.any() and not learnt_from else ~held)
    windows = windows.take(windows.valid[:, -1])
    windows = windows.take(windows.sound_ends) if windows.sound_ends.any() else windows
    return windows.take(evenly(len(windows), settings.rollouts.most))


def free_length(question: PreparedProblem, recording: Recording, model: Model) -> int:
    """Transitions of the longest runs of what is learnt from in which the model still foresees a measured channel.

    Halved until it does: of a run in which it is lost nobody can tell what makes it worse. 0 where those are no longer
    than a rollout.
    """
    problem, held = question.everything, first_held_out(recording)
    spans = [last - first for index, first, last in stretches(recording) if first < held[index]]
    length = min(max(spans, default=0), LONGEST_FREE)
    while length > _length(question):
        errors = run_errors(problem, free_runs(question, recording, length), model)
        if foreseen(problem, errors).any():
            return length
        length //= 2
    return 0


def free_runs(question: PreparedProblem, recording: Recording, length: int) -> Windows:
    """Evenly spread ones of so many transitions in what is learnt from; shorter stretches are padded."""
    most = ROLLOUTS_LOOKED_AT if length else 0
    windows = cut(recording, question.run.settings.windows, max(length, 1), most)
    windows = windows.take(~held_out_mask(recording, windows))
    return windows.take(evenly(len(windows), MOST_FREE))


def run_errors(problem: Problem, windows: Windows, model: Model) -> FloatArray:
    """(S,) root mean square errors along whole windows; infinite of a simulation that ran away."""
    with np.errstate(all="ignore"):  # it may
        said = predicted(problem, windows, model.hypothesis, model.extra)
        off = difference(windows.measured, said, problem.simulator.state)
        later = np.array(windows.valid)
        later[:, 0] = False  # there it starts
        found = np.sqrt(np.mean(off[later] ** 2, axis=0))
    return np.where(np.isfinite(found), np.maximum(found, TINY), np.inf)


def foreseen(problem: Problem, errors: FloatArray) -> BoolArray:
    """(S,) in which measured channels errors (S,) are so small beside the channel's spread that they tell something."""
    return np.asarray(problem.observed & (errors < FORESEEN * problem.scale))


def _length(question: PreparedProblem) -> int:
    return max(2, min(horizon_of(question), _longest(question.recording)))


def _longest(recording: Recording) -> int:
    """Transitions of the longest held-out stretch; of any where nothing is held out."""
    held = first_held_out(recording)
    spans = [(last - first, first >= held[index]) for index, first, last in stretches(recording)]
    return max((span for span, out in spans if out), default=max((span for span, _ in spans), default=0))


def over_before(
    errors: Mapping[str, FloatArray], rng: np.random.Generator, *, correlated: bool = True
) -> dict[str, Ratio]:
    """Of each model but `before` its root mean square over that one's, with its 90 % interval.

    A paired bootstrap over blocks of neighbouring samples (Kuensch 1989), or over samples if they are not `correlated`.
    Errors: (N,) each; the interval is None where there are too few.
    """
    sums, drawn = _drawn_blocks(errors, rng, correlated)
    base, out = sums.pop("before"), {}
    for kind, own in sums.items():
        ratios = np.sqrt(own[drawn].sum(axis=1) / np.maximum(base[drawn].sum(axis=1), TINY))
        value = rms(errors[kind]) / max(rms(errors["before"]), TINY)
        out[kind] = Ratio(value, *interval_of(ratios, len(base) >= FEWEST_BLOCKS))
    return out


def share_explained(errors: Mapping[str, FloatArray], rng: np.random.Generator) -> Share | None:
    """Which share of the base's squared errors beyond those of noise the effects take off; None where it has none.

    errors: (N,) of `before`, `after` and `noise_floor`, blocks of which are drawn as in `over_before`.
    """
    sums, drawn = _drawn_blocks(errors, rng, correlated=True)
    excess, left = (sums[kind] - sums["noise_floor"] for kind in ("before", "after"))
    if excess.sum() <= 0.0:
        return None
    shares = 1.0 - left[drawn].sum(axis=1) / np.maximum(excess[drawn].sum(axis=1), TINY)
    whole = 1.0 - left.sum() / excess.sum()
    return share_of(np.clip([whole, *shares], 0.0, 1.0), len(excess) >= FEWEST_BLOCKS)


def _drawn_blocks(
    errors: Mapping[str, FloatArray], rng: np.random.Generator, correlated: bool
) -> tuple[dict[str, FloatArray], IntArray]:
    """(B,) sums of squares of each model's errors (N,) in blocks of neighbours, and (D, B) the blocks of each draw."""
    count = len(errors["before"])
    block = max(1, min(BLOCK, count // FEWEST_BLOCKS)) if correlated else 1
    which = np.arange(count) // block
    sums = {kind: np.asarray(np.bincount(which, weights=e**2), dtype=float) for kind, e in errors.items()}
    blocks = len(sums["before"])
    return sums, rng.integers(0, blocks, (DRAWS, blocks))
