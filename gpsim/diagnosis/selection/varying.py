"""Whether a law is as strong as it says wherever it acts, and a memory the one that it says.

A law that leads because it is nearest gives itself away: it would have to be stronger here than there, along something
that it does not know of. So its strength is made a free function of every channel, of time and of what was commanded
lately, one at a time. A law that remembers its command stands beside a linear filter of free impulse response. What
such a function takes off the residual is a sum of pushes (see `impulses`), so nothing is simulated anew. Blocks of
windows, each left out once, say how much of that is there, and how far the strength varies.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Directions, Fit, Hypothesis, Problem, without_sensors
from gpsim.diagnosis.selection.impulses import visited
from gpsim.diagnosis.selection.lack_of_fit import (
    COMMAND_MEMORIES,
    average_of,
    hat,
    inputs_of,
    looked_at,
    pushed,
)
from gpsim.effects import ActuatorEffect

VARIES = 0.1
"""Of a law's strength, in root mean square over where it acts: what it surely varies by at the least.

A roboticist's tenth. Friction that fades with heat varies by 0.12, laws that are right by 0.002.
"""
SHARE = 0.02  # of all that is left, on squares, noise too, that a free strength takes off windows it was not fitted to
NATS = 20.0  # that it takes off these windows; of right laws of tuning seeds 0.2 at the most
KNOTS = 5  # of a strength along an input, at quantiles
RESPONSE = 12  # transitions of the free impulse response, the present one besides: as late as delays may be
BLOCKS = 8  # of neighbouring windows, each left out once
RIDGE = 1e-3  # of what the data say of a function's values: directions that nothing determines stand still
TINY = 1e-300  # guards a division by inputs that stand still
CLOCK, ELAPSED, FILTER = "time", "time in the episode", "what was commanded before"


@dataclass(frozen=True)
class Varying:
    """A law's strength as a free function. of: the term's index; along: its input; at, times: (K,) strength at knots.

    nats: what it takes off on windows that it did not see; share: the same, of all that is left; size: how far the
    strength varies, in root mean square over where the law acts, as a part of it. A filter has no knots.
    """

    of: int
    along: str
    nats: float
    share: float
    size: float
    at: tuple[float, ...] = ()
    times: tuple[float, ...] = ()


@dataclass(frozen=True)
class _Free:
    """(K, W, L, R) rates that K free values add; along: what they are functions of; knots: (K,) where they stand."""

    along: str
    adds: FloatArray
    knots: FloatArray | None = None


def varying(problem: Problem, leader: Fit, terms: Sequence[int]) -> dict[int, Varying]:
    """Of each of the leader's terms what its strength surely varies with most; those that hold are left out.

    Of sensors nothing is said: what they read is no rate.
    """
    asked = [i for i in terms if leader.hypothesis.terms[i].effect.site != "sensor"]
    if not asked:
        return {}
    some, part, directions = looked_at(problem, leader)
    count = len(some.simulator.rate)
    answers = pushed(some, part, directions, range(count))
    push = np.stack([answers[r] for r in range(count)], axis=1)
    states, out = visited(some, part), {}
    for i in asked:
        own = _adds(some, leader.hypothesis, states, i)
        found = [
            _judged(some, directions, push, own, i, free) for free in _free(some, leader, states, i, own)
        ]
        best = max((v for v in found if v is not None), key=lambda v: v.nats, default=None)
        if best is not None:
            out[i] = best
    return out


def _free(problem: Problem, leader: Fit, states: FloatArray, index: int, own: FloatArray) -> Iterator[_Free]:
    """All that a term's strength may be a function of, and the filter in the place of one that remembers."""
    valid = problem.windows.valid[:, 1:]
    for along, x in _inputs(problem, states).items():
        knots = np.unique(np.quantile(x[valid], np.linspace(0.0, 1.0, KNOTS)))
        if len(knots) > 1:
            hats = np.stack([hat(x, knots, np.array(k)) for k in range(len(knots))])
            yield _Free(along, hats[..., None] * own, knots)
    term = leader.hypothesis.terms[index]
    if isinstance(term.effect, ActuatorEffect) and _remembers(problem, leader.hypothesis, index):
        yield _Free(FILTER, _filtered(problem, states, problem.simulator.action.index(term.on)))


def _inputs(problem: Problem, states: FloatArray) -> Mapping[str, FloatArray]:
    """(W, L) each: channels, time on the recording's clock and since the window's episode began, commands' averages."""
    windows = problem.windows
    flat = inputs_of(problem, states[:, :-1], windows.actions)
    names = problem.simulator.state.names + problem.simulator.action.names
    out = {name: flat[..., i] for i, name in enumerate(names)}
    clock = windows.t[:, :-1]
    began = {e: windows.t[windows.episode == e, 0].min() for e in np.unique(windows.episode)}
    out |= {CLOCK: clock, ELAPSED: clock - np.array([began[e] for e in windows.episode])[:, None]}
    for i, name in enumerate(problem.simulator.action.names):
        for memory in COMMAND_MEMORIES:
            out[f"{name} of the last {memory:g} samples"] = average_of(problem, i, memory)
    return out


def _remembers(problem: Problem, hypothesis: Hypothesis, index: int) -> bool:
    """Whether a term needs to know what was before."""
    alone = replace(hypothesis, terms=(hypothesis.terms[index],), declared=(hypothesis.declared[index],))
    chain = alone.chain(problem.simulator, problem.parameters, problem.dt)
    return chain.actuation.remembers(alone.spread(alone.theta[None], 1)) > 0.0


def _filtered(problem: Problem, states: FloatArray, action: int) -> FloatArray:
    """(K, W, L, R): what a command and each of the last ones adds to the rates, in the place of the command itself."""
    windows, simulator = problem.windows, problem.simulator
    given = np.concatenate([windows.before_actions, windows.actions], axis=1)[..., action]
    size = max(float(np.sqrt(np.mean(given**2))), TINY)
    shape = states[:, :-1].shape[:2]
    state, command = states[:, :-1].reshape(-1, states.shape[-1]), windows.actions.reshape(np.prod(shape), -1)
    more = np.array(command)
    more[:, action] += size
    by = simulator.rates(state, more, problem.parameters) - simulator.rates(
        state, command, problem.parameters
    )
    length, begin = shape[1], windows.before_actions.shape[1]
    lags = range(min(RESPONSE, begin) + 1)
    past = np.stack([given[:, begin - k : begin - k + length] for k in lags])
    return np.asarray(past[..., None] / size * by.reshape(*shape, -1))


def _judged(
    problem: Problem, directions: Directions, push: FloatArray, own: FloatArray, index: int, free: _Free
) -> Varying | None:
    """A free function of a term by what it says of windows that it was not fitted to; None where it is not sure."""
    valid = problem.windows.valid[:, 1:, None]
    changes = directions.projected(np.einsum("kwlr,lrwm->kwm", free.adds * valid, push, optimize=True))
    blocks = np.array_split(np.arange(changes.shape[1]), BLOCKS)
    parts = [changes[:, b].reshape(len(changes), -1) for b in blocks]
    told = np.array([x @ x.T for x in parts])
    pull = np.array([x @ directions.rest[b].ravel() for x, b in zip(parts, blocks, strict=True)])
    ridge = RIDGE * np.trace(told.sum(0)) / len(changes) * np.eye(len(changes)) + TINY * np.eye(len(changes))
    every = [
        np.linalg.solve(told.sum(0) - t + ridge, pull.sum(0) - g) for t, g in zip(told, pull, strict=True)
    ]
    gained = [x @ g - 0.5 * x @ t @ x for x, t, g in zip(every, told, pull, strict=True)]
    nats, left = float(np.sum(gained)), 0.5 * float(np.sum(directions.rest**2))
    values = np.linalg.solve(told.sum(0) + ridge, pull.sum(0))
    sizes = [_size(problem, free, v, own) for v in (values, *every)]
    size = sizes[0] - 2.0 * float(np.std(sizes[1:])) * np.sqrt(len(every) - 1)
    found = Varying(index, free.along, nats, nats / max(left, TINY), size)
    if nats < NATS or found.share < SHARE or size < VARIES:
        return None
    if free.knots is None:
        return found
    return replace(found, at=tuple(map(float, free.knots)), times=tuple(float(1.0 + v) for v in values))


def _size(problem: Problem, free: _Free, values: FloatArray, own: FloatArray) -> float:
    """Root mean square of what the function adds besides more of the law, in parts of what the law adds."""
    valid = problem.windows.valid[:, 1:]
    adds, law = np.tensordot(values, free.adds, axes=1)[valid], own[valid]
    scale = np.maximum(np.sqrt(np.mean(law**2, axis=0)), TINY)
    acts = scale > 1e-9 * scale.max()
    adds, law = (adds / scale)[:, acts], (law / scale)[:, acts]
    whole = max(float(np.sum(law**2)), TINY)
    rest = adds - law * (float(np.sum(adds * law)) / whole)
    return float(np.sqrt(np.sum(rest**2) / whole))


def _adds(problem: Problem, hypothesis: Hypothesis, states: FloatArray, index: int) -> FloatArray:
    """(W, L, R) what a term adds to the rates in every transition, each from where the explanation says it began."""
    single, windows = _transitions(problem.windows, states), problem.windows

    def ends(said: Hypothesis) -> FloatArray:
        body = without_sensors(said)
        chain = body.chain(problem.simulator, problem.parameters, problem.dt)
        starts = single.measured[None, :, 0]
        return np.asarray(problem.simulated(chain, single, starts, body.spread, body.theta[None])[0][:, 1])

    dt = np.diff(single.t, axis=1)[:, 0]
    both = (ends(hypothesis), ends(hypothesis.without(index)))
    with_it, less = (problem.simulator.measured_rates(single.measured[:, 0], end, dt) for end in both)
    return np.asarray((with_it - less).reshape(windows.length, len(windows), -1).transpose(1, 0, 2))


def _transitions(windows: Windows, states: FloatArray) -> Windows:
    """Every transition of windows that visit `states` (W, L + 1, S) as a window, those of all windows in turn."""
    length, past = windows.length, windows.before_actions.shape[1]
    actions = np.concatenate([windows.before_actions, windows.actions], axis=1)
    before = np.concatenate([windows.before_states, states[:, :-1]], axis=1)
    clock = np.concatenate([windows.before_t, windows.t[:, 1:]], axis=1)

    def in_turn(values: FloatArray, width: int) -> FloatArray:
        return np.concatenate([values[:, k : k + width] for k in range(length)])

    later = np.zeros((length - 1) * len(windows), dtype=np.bool_)
    return Windows(
        measured=in_turn(states, 2),
        actions=in_turn(windows.actions, 1),
        t=in_turn(windows.t, 2),
        valid=np.ones((length * len(windows), 2), dtype=np.bool_),
        before_states=in_turn(before, past),
        before_actions=in_turn(actions, past),
        before_t=in_turn(clock, past + 1),
        episode=np.tile(windows.episode, length),
        fresh=np.concatenate([windows.fresh, later]),
        lost=None if windows.lost is None else np.concatenate([windows.lost, later]),
        source=None if windows.source is None else np.tile(windows.source, length),
    )
