"""A fitted free curve as an effect of its own: its shape at knots, in the place of the laws that it deviates from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.form.basis import speed_knots
from gpsim.diagnosis.form.free_curve import FreeCurve
from gpsim.diagnosis.form.groups import Group
from gpsim.diagnosis.form.laws import CurveTerm
from gpsim.diagnosis.form.penalised import BAND
from gpsim.diagnosis.form.visited import Law, of_law, places, visited
from gpsim.diagnosis.report import MeasuredCurve
from gpsim.effects import Axis, Gate, Measured, Place, Shape, Term, declared, effect_of

FAMILY = {
    "force": "force_curve",
    "actuator": "actuator_curve",
    "sensor": "sensor_curve",
    "vehicle": "rate_curve",
}
CONSTANTS = {
    ("force", "position"): ("constant_force", "force"),
    ("sensor", "reading"): ("sensor_bias", "offset"),
}
"""Of curves of a site and an input: the family of a constant in them, and its parameter."""
TOLD = 6  # digits of a knot and of what the curve is there


@dataclass(frozen=True)
class Measurement:
    """A curve that may stand in the place of a group's laws.

    hypothesis: the explanation with it; term: the curve's own; deviation: (F,) standard deviation at each knot.
    """

    group: Group
    hypothesis: Hypothesis
    term: Term
    deviation: FloatArray

    @property
    def key(self) -> tuple[str, str, str]:
        """Which curve it is, of those that an explanation may have."""
        return self.term.family, self.term.on, self.term.variant

    @property
    def shape(self) -> Shape:
        """Its knots, and what it adds there."""
        effect = self.term.effect
        assert isinstance(effect, Measured)
        return effect.shape


def measurable(group: Group) -> bool:
    """Whether a curve in a group's place is an effect that a simulator can have: everywhere, of its own input."""
    return (
        group.site in FAMILY
        and group.testable
        and not group.gate
        and not (group.dry and group.of == "position")
    )


def measurement(problem: Problem, laws: Hypothesis, free: FreeCurve) -> Measurement | None:
    """A free curve as an effect. laws: the explanation it was fitted around. None of what can be none."""
    group, curve, fitted = free.group, free.widened, free.fitted
    if group is None or curve is None or fitted is None or curve.further is not None or not measurable(group):
        return None
    axes = tuple(map(_denser, curve.basis.axes)) if len(curve.basis.axes) > 1 else curve.basis.axes
    inputs = places(axes)
    design = curve.basis.design(inputs)
    heights = _heights(problem, laws, group, inputs, design @ fitted.theta[curve.free])
    rest, heights = _beside_a_constant(
        laws, group, _rest(curve.hypothesis.having(fitted.theta), laws, group), heights
    )
    shape = Shape(axes, heights, _wraps(problem, group))
    family = FAMILY[group.site]
    freedom = min(fitted.freedom + _parameters(laws, group), float(curve.basis.size))
    term = Term(family, group.on, shape.values(freedom), Gate(), _variant(group))
    made = rest.plus(term, declared(effect_of(family), Place(group.on, "1")))
    deviation = np.sqrt(np.maximum(np.einsum("nf,fg,ng->n", design, fitted.covariance, design), 0.0))
    return Measurement(group, made, term, deviation)


def smooth_start(problem: Problem, laws: Hypothesis, group: Group) -> Shape | None:
    """What the laws of a group with dry friction say as a force that lets go at rest, where a curve may begin."""
    (name,) = group.inputs(problem.simulator)
    knots = speed_knots(visited(problem, name), problem.run.settings.form.knots)
    if len(knots) < 2:
        return None
    heights = of_law(problem, laws, group, (np.array(knots),))
    return Shape((knots,), tuple(float(y) for y in np.where(np.array(knots) == 0.0, 0.0, heights)))


def _rest(fitted: Hypothesis, laws: Hypothesis, group: Group) -> Hypothesis:
    """All other terms as they were fitted beside the curve, free again."""
    kept = [i for i in range(len(laws.terms)) if i not in group.terms]
    there = [t for t in fitted.terms if not isinstance(t, CurveTerm)]
    if len(there) == len(laws.terms):  # the group's own are held beside a force
        there = [there[i] for i in kept]
    return replace(laws, terms=tuple(there), declared=tuple(laws.declared[i] for i in kept))


def _beside_a_constant(
    laws: Hypothesis, group: Group, rest: Hypothesis, heights: tuple[float, ...]
) -> tuple[Hypothesis, tuple[float, ...]]:
    """What else is said, and the curve's heights, whose mean is 0 where a constant force or a sensor's bias is told.

    Both together could not be told apart, and the constant is the one that people look for.
    """
    family, size = CONSTANTS.get((group.site, group.of), ("", ""))

    def constant(term: Term) -> bool:
        return (term.family, term.on) == (family, group.on) and not term.gate

    def of_size(term: Term, value: float) -> Term:
        return replace(term, values={**term.values, size: value})

    told = [i for i, term in enumerate(laws.terms) if constant(term)]
    if not told:
        return rest, heights
    mean = float(np.mean(heights))
    if told[0] in group.terms:
        rest = rest.plus(of_size(laws.terms[told[0]], mean), laws.declared[told[0]])
    else:
        terms = tuple(of_size(t, t.values[size] + mean) if constant(t) else t for t in rest.terms)
        rest = replace(rest, terms=terms)
    return rest, tuple(height - mean for height in heights)


def _heights(
    problem: Problem, laws: Hypothesis, group: Group, inputs: Law, bend: FloatArray
) -> tuple[float, ...]:
    """What it adds to the base simulator at every knot, `bend` beside the laws; of friction how much there is."""
    law = of_law(problem, laws, group, inputs)
    total = bend - np.sign(inputs[-1]) * law if group.dry else bend + law - _base(group, inputs)
    return tuple(float(y) for y in (np.maximum(total, 0.0) if group.dry else total))


def _denser(axis: Axis) -> Axis:
    """A knot more between every two: a map's laws are no plane between its few."""
    x = np.array(axis)
    return tuple(float(v) for v in np.sort(np.concatenate([x, 0.5 * (x[1:] + x[:-1])])))


def _base(group: Group, inputs: Law) -> FloatArray:
    """What the base simulator makes of it: a command, a reading or a turn rate is what it is."""
    stays = group.site in ("actuator", "sensor") or group.changes == "w"
    return inputs[-1] if stays else np.zeros(len(inputs[-1]))


def told(group: Group, shape: Shape, inputs: Law) -> FloatArray:
    """What a person would call the curve: the force itself, what reaches the simulator, what is read."""
    added = shape.at(*inputs)
    return -np.sign(inputs[-1]) * added if group.dry else added + _base(group, inputs)


def described(problem: Problem, found: Measurement, scale: float = 1.0) -> MeasuredCurve:
    """The curve as it is reported, its nearest laws not yet known. scale: times its shape."""
    group, shape, simulator = found.group, found.shape, problem.simulator
    inputs = places(shape.axes)
    sign = -np.sign(inputs[-1]) if group.dry else np.ones(len(inputs[-1]))
    values = sign * scale * np.array(shape.heights) + (0.0 if group.dry else _base(group, inputs))
    band = scale * (BAND * found.deviation + _between_knots(shape))
    quantity, unit = group.quantity(simulator)
    channel, its_unit = group.drawn_over(simulator)
    second = shape.axes[0] if len(shape.axes) > 1 else None
    own = shape.axes[-1]
    return MeasuredCurve(
        quantity=quantity,
        unit=unit,
        input=channel,
        input_unit=its_unit,
        at=_numbers(own),
        values=_numbers(values),
        low=_numbers(values - band) if np.isfinite(band).all() else (),
        high=_numbers(values + band) if np.isfinite(band).all() else (),
        visited=(float(own[0]), float(own[-1])),
        freedom=round(found.term.values["freedom"], 2),
        second=None if second is None else "v",
        second_unit=None if second is None else simulator.rate.units["v"],
        second_at=None if second is None else _numbers(second),
    )


def _between_knots(shape: Shape) -> FloatArray:
    """(F,) how far a smooth law may be off straight lines between knots, by how much these bend; 0 of a map.

    An eighth of the second derivative times the square of the longer way to a neighbour.
    """
    if len(shape.axes) > 1:
        return np.zeros(len(shape.heights))
    x, y = np.array(shape.axes[0]), np.array(shape.heights)
    out = np.zeros(len(x))
    for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(x) == 0.0) + 1):
        if len(part) > 2:
            own = np.diff(x[part])
            bends = np.abs(np.diff(np.diff(y[part]) / own)) / (0.5 * (own[1:] + own[:-1]))
            longer = np.maximum(np.append(own, 0.0), np.append(0.0, own))
            out[part] = np.concatenate([bends[:1], bends, bends[-1:]]) * longer**2 / 8.0
    return out


def _numbers(values: FloatArray | Axis) -> tuple[float, ...]:
    return tuple(float(f"{v:.{TOLD}g}") for v in values)


def _variant(group: Group) -> str:
    if group.site == "force":
        return "friction" if group.dry else group.of
    return group.changes if group.site == "vehicle" else ""


def _wraps(problem: Problem, group: Group) -> bool:
    state = problem.simulator.state
    own = group.of in ("position", "reading")
    return own and bool(state.wraps[state.index(group.on)])


def _parameters(laws: Hypothesis, group: Group) -> float:
    """What the laws cost that it deviates from."""
    terms = (laws.terms[i] for i in group.terms)
    return sum(len(laws.declared[i]) for i in group.terms) + sum(t.effect.spent(t.values) for t in terms)
