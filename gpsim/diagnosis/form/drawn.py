"""A fitted curve beside the laws that it stands in for, as the report draws it."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.form.groups import Group
from gpsim.diagnosis.form.penalised import BAND, Curved
from gpsim.diagnosis.form.visited import of_law, twists, visited
from gpsim.diagnosis.form.widened import Widened
from gpsim.diagnosis.report import Curve
from gpsim.diagnosis.selection import LackOfFit

DRAWN_POINTS = 41  # places at which a curve is drawn
BESIDE = 1e-6  # of the range: a jump at 0 is drawn from there to there
EDGE = 0.005  # of all samples on either side, beyond which nothing is drawn


def drawn(problem: Problem, hypothesis: Hypothesis, group: Group, curve: Widened, fitted: Curved) -> Curve:
    """The curve of a group over its own input, other inputs at their medians."""
    given: dict[str, float] = {}
    channel, input_unit = group.drawn_over(problem.simulator)
    if group.of == "twist":
        v, w = twists(problem).T
        given["v"] = float(np.median(v))
        x = _places(w, around_zero=False)
        own = [np.full(len(x), given["v"]), x]
    else:
        x = _places(visited(problem, channel), around_zero=group.of == "speed")
        own = [x]
    law = of_law(problem, hypothesis, group, tuple(own))
    if curve.further is not None:
        given[curve.further] = float(np.median(visited(problem, curve.further)))
        own = [np.full(len(x), given[curve.further]), *own]
    sign = -np.sign(x) if group.dry and group.of == "speed" else np.ones(len(x))
    quantity, unit = group.quantity(problem.simulator)
    free, band = _free(own, curve, fitted)
    return Curve(
        effects=group.claims(hypothesis),
        quantity=quantity,
        unit=unit,
        input=channel,
        input_unit=input_unit,
        at=_numbers(x),
        law=_numbers(law),
        given=given,
        **_with_band(law + sign * free, band),
    )


def drawn_missing(problem: Problem, lack: LackOfFit, curve: Widened, fitted: Curved) -> Curve:
    """The curve of what is missing over its first input, the other one at its median."""
    simulator = problem.simulator
    x = _places(visited(problem, lack.on[0]), around_zero=False)
    given, own = {}, [x]
    if curve.further is not None:
        given[curve.further] = float(np.median(visited(problem, curve.further)))
        own = [np.full(len(x), given[curve.further]), x]
    return Curve(
        effects=(),
        quantity=lack.rate,
        unit=simulator.rate.units[lack.rate],
        input=lack.on[0],
        input_unit=(simulator.state + simulator.action).units[lack.on[0]],
        at=_numbers(x),
        law=_numbers(np.zeros(len(x))),
        given=given,
        **_with_band(*_free(own, curve, fitted)),
    )


def _free(inputs: list[FloatArray], curve: Widened, fitted: Curved) -> tuple[FloatArray, FloatArray]:
    """(N,) each: what the curve adds to the laws, and half the width of its 90 % band."""
    design = curve.basis.design(inputs)
    variance = np.einsum("nf,fg,ng->n", design, fitted.covariance, design)
    return design @ fitted.theta[curve.free], BAND * np.sqrt(np.maximum(variance, 0.0))


def _with_band(free: FloatArray, band: FloatArray) -> dict[str, Any]:
    """The curve and both edges of its band, which are left out where nobody knows them."""
    edges = {"low": _numbers(free - band), "high": _numbers(free + band)} if np.isfinite(band).all() else {}
    return {"free": _numbers(free), **edges}


def _numbers(values: FloatArray) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _places(visited: FloatArray, *, around_zero: bool) -> FloatArray:
    """Where a curve is drawn: evenly over what was visited, and on both sides of a jump at 0."""
    low, high = np.quantile(visited, [EDGE, 1.0 - EDGE])
    x = np.linspace(low, high, DRAWN_POINTS)
    if not around_zero or not low < 0.0 < high:
        return x
    near = BESIDE * (high - low)
    return np.sort(np.concatenate([x[np.abs(x) > near], [-near, near]]))
