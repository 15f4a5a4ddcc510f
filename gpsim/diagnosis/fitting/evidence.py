"""What a residual is beside missing physics: chance, the sensors' noise, and the simulation's own error.

That error is a part of the noise, or it would pass for physics: steps are chosen that keep it small.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.special import stdtr

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.problem import Problem
from gpsim.diagnosis.fitting.shooting import STATE_STEP, Fit, Shooting, fit
from gpsim.effects import BlackBoxStepper, closed
from gpsim.simulators import Simulator

WHITENESS_LAGS = 3  # lags at which a white residual must not be correlated [samples]
AT_FLOOR = 1.01  # times the floor (known noise, numerical error): a residual that small is white
PROJECTED_WINDOWS = 60
"""Over which the share is averaged that fitting start states takes off white noise [windows]."""
BEYOND_CHANCE = (
    1.1  # times the squares that noise makes: less may be chance, or noise that was stated roughly
)
USUAL_SUBSTEP = 0.0125
"""Where friction may hold something at rest [s] (what friction at rest needs on robots)."""
TOLERATED_NOISE = 3.0  # or this part of the known noise: one in three
ERROR_MARGIN = 2.0  # times the change when the substep is halved
ERROR_ITERATIONS = 4  # of the fit around which the numerical error is measured
COARSER_STEPS = (20, 10, 5, 4, 3, 2, 1)
"""Times as long as its own the steps may be in which slopes are found, the cheapest that will do."""
TOLERATED_BY_COARSER = 0.03
"""Of what a slightly other start, or other sizes, change in a channel: what these longer steps may be off by, root mean
square. So much leaves a Gauss-Newton step nearly as long, and is mended by what steps teach of slopes."""
ASIDE = 1e-3  # of a channel's size, by which starts are moved to see what that changes
LESS = 0.8  # times its sizes, that a likely machine has to see what those change
TOLERATED_DRY_ERROR = 3e-4
"""Of a channel's spread: what stops of dry friction may be off by, if it is more than noise hides."""
TOLERATED_STEP_ERROR, HIDDEN_BY_NOISE = 3e-5, 30.0
"""Of a channel's spread, or of noise one in so many: what halving the steps may change. It is alike in all windows, so
that they do not average it out: at a third of the noise an arm's viscous friction came out a third too high."""
EXACT_STEPS, FINER_STEPS = (8.0, 5.0, 4.0, 3.0, 2.0, 1.0), (0.5, 0.25)
"""Times as long as its own, steps of a method of higher order that are tried; finer ones in models of few joints alone
(a model's own step is off by a millimetre where stiff servos move light links, and hides all that encoders tell)."""
FEW_JOINTS = (
    2  # of a model whose steps may be as fine as what was measured asks: those of an arm are too dear
)
COST_OF_EXACT = 4.0  # steps of its own that such a step costs (Runge and Kutta's four stages)
NEARLY = 5.0  # times the least error: as exact, where none are exact enough
DRY_FINER = (1, 3, 6)  # times as many steps where dry friction acts, the first that will do


def whiteness(problem: Problem, at: Fit) -> float:
    """The p-value with which the residual is white, beyond its floor.

    A one-sided test for positive correlation at short lags, each window one independent draw (Student 1908: their
    scatter is estimated from as many). Start states were fitted to the same samples, which correlates even white
    noise; that share is known exactly and taken off.
    """
    windows, worst = problem.windows, 1.0
    if len(windows) < 2:
        return worst
    seen = np.flatnonzero(problem.observed)
    expected = _fitted_share(problem, at)
    for place, channel in enumerate(seen):
        residual, floor = at.residuals[..., channel], float(problem.floor[channel])
        squares = (residual**2).sum(axis=1)
        if squares.sum() / max(problem.counts[channel], 1.0) <= (AT_FLOOR * floor) ** 2:
            continue  # the floor (known noise, numerical error) is all there is
        # In units of the window's own power: one loud window must not drown what all others say.
        own = np.maximum(squares / (problem.counts[channel] / len(windows)), max(floor**2, 1e-300))
        for lag in range(1, WHITENESS_LAGS + 1):
            products = (residual[:, lag:] * residual[:, :-lag]).sum(axis=1) / own + expected[place, lag - 1]
            scatter = float(products.std(ddof=1)) / np.sqrt(len(products))
            t = float(products.mean()) / max(scatter, 1e-300)
            worst = min(worst, float(stdtr(len(products) - 1, -t)))
    return min(1.0, worst * WHITENESS_LAGS * len(seen))


def unexplained(problem: Problem, at: Fit) -> float:
    """Nats of a fit's misfit beyond the sensors' noise, as stated or as neighbours do not share it."""
    noise, total = at.noise, 0.0
    own = sensor_noise(problem, at.residuals)
    for i in np.flatnonzero(problem.observed):
        weights = noise.weights[..., i]
        scale = noise.white[i] ** 2 * noise.times[i]
        cost = 0.5 * float(((at.residuals[..., i] * weights) ** 2).sum()) / scale
        known = 0.5 * float((weights > 0).sum()) * float(own[i]) ** 2 / scale
        total += max(0.0, cost - BEYOND_CHANCE * known)
    return total


def sensor_noise(problem: Problem, residuals: FloatArray) -> FloatArray:
    """(S,) standard deviation of every channel's noise: as stated, else by second differences.

    Smooth errors of a model do not move these.
    """
    second, counted = np.diff(residuals, n=2, axis=1) / np.sqrt(6.0), problem.counted
    sound = counted[:, 2:] & counted[:, 1:-1] & counted[:, :-2]
    rough = [
        np.sqrt(np.mean(second[..., i][sound[..., i]] ** 2)) if sound[..., i].any() else 0.0
        for i in range(len(problem.floor))
    ]
    return np.asarray(np.where(problem.stated, problem.floor, np.maximum(rough, problem.floor)))


def _fitted_share(problem: Problem, at: Fit) -> FloatArray:
    """(observed channels, lags): what fitting start states takes off a window's lag products of white noise."""
    count = len(problem.windows)
    rows = np.linspace(0, count - 1, min(count, PROJECTED_WINDOWS)).astype(np.int64)
    part = problem.on(problem.windows.take(rows))
    shooting = Shooting(part)
    found = shooting.at(at.hypothesis, at.starts[rows])
    shooting.told_by(found.residuals)
    every = shooting.slopes(found, parameters=False).by_start
    seen, (count, samples, _) = np.flatnonzero(problem.observed), found.residuals.shape
    slopes = every.reshape(count, samples, -1, every.shape[2])[:, :, seen]
    channels, dimension = slopes.shape[2:]
    flat = slopes.reshape(count, samples * channels, dimension)
    size = np.sqrt((flat**2).sum(axis=1, keepdims=True))
    flat = flat / np.where(size > 0, size, 1.0)
    basis = np.linalg.svd(flat, full_matrices=False)
    kept = (basis.U * (1e-9 * basis.S[:, :1] < basis.S)[:, None, :]).reshape(count, samples, channels, -1)
    out = np.empty((channels, WHITENESS_LAGS))
    for lag in range(WHITENESS_LAGS):
        out[:, lag] = (kept[:, lag + 1 :] * kept[:, : -lag - 1]).sum(axis=(1, 3)).mean(axis=0)
    return out


def numerical_error(problem: Problem, at: Fit | None = None) -> FloatArray:
    """(S,) root mean square change of the simulated windows when the substep is halved, with a margin.

    The error of a third-order scheme is 8/7 of that change (4/3 where friction stops a body), and it is the same in all
    windows that look alike: what it could pass off as physics must stay below the floor.
    """
    at = at or fit(problem, Hypothesis(), rounds=ERROR_ITERATIONS)
    finer, theta = replace(problem, substeps=2 * problem.substeps), at.hypothesis.theta[None]
    one, other = (p.residuals(at.hypothesis, theta, at.starts[None])[0] for p in (problem, finer))
    change = (other - one)[problem.windows.valid]
    return np.asarray(ERROR_MARGIN * np.sqrt(np.mean(change**2, axis=0)))


def inexact(problem: Problem, likely: Callable[[], Hypothesis]) -> FloatArray:
    """(S,) the numerical error in the steps chosen; of a `likely` machine, where the base whirls as none does.

    An error of half a radian of a wrist that whirls in the base would hide all that encoders tell of it.
    """
    error = numerical_error(problem)
    if (error <= _tolerated(problem))[problem.observed].all():
        return error
    at = fit(problem, likely().frozen(), rounds=ERROR_ITERATIONS)
    return np.minimum(error, numerical_error(problem, at))


def _tolerated(problem: Problem) -> FloatArray:
    """(S,) what halving the steps may change, of a simulator that owns its integration."""
    return np.maximum(TOLERATED_STEP_ERROR * problem.scale, problem.floor / HIDDEN_BY_NOISE)


def stepped(problem: Problem, likely: Callable[[], Hypothesis]) -> Problem:
    """The question to a simulator that owns its integration in the steps that cost least of those exact enough.

    Those are its own, or fewer by a method of higher order: what its own step is off by would pass for physics, and
    what happens in truth knows no step. Where none will do for the base, those that do for a `likely` machine: light
    links without rotor and friction whirl as no machine does. Where none will do for that, nearly the most exact. What
    stands on something goes by its own: across impacts no method is of higher order.
    """
    system = closed(problem.simulator)
    assert system is not None
    problem = replace(problem, substeps=system.steps_of(problem.dt))
    if problem.simulator.stands(problem.windows.measured[problem.windows.valid]):
        return problem
    best, off = _cheapest(problem, system, Hypothesis(), ())
    if off > 1.0:
        few = len(problem.simulator.coordinates) <= FEW_JOINTS
        best, _ = _cheapest(problem, system, likely(), FINER_STEPS if few else ())
    return _with_slopes(best, system, likely())


def _cheapest(
    problem: Problem, system: BlackBoxStepper, hypothesis: Hypothesis, finer: Sequence[float]
) -> tuple[Problem, float]:
    """The steps that cost least of those exact enough, or nearly as exact as any; and what the best are off by.

    finer: times as long as its own, steps that are taken only if they are exact enough and no longer ones are.
    """
    own, fewest = problem.substeps, int(np.ceil(problem.dt / USUAL_SUBSTEP))
    tolerated = _tolerated(problem)
    at = fit(problem, hypothesis.frozen(), rounds=ERROR_ITERATIONS)
    exact = system.exact()

    def off(simulator: Simulator, steps: int) -> float:
        tried = replace(problem, simulator=simulator, substeps=steps)
        return float((numerical_error(tried, at) / tolerated)[problem.observed].max())

    few = sorted({max(fewest, int(np.ceil(own / times))) for times in EXACT_STEPS})
    least = off(exact, few[-1])

    for steps in (round(own / times) for times in finer if least > NEARLY):
        if (found := off(exact, steps)) <= 1.0:
            return replace(problem, simulator=exact, substeps=steps), found
    enough = 1.0 if least <= 1.0 else NEARLY * least
    choices = [(COST_OF_EXACT * n, exact, n) for n in few] + [(own, problem.simulator, own)]
    for _, simulator, steps in sorted(choices, key=lambda choice: choice[0]):
        if off(simulator, steps) <= enough:
            break
    return replace(problem, simulator=simulator, substeps=steps), least


def _with_slopes(problem: Problem, system: BlackBoxStepper, hypothesis: Hypothesis) -> Problem:
    """The question with the steps that cost least of those that tell slopes about as well as its own.

    Longer ones by the model's own method, or by the one it is simulated with; as always where neither will do.
    """
    own, plain, dear = system.steps_of(problem.dt), system.as_modelled(), COST_OF_EXACT
    choices = [(float(n), plain, n) for n in sorted({-(-own // times) for times in COARSER_STEPS})]
    cost, taken = float(problem.substeps), closed(problem.simulator)
    assert taken is not None
    if not taken.own_grid:
        choices += [(dear * n, problem.simulator, n) for n in range(1, problem.substeps)]
        cost *= dear
    exact = _changes(problem, hypothesis)
    least = np.maximum(np.sqrt(np.mean(exact**2, axis=1)), np.finfo(float).tiny)
    for _, simulator, steps in sorted((c for c in choices if c[0] < cost), key=lambda choice: choice[0]):
        longer = replace(problem, slope_steps=steps, slope_simulator=simulator)
        off = np.sqrt(np.mean((_changes(longer.slopes, hypothesis) - exact) ** 2, axis=1))
        if (off <= TOLERATED_BY_COARSER * least)[:, problem.observed].all():
            return longer
    return problem


def _changes(problem: Problem, hypothesis: Hypothesis) -> FloatArray:
    """(2, N, S): what starts a little aside, and lesser sizes, change in the samples of the windows."""
    starts, theta = problem.windows.measured[:, 0], hypothesis.theta
    aside = ASIDE * problem.scale * np.random.default_rng(0).normal(size=starts.shape)
    thetas, copies = np.stack([theta, theta, LESS * theta]), np.stack([starts, starts + aside, starts])
    said = problem.residuals(hypothesis, thetas, copies)
    return np.asarray((said[1:] - said[0])[:, problem.windows.valid])


def dry_steps(problem: Problem, rubbing: Hypothesis) -> int:
    """Times as many substeps as dry friction needs, of a simulator that owns its integration; rubbing: on one joint.

    Friction stops a body at the end of a step, wherever in the step that was: what is left over is of first order, and
    would pass for a slight inertia or delay. The fewest that what was measured cannot tell from more, or the most.
    """
    tolerated = np.maximum(TOLERATED_DRY_ERROR * problem.scale, problem.floor / TOLERATED_NOISE)
    starts, theta = problem.windows.measured[None, :, 0], rubbing.theta[None]
    (term,), valid = rubbing.terms, problem.windows.valid
    left = (replace(problem, dry_steps={term.on: n}).residuals(rubbing, theta, starts)[0] for n in DRY_FINER)
    for (fewer, before), (more, after) in pairwise(zip(DRY_FINER, left, strict=True)):
        # Of first order: the error is this many times what the finer steps changed.
        error = np.sqrt(np.mean((after - before)[valid] ** 2, axis=0)) * more / (more - fewer)
        if (error <= tolerated)[problem.observed].all():
            return fewer
    return DRY_FINER[-1]


def growth(problem: Problem, hypothesis: Hypothesis) -> FloatArray:
    """(L + 1,) times as far apart two simulations are after each transition that began slightly apart.

    In the median of the windows that last as long, in typical sizes of what was observed; 1 where none lasts as long.
    """
    starts, valid = problem.windows.measured[:, 0], problem.windows.valid
    # In any direction: one that is the same everywhere may be the one that shrinks.
    aside = STATE_STEP * problem.scale * np.random.default_rng(0).normal(size=starts.shape)
    twice = np.tile(hypothesis.theta, (2, 1))
    one, other = problem.residuals(hypothesis, twice, np.stack([starts, starts + aside]))
    apart = np.linalg.norm((other - one) / problem.scale, axis=2)
    apart /= np.linalg.norm(aside / problem.scale, axis=1)[:, None]
    lasts = valid.any(axis=0)
    out = np.ones(valid.shape[1])
    out[lasts] = np.nanmedian(np.where(valid, apart, np.nan)[:, lasts], axis=0)
    return out
