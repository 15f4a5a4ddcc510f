"""What to record next: the excitation under which the rivals' predictions differ most, in units of the noise."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Hypothesis, Problem, predicted
from gpsim.diagnosis.judging import Judgement
from gpsim.effects import PRE_ROLL
from gpsim.findings import Discrimination, Excitation, Separation, Shape

FEWEST_STEPS = 20  # transitions of one at least
MOST_STEPS = 150  # transitions of one at most
COMMAND_LEVELS = (0.25, 1.0, 1.5)  # of an action's large commands, that are tried
LARGE_QUANTILE = 0.95  # quantile of an action's sizes that is a large command
AT_REST = 0.01  # of an action's largest command: where the large one is less, those at rest do not count
FAST_PERIOD = 10  # of the fast wave [control steps]
STEPS_HELD = 5  # for which a random level is held [control steps]
SECONDS = 3.0  # of an excitation
VISIBLE = 1.0  # of the noise: a smaller difference nobody could see [standard deviations]

AFTERWARDS = 2**31  # number of an episode that comes after all others, no threshold


def design_experiment(problem: Problem, judgement: Judgement) -> Discrimination | None:
    """The fewest recordings that separate every pair of rivals which any of them separates, and the other pairs.

    None when nothing has to be told apart.
    """
    if not judgement.rivals:
        return None
    hypotheses = [judgement.leader.hypothesis, *(f.hypothesis for f in judgement.rivals)]
    if not _amplitudes(problem.windows).any():
        return None  # of what was never commanded nobody knows how large it may be
    excitations, actions = _excitations(problem)
    windows, noise = _windows(problem, actions, _latest(hypotheses)), np.maximum(judgement.noise, 1e-300)
    moves = [_moves(problem, windows, h) for h in hypotheses]
    pairs = list(combinations(range(len(moves)), 2))
    claims = [tuple((t.family, t.on) for t in h.terms) for h in hypotheses]
    gaps = np.array([np.abs(moves[a] - moves[b]).max(axis=1) for a, b in pairs])  # (pairs, E, S)
    gaps = np.where(problem.observed, gaps / noise, 0.0)
    reach, left, recordings = gaps.max(axis=2), list(range(len(pairs))), []
    while left and reach[left].max() >= VISIBLE:
        seen = reach[left] >= VISIBLE
        best = max(
            range(len(excitations)),
            key=lambda e: (seen[:, e].sum(), reach[left, e][seen[:, e]].min(initial=np.inf)),
        )
        told = [p for p in left if reach[p, best] >= VISIBLE]
        weakest = min(told, key=lambda p: reach[p, best])
        channel = problem.simulator.state.names[int(np.argmax(gaps[weakest, best]))]
        who = tuple(claims[i] for i in sorted({i for p in told for i in pairs[p]}))
        recordings.append(Separation(excitations[best], who, channel, float(reach[weakest, best])))
        left = [p for p in left if p not in told]
    inseparable = tuple((claims[first], claims[second]) for first, second in (pairs[p] for p in left))
    return Discrimination(tuple(recordings), inseparable)


def _excitations(problem: Problem) -> tuple[list[Excitation], FloatArray]:
    """What they are, and actions (E, L, A): steps, slow and fast waves and random levels of every action."""
    steps = int(np.clip(SECONDS / problem.dt, FEWEST_STEPS, MOST_STEPS))
    t = problem.dt * np.arange(steps)
    span = _amplitudes(problem.windows)
    offset = np.median(problem.windows.actions, axis=(0, 1))
    rng, held = np.random.default_rng(0), STEPS_HELD
    shapes: list[tuple[Shape, float, FloatArray]] = [  # sign of the size that is told, course
        ("constant", 1.0, np.ones(steps)),
        ("constant", -1.0, -np.ones(steps)),
        ("slow wave", 1.0, np.sin(2 * np.pi * t / t[-1])),
        ("fast wave", 1.0, np.sin(2 * np.pi * t / (FAST_PERIOD * problem.dt))),
        ("random levels", 1.0, np.repeat(rng.uniform(-1, 1, steps // held + 1), held)[:steps]),
    ]
    excitations, out = [], []
    for i, action in enumerate(problem.simulator.action.names):
        for level in COMMAND_LEVELS:
            for shape, sign, course in shapes:
                excitations.append(Excitation(action, shape, float(sign * level * span[i])))
                actions = np.tile(offset, (steps, 1))
                actions[:, i] = level * span[i] * course
                out.append(actions)
    return excitations, np.stack(out)


def _amplitudes(windows: Windows) -> FloatArray:
    """(A,) the size of each action's large commands; where it rests most of the time, of those that it was given."""
    sizes = np.abs(windows.actions).reshape(-1, windows.actions.shape[2])
    usual, largest = np.quantile(sizes, LARGE_QUANTILE, axis=0), sizes.max(axis=0)
    given = [
        np.quantile(column[column > AT_REST * most], LARGE_QUANTILE) if most > 0.0 else 0.0
        for column, most in zip(sizes.T, largest, strict=True)
    ]
    return np.asarray(np.where(usual > AT_REST * largest, usual, given))


def _latest(hypotheses: Sequence[Hypothesis]) -> float:
    """When everything has begun [s]: what is recorded next is recorded afterwards."""
    begun = (t.gate.since for h in hypotheses for t in h.terms if t.gate.since is not None)
    return max(begun, default=0.0)


def _windows(problem: Problem, actions: FloatArray, begin: float) -> Windows:
    """Windows that start at a typical state, at rest, at the time `begin`."""
    count, steps = actions.shape[:2]
    start = np.median(problem.windows.measured[:, 0], axis=0)
    for coordinate in problem.simulator.coordinates:
        start[problem.simulator.state.index(coordinate.velocity)] = 0.0
    t = begin + problem.dt * np.arange(-PRE_ROLL, steps + 1)
    return Windows(
        np.tile(start, (count, steps + 1, 1)),
        actions,
        np.tile(t[PRE_ROLL:], (count, 1)),
        np.ones((count, steps + 1), dtype=np.bool_),
        np.tile(start, (count, PRE_ROLL, 1)),
        np.zeros((count, PRE_ROLL, actions.shape[2])),
        np.tile(t[: PRE_ROLL + 1], (count, 1)),
        np.full(count, AFTERWARDS),
        np.ones(count, dtype=np.bool_),
    )


def _moves(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    """(E, L + 1, S) what is measured, less its start: a start state can hide a difference there."""
    said = predicted(problem, windows, hypothesis, starts=windows.measured[:, 0])
    return np.asarray(said - said[:, :1])
