"""What a hypothesis says: from measured starts, on one transition or over many, and from the starts of a fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import Fit
from gpsim.diagnosis.simulate import Extra, simulate
from gpsim.diagnosis.windows import Windows

FIXED_POINT_ROUNDS = 20  # at most
SETTLED = 1e-9  # of a channel's scale


def predicted(
    problem: Problem, windows: Windows, hypothesis: Hypothesis, extra: Extra | None = None
) -> FloatArray:
    """(W, L + 1, S) what the sensors would say, from the measured start; `extra` rates are added."""
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    starts = _starts(problem, windows, hypothesis)[None]
    theta = hypothesis.theta[None]
    said = simulate(chain, windows, starts, hypothesis.spread, theta, problem.substeps, extra)
    return np.asarray(said[0])


def traced(problem: Problem, found: Fit) -> FloatArray:
    """(W, L + 1, S) what the sensors would say in the windows of a fit, from its start states."""
    hypothesis = found.hypothesis
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    starts, theta = found.starts[None], hypothesis.theta[None]
    return np.asarray(simulate(chain, problem.windows, starts, hypothesis.spread, theta, problem.substeps)[0])


def _starts(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    """(W, S) true states whose measurement is what was measured, by a fixed point."""
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    measured = windows.measured[:, 0]
    first = replace(
        windows,
        measured=windows.measured[:, :2],
        actions=windows.actions[:, :1],
        t=windows.t[:, :2],
        valid=windows.valid[:, :2],
    )
    state, theta = measured, hypothesis.theta[None]
    for _ in range(FIXED_POINT_ROUNDS if any(t.effect.site == "sensor" for t in hypothesis.terms) else 0):
        said = simulate(chain, first, state[None], hypothesis.spread, theta, problem.substeps)[0, :, 0]
        change = difference(measured, said, problem.simulator.state)
        state = state + change
        if (np.abs(change) < SETTLED * problem.scale).all():
            break
    return state
