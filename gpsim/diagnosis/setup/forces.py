"""What forces a motion would have taken: what the base lacks for it, and what each thing that may be off changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Hypothesis, Problem
from gpsim.diagnosis.setup.force_parts import GAIN, HELD, Offer
from gpsim.diagnosis.setup.low_passed import USUAL, LowPassed
from gpsim.effects import Effect, ForceEffect, Term, closed

TURNS = 0.01  # of a joint's usual speed, within which dry friction is taken to turn round
OFF, MISTAKEN = 0.3, 0.15  # by which masses are usually off, and gains of motors


@dataclass(eq=False)
class Forces:
    """What forces the motion would have taken (N, C), with and without what may be off.

    held: forces of a law that acts for sure, with the values that it has.
    """

    problem: Problem
    dt: float
    motion: LowPassed
    rows: Hypothesis
    held: tuple[Term, ...] = ()
    _found: dict[tuple[object, ...], FloatArray] = field(default_factory=dict)

    def lacking(self, late: float) -> FloatArray:
        """(N, C): what the base lacks where commands come late by so many s."""
        if ("late", late) not in self._found:
            self._found["late", late] = self._with((), self.motion.actions(late))
        return self._found["late", late]

    def of_rows(self) -> FloatArray:
        """(N, C, P): forces of rows of size 1, each at its own joint."""
        acceleration = self.motion.acceleration
        out = np.zeros((*acceleration.shape, len(self.rows.terms)))
        for i, (term, parameter) in enumerate(zip(self.rows.terms, self.rows.parameters, strict=True)):
            joint = self.joint(term.on)
            moved = (*self._path(joint), acceleration[:, joint])
            out[:, joint, i] = _of_unit_size(term.effect, parameter.name, *moved)
        return out

    def of_rise(self, offer: Offer, late: float) -> FloatArray:
        """(N, C, 1): what friction adds that grows by 1 as joints slow below the offer's speed, or with their load."""
        moved, simulator = self.motion, self.problem.simulator
        out = np.zeros((*moved.acceleration.shape, 1))
        given: dict[str, FloatArray] = {}
        if not offer.fixed:  # to hear what was commanded is dear
            given = simulator.given(moved.states, moved.actions(late), self.problem.parameters)
        for on in (offer.candidate.place.on, *offer.also):
            joint = self.joint(on)
            speed = self._path(joint)[1]
            grows = np.exp(-((speed / offer.fixed[0]) ** 2)) if offer.fixed else np.abs(given[on])
            out[:, joint, 0] = -grows * _way(speed)
        return out

    def of_gain(self, offer: Offer, late: float) -> FloatArray:
        """(N, C, 1): what a motor's gain changes, or a servo's."""
        more, terms = self.motion.actions(late), []
        if offer.family == GAIN:
            more[:, self.problem.simulator.action.index(offer.candidate.place.on)] *= 1.0 + MISTAKEN
        else:
            terms = [offer.term((1.0 + MISTAKEN,))]
        return (self.lacking(late) - self._with(terms, more))[..., None] / MISTAKEN

    def of_body(self, offer: Offer, about: tuple[float, ...]) -> FloatArray:
        """(N, C, P): what a mass, or a payload's mass and first moments about these values, change."""
        key = (offer.candidate.identity, about)
        if key not in self._found:
            change = {"payload": self._of_payload, HELD: self._of_gravity}.get(offer.family, self._of_mass)
            self._found[key] = change(offer.candidate, about)
        return self._found[key]

    def _of_mass(self, candidate: Candidate, about: tuple[float, ...]) -> FloatArray:
        more = candidate.term((candidate.declared[0].none + OFF,))
        return (self.lacking(0.0) - self._with([more], self.motion.actions(0.0)))[..., None] / OFF

    def _of_gravity(self, candidate: Candidate, about: tuple[float, ...]) -> FloatArray:
        held = self._with([candidate.term((1.0,))], self.motion.actions(0.0))
        return (self.lacking(0.0) - held)[..., None]

    def _of_payload(self, candidate: Candidate, about: tuple[float, ...]) -> FloatArray:
        declared, at_once = candidate.declared, self.motion.actions(0.0)
        mass = max(about[0], declared[0].starts[0])
        there = self._with([candidate.term((mass, *about[1:]))], at_once)
        columns = [(self.lacking(0.0) - there) / mass]
        for axis in (1, 2, 3):
            aside = [mass, *about[1:]]
            aside[axis] += declared[axis].scale
            moved = self._with([candidate.term(aside)], at_once)
            columns.append((there - moved) / declared[axis].scale / mass)
        return np.stack(columns, axis=-1)

    def _with(self, terms: Sequence[Term], actions: FloatArray) -> FloatArray:
        system, moved = closed(self.problem.simulator), self.motion
        assert system is not None
        told = system.lacking_force(moved.states, actions, moved.acceleration, self.problem.parameters, terms)
        return np.nan_to_num(told - self._of_held(), posinf=0.0, neginf=0.0)

    def _of_held(self) -> FloatArray:
        out = np.zeros_like(self.motion.acceleration)
        for term in self.held:
            values = {name: np.full(len(out), value) for name, value in term.values.items()}
            joint, force = self.joint(term.on), None
            if isinstance(term.effect, ForceEffect):
                force = term.effect.force(*self._path(joint), values)
            assert force is not None  # see `is_law`
            out[:, joint] += force
        return out

    def joint(self, on: str) -> int:
        """Its place among the coordinates."""
        return [c.name for c in self.problem.simulator.coordinates].index(on)

    def _path(self, joint: int) -> tuple[FloatArray, FloatArray]:
        """(N,) its position and speed."""
        coordinate, names = self.problem.simulator.coordinates[joint], self.problem.simulator.state
        states = self.motion.states
        return states[:, names.index(coordinate.name)], states[:, names.index(coordinate.velocity)]


def _of_unit_size(
    effect: Effect, parameter: str, position: FloatArray, speed: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """(N,): the force of a row of size 1 along a motion."""
    if not isinstance(effect, ForceEffect):
        return -acceleration  # a rotor
    size = {parameter: np.ones(len(speed))}
    force = effect.force(position, speed, size)
    if force is not None:
        return force
    grip = effect.grip(position, speed, size, None)
    assert grip is not None  # friction's size, not a part of its load
    return -grip * _way(speed)


def _way(speed: FloatArray) -> FloatArray:
    """(N,) which way it goes, -1 to 1."""
    turns = TURNS * max(float(np.quantile(np.abs(speed), USUAL)), np.finfo(float).tiny)
    return np.asarray(np.tanh(speed / turns))
