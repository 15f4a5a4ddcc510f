"""What the inputs of laws were in the windows, and what named laws make of them."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.diagnosis.fitting import Hypothesis, Problem
from gpsim.diagnosis.form.groups import Group
from gpsim.effects import ActuatorEffect, Axis, ForceEffect, SensorEffect, Term, VehicleEffect

Law = tuple[FloatArray, ...]
BESIDE = 1e-9  # of the range: just beside a jump each of its two knots is on its own side


def visited(problem: Problem, name: str) -> FloatArray:
    """(N,) a state channel or a command in every transition; angles between -pi and pi."""
    return _inputs(problem)[:, (problem.simulator.state + problem.simulator.action).index(name)]


def twists(problem: Problem) -> FloatArray:
    """(N, 2) what the base simulator takes a vehicle's speed and turn rate for."""
    windows, rate = problem.windows, problem.simulator.rate
    seen = windows.valid[:, 1:]
    rates = problem.simulator.rates(windows.measured[:, :-1][seen], windows.actions[seen], problem.parameters)
    return np.asarray(rates[:, [rate.index("v"), rate.index("w")]])


def places(axes: tuple[Axis, ...]) -> Law:
    """(F,) each: the inputs at every knot, the last axis running fastest; of two at a jump one on either side."""
    sides = []
    for axis in axes:
        x = np.array(axis)
        near = BESIDE * max(float(np.ptp(x)), 1e-300)
        twice = np.diff(x) == 0.0
        x[:-1][twice] -= near
        x[1:][twice] += near
        sides.append(x)
    return tuple(grid.ravel() for grid in np.meshgrid(*sides, indexing="ij"))


def _inputs(problem: Problem) -> FloatArray:
    windows, channels = problem.windows, problem.simulator.state
    states = windows.measured[:, :-1]
    inputs = np.concatenate([difference(states, np.zeros_like(states), channels), windows.actions], axis=-1)
    return np.asarray(inputs[windows.valid[:, 1:]])


def of_law(problem: Problem, hypothesis: Hypothesis, group: Group, inputs: Law) -> FloatArray:
    """(N,) what the group's laws say at inputs (N,) each.

    A force or, of dry friction that depends on the position, its size; what becomes of a command, of a vehicle's turn
    rate or sideways speed, of a reading.
    """
    terms = [hypothesis.terms[i] for i in group.terms]
    if group.of in ("speed", "position"):
        return sum((_force(problem, term, group, inputs[0]) for term in terms), np.zeros(len(inputs[0])))
    return in_turn(terms, inputs)


def in_turn(terms: list[Term], inputs: Law) -> FloatArray:
    """(N,) what laws without memory make of a command, a twist or a reading, one after another."""
    out, none = inputs, np.zeros(len(inputs[0]))
    for term in sorted(terms, key=lambda t: t.effect.order):
        effect, values = term.effect, {k: np.full(1, v) for k, v in term.values.items()}
        if isinstance(effect, ActuatorEffect):
            column = {k: v[:, None] for k, v in values.items()}
            out = (effect.actuate(out[0][:, None], column, {}, none[:, None], none[:, None])[:, 0],)
        elif isinstance(effect, SensorEffect):
            out = (effect.measure(out[0][:, None], (0,), values, {}, none)[:, 0],)
        elif isinstance(effect, VehicleEffect):
            v, lateral, w = effect.twist(out[0], none, out[1], values)
            if effect.changes == "v_lateral":
                return np.asarray(lateral)
            out = v, w
    return np.asarray(out[-1])


def _force(problem: Problem, term: Term, group: Group, x: FloatArray) -> FloatArray:
    """(N,) of one force law, the other of speed and position at its median."""
    effect, simulator = term.effect, problem.simulator
    assert isinstance(effect, ForceEffect)
    (coordinate,) = (c for c in simulator.coordinates if c.name == group.on)
    names = coordinate.name, coordinate.velocity
    of_speed = group.of == "speed"
    held = np.full(len(x), np.median(visited(problem, names[0] if of_speed else names[1])))
    position, speed = (held, x) if of_speed else (x, held)
    values = {name: np.full(len(x), value) for name, value in term.values.items()}
    smooth = effect.force(position, speed, values)
    if smooth is None:
        load = np.full(len(x), _load(problem, group.on))
        most = effect.grip(position, speed, values, load)
        smooth = np.zeros(len(x)) if most is None else -np.sign(speed) * most if of_speed else most
    low, high = term.gate.region.get(group.on, (-np.inf, np.inf)) if not of_speed else (-np.inf, np.inf)
    return np.asarray(np.where((x >= low) & (x <= high), smooth, 0.0))


def _load(problem: Problem, on: str) -> float:
    """The usual normal force, where the simulator knows it."""
    windows, simulator = problem.windows, problem.simulator
    states = windows.measured[:, 0]
    rates = simulator.rates(states, windows.actions[:, 0], problem.parameters)
    load = simulator.normal_force(states, rates, problem.parameters).get(on)
    return 0.0 if load is None else float(np.median(load))
