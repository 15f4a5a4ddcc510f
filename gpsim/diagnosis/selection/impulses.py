"""Impulses: how the residual answers a push on one rate in one transition.

To first order whatever is added to a rate answers as the sum of its pushes, so that a few simulations a window tell
of thousands of functions what each of them simulated by itself would.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Directions, Fit, Problem, Pushes

FUNCTIONS_AT_ONCE = 24
"""Functions that are simulated in one batch (by hand, for the memory that a process takes)."""


def impulses(problem: Problem, at: Fit, directions: Directions, rate: int, push: float) -> FloatArray:
    """(L, W, M): what `push` on a rate throughout each transition takes off the residual, divided by it.

    In standard deviations of the observed channels, as directions are, with nothing projected out.
    """
    rough, length, count = problem.slopes, problem.windows.length, len(problem.windows)
    chain = at.hypothesis.chain(rough.simulator, rough.parameters, rough.dt)
    theta, spread = at.hypothesis.theta, at.hypothesis.spread
    at_once = FUNCTIONS_AT_ONCE
    rates, out = len(problem.simulator.rate), []
    for first in range(0, length, at_once):
        which = np.arange(first, min(first + at_once, length))
        starts, thetas = np.tile(at.starts, (len(which), 1, 1)), np.tile(theta, (len(which), 1))
        pushed = Pushes(np.repeat(which, count), rate, rates, push)
        said = rough.simulated(chain, rough.windows, starts, spread, thetas, pushed)
        residual = rough.simulator.gap(rough.windows.measured[None], said) * rough.root_weights
        out.append(directions.raw(residual))
    return np.concatenate(out) / push


def visited(problem: Problem, at: Fit) -> FloatArray:
    """(W, L + 1, S): the states that the hypothesis says were visited."""
    chain = at.hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    theta = at.hypothesis.theta[None]
    return np.asarray(
        problem.simulated(chain, problem.windows, at.starts[None], at.hypothesis.spread, theta)[0]
    )
