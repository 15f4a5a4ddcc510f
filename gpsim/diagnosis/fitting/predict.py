"""What a hypothesis says: from measured starts, on one transition or over many, and from the starts of a fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.problem import Problem
from gpsim.diagnosis.fitting.rollout import Extra
from gpsim.diagnosis.fitting.shooting import Fit

INVERSION_ITERATIONS = 20  # Newton's steps at most
INVERSION_SETTLED = 1e-9  # of a channel's typical size: a step that small is the last
INVERSION_NUDGE = 1e-3
"""Of a channel's typical size: how far a state is moved to see what its sensor makes of it."""
LEAST_SENSOR_GAIN = 0.01  # a sensor that answers less is taken for one that reads the truth
MOST_SENSOR_GAIN = 100.0  # a sensor that answers more is, too


def predicted(
    problem: Problem, windows: Windows, hypothesis: Hypothesis, extra: Extra | None = None
) -> FloatArray:
    """(W, L + 1, S) what the sensors would say, from the measured start; `extra` rates are added."""
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    starts = true_starts(problem, windows, hypothesis)[None]
    theta = hypothesis.theta[None]
    said = problem.simulated(chain, windows, starts, hypothesis.spread, theta, extra)
    return np.asarray(said[0])


def traced(problem: Problem, found: Fit) -> FloatArray:
    """(W, L + 1, S) what the sensors would say in the windows of a fit, from its start states."""
    hypothesis = found.hypothesis
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    starts, theta = found.starts[None], hypothesis.theta[None]
    return np.asarray(problem.simulated(chain, problem.windows, starts, hypothesis.spread, theta)[0])


def has_sensors(hypothesis: Hypothesis) -> bool:
    """Whether it says that a sensor reads something else than the true state."""
    return any(term.effect.site == "sensor" for term in hypothesis.terms)


def without_sensors(hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis about what happened, whatever the sensors said of it."""
    for index in reversed(range(len(hypothesis.terms))):
        if hypothesis.terms[index].effect.site == "sensor":
            hypothesis = hypothesis.without(index)
    return hypothesis


def as_it_was(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> Windows:
    """Single transitions with the true states at both ends, as far as the hypothesis's sensors tell, for measured ones.

    Of a late sensor's first readings in an episode it takes the second to be one of a motion that went on before.
    """
    ends = [true_starts(problem, part, hypothesis) for part in (windows, _next(windows))]
    return replace(windows, measured=np.stack(ends, axis=1))


def _next(windows: Windows) -> Windows:
    """Single transitions that begin where those of `windows` end; what happens in them nobody knows."""
    t = windows.t[:, 1:]

    def later(before: FloatArray, now: FloatArray) -> FloatArray:
        return np.concatenate([before[:, 1:], now], axis=1)

    return replace(
        windows,
        measured=np.repeat(windows.measured[:, 1:], 2, axis=1),
        t=np.concatenate([t, t + np.diff(windows.t, axis=1)], axis=1),
        before_states=later(windows.before_states, windows.measured[:, :1]),
        before_actions=later(windows.before_actions, windows.actions),
        before_t=later(windows.before_t, t),
        fresh=np.zeros_like(windows.fresh),
    )


def true_starts(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    """(W, S) true states whose measurement is what was measured: Newton's steps with each sensor's own gain."""
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    measured = windows.measured[:, 0]
    first = replace(
        windows,
        measured=windows.measured[:, :2],
        actions=windows.actions[:, :1],
        t=windows.t[:, :2],
        valid=windows.valid[:, :2],
    )
    if not has_sensors(hypothesis):
        return measured

    def said(state: FloatArray) -> FloatArray:
        theta = hypothesis.theta[None]
        return np.asarray(problem.simulated(chain, first, state[None], hypothesis.spread, theta)[0, :, 0])

    state, gains = measured, _gains(problem, measured, said)
    for _ in range(INVERSION_ITERATIONS):
        change = difference(measured, said(state), problem.simulator.state) / gains
        state = state + change
        if (np.abs(change) < INVERSION_SETTLED * problem.scale).all():
            break
    return state


def _gains(problem: Problem, state: FloatArray, said: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """(W, S) how much more each channel reads where its state is more."""
    channels, before = problem.simulator.state, said(state)
    gains = np.ones_like(state)
    for i, nudge in enumerate(INVERSION_NUDGE * problem.scale):
        moved = np.array(state)
        moved[:, i] += nudge
        gains[:, i] = difference(said(moved), before, channels)[:, i] / nudge
    answers = (gains > LEAST_SENSOR_GAIN) & (gains < MOST_SENSOR_GAIN)
    return np.where(answers, gains, 1.0)
