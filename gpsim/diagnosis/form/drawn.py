"""A fitted curve beside the laws that it stands in for, as the report draws it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.form.basis import Basis
from gpsim.diagnosis.form.groups import Group
from gpsim.diagnosis.form.penalised import BAND, Curved
from gpsim.diagnosis.form.visited import of_law, twists, visited
from gpsim.diagnosis.form.widened import Widened
from gpsim.diagnosis.report import Curve
from gpsim.diagnosis.selection import LackOfFit
from gpsim.simulators import Simulator

DRAWN_POINTS = 41  # places at which a curve is drawn

BESIDE = 1e-6  # of the range: a jump at 0 is drawn from there to there
EDGE = 0.005  # of all samples on either side, beyond which nothing is drawn


def drawn(problem: Problem, hypothesis: Hypothesis, group: Group, curve: Widened, fitted: Curved) -> Curve:
    """The curve of a group over its own input, other inputs at their medians."""
    simulator, given = problem.simulator, {}
    if group.of == "twist":
        v, w = twists(problem).T
        given["v"] = float(np.median(v))
        x = _places(w, around_zero=False)
        own = [np.full(len(x), given["v"]), x]
        law = of_law(problem, hypothesis, group, tuple(own))
        channel, unit = "w", simulator.rate.units["w"]
    else:
        (channel,) = group.inputs(simulator)
        x = _places(visited(problem, channel), around_zero=group.of == "speed")
        own, law = [x], of_law(problem, hypothesis, group, (x,))
        unit = (simulator.state + simulator.action).units[channel]
    if curve.further is not None:
        given[curve.further] = float(np.median(visited(problem, curve.further)))
        own = [np.full(len(x), given[curve.further]), *own]
    sign = -np.sign(x) if group.dry and group.of == "speed" else np.ones(len(x))
    quantity, unit_of_it = _quantity(simulator, group)
    return _curve(
        group.claims(hypothesis),
        quantity,
        unit_of_it,
        channel,
        unit,
        x,
        law,
        own,
        sign,
        curve.basis,
        fitted,
        curve,
        given,
    )


def drawn_missing(problem: Problem, lack: LackOfFit, curve: Widened, fitted: Curved) -> Curve:
    """The curve of what is missing over its first input, the other one at its median."""
    simulator = problem.simulator
    x = _places(visited(problem, lack.on[0]), around_zero=False)
    given, own = {}, [x]
    if curve.further is not None:
        given[curve.further] = float(np.median(visited(problem, curve.further)))
        own = [np.full(len(x), given[curve.further]), x]
    units = (simulator.state + simulator.action).units
    rate = simulator.rate.units[lack.rate]
    return _curve(
        (),
        lack.rate,
        rate,
        lack.on[0],
        units[lack.on[0]],
        x,
        np.zeros(len(x)),
        own,
        np.ones(len(x)),
        curve.basis,
        fitted,
        curve,
        given,
    )


def _curve(
    claims: tuple[tuple[str, str], ...],
    quantity: str,
    unit: str,
    channel: str,
    input_unit: str,
    x: FloatArray,
    law: FloatArray,
    inputs: list[FloatArray],
    sign: FloatArray,
    basis: Basis,
    fitted: Curved,
    curve: Widened,
    given: Mapping[str, float],
) -> Curve:
    design = basis.design(inputs)
    free = law + sign * (design @ fitted.theta[curve.free])
    sd = np.sqrt(np.maximum(np.einsum("nf,fg,ng->n", design, fitted.covariance, design), 0.0))
    known = bool(np.isfinite(sd).all())
    return Curve(
        effects=claims,
        quantity=quantity,
        unit=unit,
        input=channel,
        input_unit=input_unit,
        at=_numbers(x),
        law=_numbers(law),
        free=_numbers(free),
        low=_numbers(free - BAND * sd) if known else (),
        high=_numbers(free + BAND * sd) if known else (),
        given=given,
    )


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


def _quantity(simulator: Simulator, group: Group) -> tuple[str, str]:
    """What a group's curve is of, and its unit."""
    if group.site == "force":
        kind = "friction" if group.of == "position" and group.dry else "force"
        (unit,) = (c.force_unit for c in simulator.coordinates if c.name == group.on)
        return f"{kind} on {group.on}", unit
    if group.site == "actuator":
        return f"{group.on} at the simulator", simulator.action.units[group.on]
    if group.site == "vehicle":
        return group.changes, simulator.rate.units[group.changes]
    return f"{group.on} as read", simulator.state.units[group.on]
