"""What held-out windows say of a hypothesis that was fitted on others."""

from __future__ import annotations

from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit
from gpsim.diagnosis.settings import schedules


def held_out_objective(problem: Problem, hypothesis: Hypothesis) -> float:
    """Negative log likelihood of windows whose start states alone are fitted; 0 where there are none."""
    if not len(problem.windows):
        return 0.0
    return held_out_fit(problem, hypothesis).objective


def held_out_fit(problem: Problem, hypothesis: Hypothesis) -> Fit:
    """The hypothesis as it is on windows whose start states alone are fitted."""
    steps = schedules.SETTLE
    return fit(problem, hypothesis.frozen(), problem.windows.measured[:, 0], iterations=steps)
