"""What a hypothesis leaves of the rates, a Gaussian process on it, and what one that names nothing foresees.

A share of the base's error says little where the base is far off: 99.8 % of it goes with a law that is merely near. A
Gaussian process alone, and one beside the account, show how much of the error that is left anything could have
foreseen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.corrected import Feature, Features
from gpsim.diagnosis.assessment.rollouts import DRAWS, TINY, Model, foreseen, rolled, run_errors
from gpsim.diagnosis.data import Windows, rms
from gpsim.diagnosis.fitting import (
    Extra,
    Hypothesis,
    Problem,
    as_it_was,
    has_sensors,
    predicted,
    without_sensors,
)
from gpsim.diagnosis.judging import draws, share_of
from gpsim.diagnosis.setup import PreparedProblem
from gpsim.findings import BlackBox, BoxKind, NoGp
from gpsim.gp import FitSettings, Predictor, fit_outputs

MOST_SHARE = 0.8  # of those there are, that it learns from: it is judged on the others
RESTARTS = 1  # of the fit of its hyperparameters
SCREENING_ITERATIONS = 5  # after which the best start is chosen
ITERATIONS = 30  # of the fit from there, at most
HELPS = 0.99  # times the error without it, that it must reach in some channel
HARMS = 1.05  # times the error without it, that it may make in no channel
MUCH_BETTER = 0.9
"""Times the errors of the one beside the effects, below which one on the base alone is taken."""

STANDS_OUT = 1.5
"""Times what noise alone makes of a rollout: a channel in which the account's error is less is done."""
TRIFLE = 0.005
"""Of the base's error: a channel in which the account leaves less is done (a log made in the base's own coarse steps
leaves 0.0045 of it, which a process learns)."""
LEAST_RATIO = 0.1
"""Of the account's error: in one channel a model counts as no better, nor as so much worse."""
FEWEST_ROLLOUTS = 4  # held out: with fewer there is no interval [rollouts]

FAR = 1e100  # its square is a number still
SEED = 2051  # of the draws: the same account is judged alike, whoever asks


@dataclass(frozen=True)
class Learnt:
    """A Gaussian process on the rates, and which of the transitions (N,) it learnt from."""

    predictor: Predictor
    features: Features
    rows: BoolArray

    def rates(self, state: FloatArray, action: FloatArray, transition: int = 0) -> FloatArray:
        """(B, R) its mean, the same in every transition of a window."""
        return self.predictor.mean(self.features(np.hstack([state, action])))


def learn(problem: Problem, train: Windows, hypothesis: Hypothesis, rng: np.random.Generator) -> Learnt:
    """A Gaussian process on what the hypothesis leaves of the rates, as it will be asked: in true states.

    What the hypothesis's sensors make of them the corrected simulator says by itself.
    """
    gp, rows = problem.run.settings.gp, np.zeros(len(train), dtype=np.bool_)
    count = min(gp.rows, max(2, int(MOST_SHARE * len(train))))
    rows[rng.permutation(len(train))[:count]] = True
    chosen = train.take(rows)
    if has_sensors(hypothesis):
        chosen, hypothesis = as_it_was(problem, chosen, hypothesis), without_sensors(hypothesis)
    features, targets = _features(problem), residual_rates(problem, chosen, hypothesis)
    settings = FitSettings(
        restarts=RESTARTS, screening_iterations=SCREENING_ITERATIONS, max_iterations=ITERATIONS
    )
    return Learnt(Predictor(fit_outputs(features(inputs(chosen)), targets, settings, rng)), features, rows)


def _features(problem: Problem) -> Features:
    """State and action, and the signs of the velocities: friction jumps there."""
    channels = problem.simulator.state + problem.simulator.action
    signs = (Feature(coordinate.velocity, "sign") for coordinate in problem.simulator.coordinates)
    return Features.of([*map(Feature, channels.names), *signs], channels)


@dataclass(frozen=True)
class Corrected:
    """A hypothesis with a Gaussian process on what it leaves, and training data: single transitions, whole stretches.

    runs: of the horizon; free: the longest in which the account still foresees something.

    One step is judged on the transitions that the process did not learn from; what is held out has no say.
    """

    hypothesis: Hypothesis
    learnt: Learnt
    train: Windows
    runs: Windows
    free: Windows

    def model(self, modelled: bool) -> Model:
        """With or without the process."""
        return Model(self.hypothesis, self.learnt.rates if modelled else None)

    def errors(self, problem: Problem, modelled: bool) -> FloatArray:
        """(R + S,) root mean squares of rates one step ahead and of channels after a rollout, with and without it.

        Those of channels that nobody measured, and where there are no data, are 1.
        """
        rates, rest = np.ones(len(problem.simulator.rate)), self.train.take(~self.learnt.rows)
        if len(rest):
            alone = residual_rates(problem, rest, self.hypothesis)
            both = left_with(problem, rest, self.hypothesis, alone, self.learnt) if modelled else alone
            rates = _of_columns(both)
        channels = np.ones(len(problem.observed))
        if len(self.runs):
            drift = rolled(problem, self.runs, self.model(modelled))
            channels = np.where(problem.observed, _of_columns(drift), 1.0)
        return np.concatenate([rates, channels])


def best(problem: Problem, choices: Sequence[Corrected]) -> tuple[Corrected, FloatArray]:
    """The one with the least errors, the first unless another is much better, and those errors (R + S,)."""
    errors = [choice.errors(problem, modelled=True) for choice in choices]
    logs = [float(np.log(found).mean()) for found in errors]
    least = int(np.argmin(logs))
    chosen = least if logs[least] < logs[0] + np.log(MUCH_BETTER) else 0
    return choices[chosen], errors[chosen]


def why_not(problem: Problem, without: FloatArray, with_it: FloatArray) -> NoGp | None:
    """Why simulations are no better with a Gaussian process, None if they are; `errors` (R + S,) of both."""
    names = [*problem.simulator.rate.names, *problem.simulator.state.names]
    ratios = with_it / np.maximum(without, TINY)
    worst = int(np.argmax(ratios))
    if ratios[worst] > HARMS:
        return NoGp("harms", names[worst], worst >= len(problem.simulator.rate), float(ratios[worst]))
    return None if ratios.min() < HELPS else NoGp("explains nothing")


def strays(problem: Problem, account: Corrected, chosen: Corrected) -> NoGp | None:
    """What the process of `chosen` makes worse than the account alone is, in long free runs; None if nothing.

    Over a short horizon what a process adds to a slow drift is a trifle, which grows while nothing is read.
    """
    if not len(account.free):
        return None
    without = run_errors(problem, account.free, account.model(modelled=False))
    with_it = run_errors(problem, chosen.free, chosen.model(modelled=True))
    ratios = np.where(foreseen(problem, without), with_it / np.where(np.isfinite(without), without, 1.0), 1.0)
    worst = int(np.argmax(ratios))
    if ratios[worst] <= HARMS:
        return None
    seconds = account.free.length * problem.dt
    return NoGp("strays", problem.simulator.state.names[worst], True, float(ratios[worst]), seconds)


def _of_columns(errors: FloatArray) -> FloatArray:
    """Root mean squares; of a simulation that ran away it is infinite."""
    found = np.array([rms(column) for column in errors.T])
    return np.where(np.isfinite(found), np.maximum(found, TINY), np.inf)


def left_with(
    problem: Problem, windows: Windows, hypothesis: Hypothesis, alone: FloatArray, learnt: Learnt
) -> FloatArray:
    """(W, R) residual rates of single transitions with the Gaussian process, `alone` (W, R) those without it."""
    if has_sensors(hypothesis):  # it knows the true states, which the simulation has
        return residual_rates(problem, windows, hypothesis, learnt.rates)
    return np.asarray(alone - learnt.rates(windows.measured[:, 0], windows.actions[:, 0]))


def with_a_past(question: PreparedProblem, train: Windows, hypothesis: Hypothesis) -> Windows:
    """The transitions of which the sensors saw all that they remember: nobody knows what was before an episode."""
    if not has_sensors(hypothesis):
        return train
    problem = question.everything
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    late = chain.sensors.looks_back(hypothesis.spread(hypothesis.theta[None], 1))
    begun = np.array([episode.t[0] for episode in question.recording.episodes])
    known = ~train.fresh & (train.t[:, 0] - begun[train.episode] > late)
    return train.take(known) if known.any() else train


def inputs(windows: Windows) -> FloatArray:
    """(W, S + A) state and action at the transitions' starts."""
    return np.hstack([windows.measured[:, 0], windows.actions[:, 0]])


def residual_rates(
    problem: Problem, windows: Windows, hypothesis: Hypothesis, extra: Extra | None = None
) -> FloatArray:
    """(W, R) measured minus simulated rates of single transitions; `extra` rates are added to the simulation's."""
    said = predicted(problem, windows, hypothesis, extra)
    dt = np.diff(windows.t, axis=1)[:, 0]
    simulated = problem.simulator.measured_rates(windows.measured[:, 0], said[:, 1], dt)
    return np.asarray(measured_rates(problem, windows) - simulated)


def measured_rates(problem: Problem, windows: Windows) -> FloatArray:
    """(W, R) of single transitions."""
    dt = np.diff(windows.t, axis=1)[:, 0]
    return problem.simulator.measured_rates(windows.measured[:, 0], windows.measured[:, 1], dt)


def black_box(
    boxes: Mapping[BoxKind, str], errors: Mapping[str, FloatArray], seen: Sequence[int]
) -> BlackBox | None:
    """Which model that names nothing takes most off the account's error; None where that error does not stand out.

    boxes: what each of them is called in `errors`, which are (W, S) at the ends of held-out rollouts, also of `before`,
    `after` and `noise_floor`; seen: the columns of channels that were measured.
    """
    if not boxes or not errors:
        return None
    # Of a simulation that ran away a number still.
    squares = {kind: np.minimum(np.nan_to_num(np.abs(e), nan=FAR), FAR) ** 2 for kind, e in errors.items()}
    after, floor, before = (squares[kind].mean(axis=0) for kind in ("after", "noise_floor", "before"))
    counts = (after > STANDS_OUT**2 * floor) & (after > TRIFLE**2 * before)
    counts &= np.isin(np.arange(len(counts)), seen)
    if not counts.any():
        return None
    rows = len(squares["after"])
    weights = np.vstack([np.ones(rows), draws(rows, DRAWS, np.random.default_rng(SEED))])
    means = {kind: weights @ square[:, counts] / rows for kind, square in squares.items()}
    taken = {kind: _taken_off(means, name) for kind, name in boxes.items()}
    best = max(taken, key=lambda kind: float(taken[kind][0]))
    return BlackBox(best, share_of(taken[best], rows >= FEWEST_ROLLOUTS))


def _taken_off(means: Mapping[str, FloatArray], name: str) -> FloatArray:
    """(1 + D,) how much less a box's error beyond noise is than the account's, channels by their geometric mean."""
    floor = means["noise_floor"]
    left, own = (np.maximum(means[kind] - floor, TINY) for kind in (name, "after"))
    ratios = np.clip(0.5 * np.log(left) - 0.5 * np.log(own), np.log(LEAST_RATIO), -np.log(LEAST_RATIO))
    return np.asarray(1.0 - np.exp(ratios.mean(axis=1)))
