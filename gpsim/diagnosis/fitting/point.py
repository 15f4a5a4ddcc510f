"""Where a fit stands."""

from __future__ import annotations

from dataclasses import dataclass

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting.problem import Problem, objective


@dataclass(frozen=True)
class Point:
    """Where a fit stands: theta (P,), starts (W, S), residual (W, L + 1, S) and the objective there.

    anchored: (W, L + 1, S) the residual from the measured start states with this theta, where it is known.
    """

    theta: FloatArray
    starts: FloatArray
    residual: FloatArray
    value: float
    anchored: FloatArray | None = None


def point_at(
    problem: Problem,
    theta: FloatArray,
    starts: FloatArray,
    residual: FloatArray,
    anchored: FloatArray | None = None,
) -> Point:
    """The point with its objective."""
    return Point(theta, starts, residual, objective(problem, residual), anchored)
