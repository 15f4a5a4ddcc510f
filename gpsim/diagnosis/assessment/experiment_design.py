"""What to record next: the excitation under which the rivals' predictions differ most, in units of the noise."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.judgement import Judgement
from gpsim.diagnosis.settings import ExperimentDesignSettings
from gpsim.effects import PRE_ROLL

AFTERWARDS = 2**31  # number of an episode that comes after all others, no threshold


def tell_apart(problem: Problem, judgement: Judgement) -> str | None:
    """One sentence, or None when nothing has to be told apart."""
    if judgement.verdict != "ambiguous":
        return None
    hypotheses = [judgement.leader.hypothesis, *(f.hypothesis for f in judgement.rivals)]
    names, actions = _excitations(problem)
    windows = _windows(problem, actions, _latest(hypotheses))
    said = [_said(problem, windows, h) for h in hypotheses]
    noise = np.maximum(judgement.noise, 1e-300)
    pairs = list(combinations(range(len(said)), 2))
    gaps = np.array([_apart(problem, said[a], said[b], noise) for a, b in pairs])  # (pairs, E, S)
    spoken = [_spoken(h) for h in hypotheses]
    return "; ".join(_advice(problem, names, pairs, gaps, spoken))


def _advice(
    problem: Problem, names: list[str], pairs: list[tuple[int, int]], gaps: FloatArray, spoken: list[str]
) -> list[str]:
    """The fewest recordings that separate every pair which any of them separates, then the pairs that none does."""
    visible = problem.run.settings.experiment_design.visible
    reach, left, out = gaps.max(axis=2), list(range(len(pairs))), []
    while left and reach[left].max() >= visible:
        seen = reach[left] >= visible
        best = max(
            range(len(names)),
            key=lambda e: (seen[:, e].sum(), reach[left, e][seen[:, e]].min(initial=np.inf)),
        )
        told = [p for p in left if reach[p, best] >= visible]
        weakest = min(told, key=lambda p: reach[p, best])
        channel = problem.simulator.state.names[int(np.argmax(gaps[weakest, best]))]
        who = " and ".join(spoken[i] for i in sorted({i for p in told for i in pairs[p]}))
        out.append(
            f"record {names[best]}: {who} then differ by up to {reach[weakest, best]:.1f} standard deviations of the "
            f"noise in {channel}"
        )
        left = [p for p in left if p not in told]
    if left:
        who = ", ".join(" and ".join(spoken[i] for i in pairs[p]) for p in left)
        out.append(
            f"{who} predict the same for every excitation that was tried: no recording of these channels separates "
            "them; measure one of the quantities itself (weigh it, or measure the force or the command that acts)"
        )
    return out


def _excitations(problem: Problem) -> tuple[list[str], FloatArray]:
    """Names, and actions (E, L, A): steps, slow and fast waves and random levels of every action."""
    settings = problem.run.settings.experiment_design
    steps = int(np.clip(settings.seconds / problem.dt, settings.fewest, settings.most))
    t = problem.dt * np.arange(steps)
    span = _amplitudes(problem.windows, settings)
    offset = np.median(problem.windows.actions, axis=(0, 1))
    rng, held = np.random.default_rng(0), settings.held
    shapes = {
        "a constant {a} of {v:.3g}": np.ones(steps),
        "a constant {a} of -{v:.3g}": -np.ones(steps),
        "a slow wave of {a} with amplitude {v:.3g}": np.sin(2 * np.pi * t / t[-1]),
        "a fast wave of {a} with amplitude {v:.3g}": np.sin(
            2 * np.pi * t / (settings.fast_period * problem.dt)
        ),
        "random levels of {a} up to {v:.3g}": np.repeat(rng.uniform(-1, 1, steps // held + 1), held)[:steps],
    }
    names, out = [], []
    for i, action in enumerate(problem.simulator.action.names):
        for level in settings.levels:
            for text, shape in shapes.items():
                names.append(text.format(a=action, v=level * span[i]))
                actions = np.tile(offset, (steps, 1))
                actions[:, i] = level * span[i] * shape
                out.append(actions)
    return names, np.stack(out)


def _amplitudes(windows: Windows, settings: ExperimentDesignSettings) -> FloatArray:
    """(A,) the size of each action's large commands; where it rests most of the time, of those that it was given."""
    sizes = np.abs(windows.actions).reshape(-1, windows.actions.shape[2])
    usual, largest = np.quantile(sizes, settings.large, axis=0), sizes.max(axis=0)
    given = [
        np.quantile(column[column > settings.rests * most], settings.large) if most > 0.0 else 0.0
        for column, most in zip(sizes.T, largest, strict=True)
    ]
    return np.asarray(np.where(usual > settings.rests * largest, usual, given))


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


def _said(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    starts = windows.measured[None, :, 0]
    return np.asarray(problem.simulated(chain, windows, starts, hypothesis.spread, hypothesis.theta[None])[0])


def _apart(problem: Problem, first: FloatArray, second: FloatArray, noise: FloatArray) -> FloatArray:
    """(E, S) largest difference within the run, less its start (a start state can hide that), in noise units."""
    gap = np.abs((first - first[:, :1]) - (second - second[:, :1])) / noise
    return np.asarray(np.where(problem.observed, gap.max(axis=1), 0.0))


def _spoken(hypothesis: Hypothesis) -> str:
    return " with ".join(f"{t.family} on {t.on}" for t in hypothesis.terms)
