"""A hypothesis with a free curve beside the laws of one group, or with what is missing as a curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.form.basis import Basis, jumps_of, knots_of, speed_knots, two_sided_knots, with_jumps
from gpsim.diagnosis.form.groups import Group
from gpsim.diagnosis.form.laws import (
    FREE,
    CurveTerm,
    FreeCommand,
    FreeDrive,
    FreeForce,
    FreeGrip,
    FreeRate,
    FreeReading,
    FreeSlip,
    FreeTurn,
    HatGate,
    declared,
)
from gpsim.diagnosis.form.visited import of_law, twists, visited
from gpsim.diagnosis.selection import LackOfFit
from gpsim.effects import Effect, Gate, Term

KNOTS_OF_TWO = 5  # knots along each input of a law that has two, as a vehicle's
KNOTS_OF_PRODUCT = 9  # knots of a curve of one input that a further one multiplies
FURTHER_KNOTS = 4  # knots along the one further input that lack of fit names
LEAST_SIDE = 0.02
"""Of all samples, that must move in a direction for friction to have a curve of its own there."""

LEAST = 0.01  # of a command, a turn rate or a reading: a law that changes it by less is taken to change it by so much
TINY = 1e-9  # of a size: a law that does nothing has none


@dataclass(frozen=True)
class Widened:
    """A hypothesis whose last parameters are a curve's coefficients.

    basis: over (the further input, if there is one, and then) the curve's own; scale: [its unit] root mean square of
    what the laws do, at every visited transition; design: (N, F) what each coefficient counts there.
    """

    hypothesis: Hypothesis
    basis: Basis
    scale: float
    design: FloatArray
    further: str | None = None

    @property
    def free(self) -> slice:
        """Where the coefficients stand in theta."""
        return slice(len(self.hypothesis.parameters) - self.basis.size, None)

    def penalties(self) -> list[FloatArray]:
        """(F, F) each: bends along the curve's inputs, change along a further one, the mean square of all."""
        own = range(1, len(self.basis.axes)) if self.further else range(len(self.basis.axes))
        bends = sum((_square(self.basis.bends(i)) for i in own), np.zeros((self.basis.size,) * 2))
        out = [bends, _square(self.design) / len(self.design)]
        return [*out, _square(self.basis.slopes(0))] if self.further else out


def widened(
    problem: Problem,
    hypothesis: Hypothesis,
    group: Group,
    further: str | None = None,
    knots: int | None = None,
) -> Widened | None:
    """The hypothesis with a curve in the place of a group's laws; None where their input hardly moves.

    The laws stay as they are and the curve is their deviation: at 0 it is they. All other parameters stay free. knots:
    of a curve of one input, the usual number without it.
    """
    if group.of == "twist" or further in group.inputs(problem.simulator):  # they are its own inputs
        further = None
    axes, inputs = _own_axes(problem, hypothesis, group, product=further is not None, knots=knots)
    if any(len(axis) < 2 for axis in axes):
        return None
    if further is not None:
        along = knots_of(visited(problem, further), FURTHER_KNOTS)
        if len(along) < 2:
            return None
        axes, inputs = [along, *axes], [visited(problem, further), *inputs]
    basis = Basis(tuple(axes))
    own = tuple(inputs if group.of == "twist" else inputs[-1:])
    law = of_law(problem, hypothesis, group, own)
    does = law - own[-1] if _turns_into_another(group) else law
    least = LEAST * float(np.sqrt(np.mean(own[-1] ** 2))) if does is not law else 0.0
    scale = max(float(np.sqrt(np.mean(does**2))), least, TINY)
    if not group.terms and group.site == "force":
        scale = max(typical_force(problem, group.on), TINY)
    build = _SITES[group.site]
    return Widened(
        build(problem, hypothesis, group, basis, scale, further), basis, scale, basis.design(inputs), further
    )


def missing(problem: Problem, hypothesis: Hypothesis, lack: LackOfFit) -> Widened | None:
    """The hypothesis with a curve of what lack of fit names, added to the rate; the last of its inputs is drawn."""
    settings, simulator = problem.run.settings.form, problem.simulator
    channels, rate = simulator.state + simulator.action, simulator.rate.index(lack.rate)
    names = tuple(dict.fromkeys(lack.on))[::-1]  # the first of them is drawn: the last axis
    inputs = [visited(problem, name) for name in names]
    counts = [settings.knots] if len(names) == 1 else [FURTHER_KNOTS, KNOTS_OF_PRODUCT]
    axes = tuple(knots_of(x, count) for x, count in zip(inputs, counts, strict=True))
    if any(len(axis) < 2 for axis in axes):
        return None
    basis, columns = Basis(axes), tuple(channels.index(name) for name in names)
    law = FreeRate(basis, rate, columns, tuple(bool(channels.wraps[i]) for i in columns))
    windows = problem.windows
    rates = simulator.rates(windows.measured[:, 0], windows.actions[:, 0], problem.parameters)[:, rate]
    scale = max(float(np.sqrt(np.mean(rates**2))), TINY)
    made = _plus(hypothesis, law, lack.rate, Gate(), basis, simulator.rate.units[lack.rate], scale)
    return Widened(made, basis, scale, basis.design(inputs), names[0] if len(names) > 1 else None)


def typical_force(problem: Problem, on: str) -> float:
    """How large a force moves a coordinate as it moves by itself."""
    simulator, windows = problem.simulator, problem.windows
    (place,) = (i for i, c in enumerate(simulator.coordinates) if c.name == on)
    states, actions = windows.measured[:, 0], windows.actions[:, 0]
    rate = simulator.rate.index(simulator.coordinates[place].rate)
    rates = simulator.rates(states, actions, problem.parameters)[:, rate]
    unit = np.zeros((len(states), len(simulator.coordinates)))
    unit[:, place] = 1.0
    reacts = simulator.rates(states, actions, problem.parameters, unit)[:, rate] - rates
    return float(np.sqrt(np.mean(rates**2)) / max(float(np.median(np.abs(reacts))), 1e-300))


def _turns_into_another(group: Group) -> bool:
    """Whether its laws make another one of their last input, which they leave as it is where they do nothing."""
    return group.of in ("command", "reading") or group.changes == FreeTurn.changes


def _own_axes(
    problem: Problem, hypothesis: Hypothesis, group: Group, *, product: bool, knots: int | None
) -> tuple[list[tuple[float, ...]], list[FloatArray]]:
    """Knots along each of a law's own inputs, and what was visited of them; of a product fewer."""
    settings = problem.run.settings.form
    if group.of == "twist":
        inputs = list(twists(problem).T)
        few = KNOTS_OF_TWO
        counts = (few, few) if knots is None else (2 * few - 1, few)  # what bends, bends with the speed
        return [knots_of(x, count) for x, count in zip(inputs, counts, strict=True)], inputs
    (name,) = group.inputs(problem.simulator)
    x, count = visited(problem, name), KNOTS_OF_PRODUCT if product else knots or settings.knots
    if group.of == "speed":
        return [two_sided_knots(x, count, LEAST_SIDE) if group.dry else speed_knots(x, count)], [x]
    axis = knots_of(x, count)
    if len(axis) < 2:
        return [axis], [x]
    jumps = jumps_of(lambda at: of_law(problem, hypothesis, group, (at,)), axis[0], axis[-1])
    return [with_jumps(axis, jumps)], [x]


def _with_force(
    problem: Problem, hypothesis: Hypothesis, group: Group, basis: Basis, scale: float, further: str | None
) -> Hypothesis:
    """Force laws stay, the curve comes to them; of a further input a curve at each of its knots."""
    simulator = problem.simulator
    (coordinate,) = (c for c in simulator.coordinates if c.name == group.on)
    of_speed = group.of == "speed"
    own = Basis(basis.axes[-1:])
    wraps = not of_speed and bool(simulator.state.wraps[simulator.state.index(group.on)])
    low = None
    if group.dry:
        knots = np.array(own.axes[0])
        # Just beside 0 each knot of the two that stand there is on its own side.
        sides = np.where(knots == 0.0, TINY * np.sign(np.arange(len(knots)) - len(knots) / 2 + 0.5), knots)
        low = -np.abs(of_law(problem, hypothesis, group, (sides,)))
    law: Effect = FreeGrip(own, of_speed, wraps) if group.dry else FreeForce(own, of_speed, wraps)
    made = _holding(hypothesis, group)
    for gate in _gates(group.gate, further, basis):
        made = _plus(made, law, group.on, gate, own, coordinate.force_unit, scale, low)
    return made


def _gates(gate: Gate, further: str | None, basis: Basis) -> Sequence[Gate]:
    if further is None:
        return [gate]
    own = {f.name: getattr(gate, f.name) for f in fields(Gate)}
    knots = basis.axes[0]
    return [HatGate(**own, along=further, knots=knots, place=i) for i in range(len(knots))]


def _with_command(
    problem: Problem, hypothesis: Hypothesis, group: Group, basis: Basis, scale: float, further: str | None
) -> Hypothesis:
    """The curve holds the laws; with a further input it acts on what reaches the simulator."""
    simulator = problem.simulator
    unit = simulator.action.units[group.on]
    if further is None:
        law: Effect = FreeCommand(basis, _laws(hypothesis, group))
        return _plus(_without(hypothesis, group), law, group.on, group.gate, basis, unit, scale)
    channels = simulator.state + simulator.action
    columns = channels.index(further), channels.index(group.on)
    wraps = tuple(bool(channels.wraps[i]) for i in columns)
    law = FreeDrive(basis, simulator.action.index(group.on), columns, wraps)
    return _plus(_holding(hypothesis, group), law, group.on, group.gate, basis, unit, scale)


def _with_twist(
    problem: Problem, hypothesis: Hypothesis, group: Group, basis: Basis, scale: float, further: str | None
) -> Hypothesis:
    kind = FreeTurn if group.changes == FreeTurn.changes else FreeSlip
    law, unit = kind(basis, _laws(hypothesis, group)), problem.simulator.rate.units[group.changes]
    return _plus(_without(hypothesis, group), law, group.on, group.gate, basis, unit, scale)


def _with_reading(
    problem: Problem, hypothesis: Hypothesis, group: Group, basis: Basis, scale: float, further: str | None
) -> Hypothesis:
    channels = problem.simulator.state
    wraps = bool(channels.wraps[channels.index(group.on)])
    law = FreeReading(basis, _laws(hypothesis, group), wraps)
    return _plus(_without(hypothesis, group), law, group.on, Gate(), basis, channels.units[group.on], scale)


_SITES: dict[str, Callable[[Problem, Hypothesis, Group, Basis, float, str | None], Hypothesis]] = {
    "force": _with_force,
    "actuator": _with_command,
    "vehicle": _with_twist,
    "sensor": _with_reading,
}


def _laws(hypothesis: Hypothesis, group: Group) -> tuple[Term, ...]:
    terms = [hypothesis.terms[i] for i in group.terms]
    return tuple(sorted(terms, key=lambda t: t.effect.order))


def _plus(
    hypothesis: Hypothesis,
    law: Effect,
    on: str,
    gate: Gate,
    basis: Basis,
    unit: str,
    scale: float,
    low: FloatArray | None = None,
) -> Hypothesis:
    """The hypothesis and a free law that does nothing yet."""
    term = CurveTerm(FREE, on, dict.fromkeys(basis.names, 0.0), gate, law=law)
    return hypothesis.plus(term, declared(basis, unit, scale, low))


def _holding(hypothesis: Hypothesis, group: Group) -> Hypothesis:
    """The group's own parameters held: the curve may take their place."""
    kept = ((() if i in group.terms else p) for i, p in enumerate(hypothesis.declared))
    return replace(hypothesis, declared=tuple(kept))


def _without(hypothesis: Hypothesis, group: Group) -> Hypothesis:
    return hypothesis.without_all(group.terms)


def _square(rows: FloatArray) -> FloatArray:
    return np.asarray(rows.T @ rows)
