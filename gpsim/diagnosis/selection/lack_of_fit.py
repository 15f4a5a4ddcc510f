"""Lack of fit: whether a smooth function of state and command, added to a rate, explains what is left over.

A score test (Rao 1948; with smooth alternatives Neyman 1937): a hypothesis is widened by piecewise linear functions of
one input or of two, multiplied; how the residual would change with each is the sum of how it answers pushes on a rate
(see `impulses`), and what the best combination of them would take off half the sum of squares is chi-squared
distributed, halved, if nothing is missing; not centrally, where the simulation's own error is left over, too. It tells
that something is missing where no law of the catalogue does, and on what it depends. Laws that remember get, beside a
command, its average over the last moments.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gpsim.channels import FloatArray, IntArray, difference
from gpsim.diagnosis.fitting import (
    Directions,
    Fit,
    Problem,
    numerical_error,
)
from gpsim.diagnosis.run import kept
from gpsim.diagnosis.selection.chi_square import beyond
from gpsim.diagnosis.selection.elimination import SCREENING_WINDOWS_OF_A_ROBOT, on_some_windows
from gpsim.diagnosis.selection.impulses import impulses, visited
from gpsim.effects import closed

KNOTS_OF_ONE = 7  # knots of a function of one input, at quantiles of it
KNOTS_OF_TWO = 4  # knots along each input of a function of two
COMMAND_MEMORIES = (2.0, 8.0)  # time constants of the averages over what was commanded before [samples]
PROBE = 1e-3  # share of a rate's typical size that is added to see how the residual changes

LEAST = 1e-6  # nats, of a simulation without an error: what rounding leaves is none
NEGLIGIBLE = (
    1e-6  # of the largest singular value: directions that are the same to the accuracy of a difference
)


@dataclass(frozen=True)
class LackOfFit:
    """The functions that explain most: of which rate, of which inputs; nats on all windows, corrected p-value.

    significant: whether chance cannot have done it. memory: [s] the time constant of the average over what was
    commanded before, which is an input, too.
    """

    rate: str
    on: tuple[str, ...]
    nats: float
    p_value: float
    significant: bool
    memory: float | None = None


@dataclass(frozen=True)
class _Group:
    """Functions of the same inputs (I,) of one rate; knots: (I, K).

    memory: [samples] where the last input is the average of the other one, a command, over what was before.
    """

    rate: int
    inputs: tuple[int, ...]
    knots: FloatArray
    memory: float | None = None

    @property
    def size(self) -> int:
        """How many functions: a product of hats each."""
        return int(self.knots.shape[1] ** len(self.inputs))


@kept
def lack_of_fit(problem: Problem, at: Fit) -> LackOfFit | None:
    """The group of functions with the smallest p-value; None where there is nothing to look at.

    problem, at: the hypothesis fitted to these windows.
    """
    some, part, directions = looked_at(problem, at)
    more = len(problem.windows) / len(some.windows)
    single = _single(some)
    if not single:
        return None
    shared = (some, part, directions)
    found = _all_tested(*shared, single)
    double = _double(some, single, [nats for nats, _ in found])
    found += _all_tested(*shared, double)
    return _best(some, part, [*single, *double], found, more)


@kept
def looked_at(problem: Problem, at: Fit) -> tuple[Problem, Fit, Directions]:
    """The windows that are looked at, fewer where every step is dear, and what changes around the fit there."""
    settings = problem.run.settings
    most = settings.lack_of_fit.windows if closed(problem.simulator) is None else SCREENING_WINDOWS_OF_A_ROBOT
    some, part = on_some_windows(problem, at, most)
    return some, part, Directions(some, part)


def lack_of_memory(problem: Problem, at: Fit) -> LackOfFit | None:
    """The same of laws that depend on a command and on what it was before.

    Of what is commanded nobody doubts the past; that of a state is known through noise that the residual has, too.
    """
    some, part, directions = looked_at(problem, at)
    groups = _remembering(some)
    if not groups:
        return None
    found = _all_tested(some, part, directions, groups)
    return _best(some, part, groups, found, len(problem.windows) / len(some.windows))


def _best(
    problem: Problem, at: Fit, groups: Sequence[_Group], found: Sequence[tuple[float, int]], more: float
) -> LackOfFit:
    """The group with the smallest p-value of those that explain so many nats with so many functions.

    more: times as many windows there are.
    """
    names = problem.simulator.state.names + problem.simulator.action.names
    own, clock = _numerical(problem, at), float(np.median(np.diff(problem.windows.t, axis=1)))
    chances = [_chance(nats, freedom, own, len(groups)) for nats, freedom in found]
    best = min(range(len(groups)), key=lambda i: (chances[i], -found[i][0]))
    group, rate = groups[best], problem.simulator.rate.names[groups[best].rate]
    memory = None if group.memory is None else group.memory * clock
    on = tuple(names[i] for i in (group.inputs if memory is None else group.inputs[:1]))
    significant = chances[best] < problem.run.settings.lack_of_fit.significance
    return LackOfFit(rate, on, found[best][0] * more, chances[best], significant, memory)


def _chance(nats: float, freedom: int, own: float, groups: int) -> float:
    """How probable it is that one of so many groups explains so many nats, `own` of which are numerical error."""
    if nats <= own or not freedom:  # more likely than not, and far below SciPy's function overflows
        return 1.0
    return min(1.0, groups * beyond(2 * nats, freedom, 2 * own))


def _all_tested(
    problem: Problem, at: Fit, directions: Directions, groups: Sequence[_Group]
) -> list[tuple[float, int]]:
    """Of each group the nats that it explains, and with how many functions that differ.

    Each function is a sum of pushes: what pushes on a rate do is simulated once.
    """
    rest, states = directions.rest.ravel(), visited(problem, at)
    inputs = inputs_of(problem, states[:, :-1], problem.windows.actions)
    answers = pushed(problem, at, directions, {group.rate for group in groups})
    return [
        _explained(
            directions.projected(_summed(problem, g, inputs, answers[g.rate])).reshape(g.size, -1), rest
        )
        for g in groups
    ]


def pushed(
    problem: Problem, at: Fit, directions: Directions, rates: Collection[int]
) -> dict[int, FloatArray]:
    """(L, W, M) of each rate: what pushes on it answer; what is known already is not asked again."""
    new = sorted(set(rates) - directions.pushed.keys())
    calls = [(problem, at, directions, r, _probe(problem, r)) for r in new]
    directions.pushed.update(zip(new, problem.run.side_by_side(impulses, calls), strict=True))
    return directions.pushed


def _summed(problem: Problem, group: _Group, inputs: FloatArray, answers: FloatArray) -> FloatArray:
    """(F, W, M): what each function of a group takes off, from inputs (W, L, I) and answers (L, W, M) to pushes."""
    columns = [inputs[:, :, i] for i in group.inputs]
    if group.memory is not None:
        columns[1] = average_of(problem, group.inputs[1] - len(problem.simulator.state), group.memory)
    which = np.arange(group.size)[:, None, None]
    places = np.unravel_index(which, (group.knots.shape[1],) * len(group.inputs))
    value = np.ones((group.size, *columns[0].shape))
    for column, knots, place in zip(columns, group.knots, places, strict=True):
        value *= hat(column[None], knots, place)
    return np.asarray(np.einsum("fwl,lwm->fwm", value, answers, optimize=True))


def _numerical(problem: Problem, at: Fit) -> float:
    """Nats that the simulation's own error may take up, or a little where there is none."""
    if at.hypothesis.scheme != "fine":
        return LEAST
    error = numerical_error(problem, at)
    nats = problem.counts * error**2 / at.variance
    return LEAST + 0.5 * float(nats[problem.observed].sum())


def _single(problem: Problem) -> list[_Group]:
    """Every rate as a function of every input that moves."""
    flat, knots = _visited(problem), KNOTS_OF_ONE
    moving = [i for i in range(flat.shape[1]) if np.ptp(flat[:, i]) > 0]
    rates = range(len(problem.simulator.rate))
    return [_group(flat, rate, (i,), knots) for rate in rates for i in moving]


def _double(problem: Problem, single: Sequence[_Group], nats: Sequence[float]) -> list[_Group]:
    """Every rate as a function of every two inputs; of many inputs those that explain most of it alone."""
    flat, settings, out = _visited(problem), problem.run.settings.lack_of_fit, []
    for rate in range(len(problem.simulator.rate)):
        of_rate = [(n, group.inputs[0]) for group, n in zip(single, nats, strict=True) if group.rate == rate]
        most = sorted(of_rate, key=lambda one: -one[0])[: settings.paired_inputs]
        chosen = combinations(sorted(i for _, i in most), 2)
        out += [_group(flat, rate, inputs, KNOTS_OF_TWO) for inputs in chosen]
    return out


def _remembering(problem: Problem) -> list[_Group]:
    """Every rate as a function of each command that moves and of each average of what it was before."""
    flat, first = _visited(problem), len(problem.simulator.state)
    out = []
    for i in range(first, first + len(problem.simulator.action)):
        for memory in COMMAND_MEMORIES:
            past = average_of(problem, i - first, memory)[problem.windows.valid[:, 1:]]
            both = np.stack([flat[:, i], past], axis=1)
            if (np.ptp(both, axis=0) > 0).all():
                shares = np.linspace(0, 1, KNOTS_OF_TWO)
                places = [np.quantile(values, shares) for values in both.T]
                rates = range(len(problem.simulator.rate))
                out += [_Group(rate, (i, i), np.array(places), memory) for rate in rates]
    return out


def average_of(problem: Problem, action: int, memory: float) -> FloatArray:
    """(W, L) the average of a command over what was before each transition, weights exp(-age / memory [samples])."""
    windows = problem.windows
    given = np.concatenate([windows.before_actions, windows.actions], axis=1)[:, :, action]
    keeps, average = np.exp(-1.0 / memory), given[:, 0]
    out = np.empty_like(given)
    for k in range(given.shape[1]):
        out[:, k] = average
        average = keeps * average + (1.0 - keeps) * given[:, k]
    return np.asarray(out[:, windows.before_actions.shape[1] :])


def _group(flat: FloatArray, rate: int, inputs: tuple[int, ...], knots: int) -> _Group:
    places = [np.quantile(flat[:, i], np.linspace(0, 1, knots)) for i in inputs]
    return _Group(rate, inputs, np.array(places))


def _visited(problem: Problem) -> FloatArray:
    """(N, S + A) all inputs that the windows hold."""
    inputs = inputs_of(problem, problem.windows.measured[:, :-1], problem.windows.actions)
    return np.asarray(inputs[problem.windows.valid[:, 1:]])


def inputs_of(problem: Problem, states: FloatArray, actions: FloatArray) -> FloatArray:
    """(..., S + A) state and command; angles between -pi and pi."""
    channels = problem.simulator.state
    return np.concatenate([difference(states, np.zeros_like(states), channels), actions], axis=-1)


def _probe(problem: Problem, rate: int) -> float:
    """How much is added to a rate, to see how the residual changes."""
    usual = float(np.abs(_rates(problem)[:, rate]).mean())
    return PROBE * max(usual, 1e-9)


def _rates(problem: Problem) -> FloatArray:
    """(W, R) the simulator's rates at the windows' starts."""
    windows = problem.windows
    return problem.simulator.rates(windows.measured[:, 0], windows.actions[:, 0], problem.parameters)


def hat(x: FloatArray, knots: FloatArray, place: IntArray) -> FloatArray:
    """1 at a row's own knot, falling to 0 at its neighbours, constant beyond the outer knots."""
    inside = np.clip(x, knots[0], knots[-1])
    middle = knots[place]
    left, right = knots[np.maximum(place - 1, 0)], knots[np.minimum(place + 1, len(knots) - 1)]
    rising = np.where(middle > left, (inside - left) / np.where(middle > left, middle - left, 1.0), 1.0)
    falling = np.where(right > middle, (right - inside) / np.where(right > middle, right - middle, 1.0), 1.0)
    return np.asarray(np.clip(np.minimum(rising, falling), 0.0, 1.0))


def _explained(changes: FloatArray, rest: FloatArray) -> tuple[float, int]:
    """Nats that the best combination of the directions (F, N) takes off, and how many of them differ."""
    size = np.sqrt((changes**2).sum(axis=1))
    moving: Sequence[int] = np.flatnonzero(size > 1e-9 * size.max(initial=1e-300)).tolist()
    if not moving:
        return 0.0, 0
    basis, values, _ = np.linalg.svd((changes[moving] / size[moving, None]).T, full_matrices=False)
    basis = basis[:, values > NEGLIGIBLE * values[0]]
    return 0.5 * float(((basis.T @ rest) ** 2).sum()), basis.shape[1]
