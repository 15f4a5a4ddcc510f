"""Where the search of a robot starts: what it may lack, sized by inverse dynamics, almost without a simulation.

Recorded motion says what forces a model would take for it. What it lacks is linear in each joint's friction, rotor and
offset, in masses, first moments of a payload and gains of motors, and nearly so in how late commands come: one weighted
least squares of all joints (Gautier and Poignet 2001, Control Engineering Practice 9(12); Janot, Vandanjon and Gautier
2014, IEEE Transactions on Control Systems Technology 22(1)). Which bodies and motors are off is asked greedily, by
the evidence of that linear model, in which usual sizes are the prior. It is less exact than a fit by simulation, and
nothing leads it astray: light links without a rotor, which whirl in a simulation, do here what they did. Only starts
come of it, so that it may look at the whole recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Hypothesis, Problem, fit, is_row, objective, state_jacobian
from gpsim.diagnosis.setup.force_parts import (
    GAIN,
    HELD,
    MASS,
    STIFF,
    Offer,
    Part,
    Sized,
    least_squares,
    offered,
    split,
)
from gpsim.diagnosis.setup.low_passed import USUAL, LowPassed, low_passed
from gpsim.effects import RISE, Effect, ForceEffect, Term, closed, declared, effect_of
from gpsim.recordings import Recording

CUTOFFS = {0.5: (0.15, 0.06), 0.2: (0.06, 0.025), 0.06: (0.012,)}
"""Of the Nyquist frequency, below which motion is kept, and forces are compared: what simulates best is taken. Fast
motion asks for a wide band, coarse encoders for a narrow one, late commands and friction for slow forces."""
LATE, STRIBECK = "actuator_delay", "stribeck_friction"
LATEST, GRID = 2.0, 0.5  # samples that commands may be late, in steps of which that is scanned
LATER = 0.1  # samples, by which commands come later where that is asked
SLOWER = (0.05, 0.1, 0.2, 0.4, 0.8)  # of a joint's usual speed, below which its dry friction may grow
TURNS = 0.01  # of a joint's usual speed, within which dry friction is taken to turn round
ENOUGH = 10.0  # nats of evidence that a body, a motor or late commands must bring
MOST = 6  # bodies and motors that are off at once, at most
OFF, MISTAKEN = 0.3, 0.15  # by which masses are usually off, and gains of motors
TWICE = 2.0  # times as much is the most: what is noisy is foreseen best by next to nothing
ROW = 3.0  # times its usual start, that a joint's row may well be
UNKNOWN, FACTOR = 0.5, (-0.9, 2.0)  # by which a servo's gain is usually off, and may be: few makers say it
CLOSEST, STARTS = 4, 3  # of what bands say, that are compared with start states fitted, in so many steps


def is_structure(candidate: Candidate) -> bool:
    """Whether it is a body or a motor that is off: a payload, a mass, a gain, gravity that a controller holds."""
    if candidate.variant:
        return False
    family, on = candidate.family, candidate.place.on
    return family in ("payload", GAIN, HELD) or (family == "parameter_offset" and on.endswith((MASS, STIFF)))


def rise_of(candidate: Candidate) -> Candidate | None:
    """By how much a joint's dry friction grows as it slows, where its Stribeck friction may be asked."""
    if candidate.family != STRIBECK or candidate.variant:
        return None
    place = candidate.place
    return replace(candidate, variant=RISE, declared=declared(effect_of(STRIBECK), place, RISE))


def is_law(term: Term) -> bool:
    """Whether it is a force by position and speed, everywhere: what it does along a motion is known without a row."""
    effect, one = term.effect, np.zeros(1)
    if not isinstance(effect, ForceEffect) or term.gate or term.owners:
        return False
    values = {name: np.full(1, value) for name, value in term.values.items()}
    return effect.force(one, one, values) is not None


def by_inverse_dynamics(
    problem: Problem,
    recording: Recording,
    rows: Hypothesis,
    others: Sequence[Candidate] = (),
    delays: Sequence[Candidate] = (),
    rises: Sequence[Candidate] = (),
) -> Hypothesis | None:
    """Rows (see `is_row`) sized by the forces that the base lacks, with late commands and what else is surely off.

    others: bodies and motors that may be off (see `is_structure`). rises: of dry friction (see `rise_of`). None where
    motion does not tell (a body that floats, episodes that are too short), or where all that is further off in
    simulation than the rows as they are.
    """
    simulator = problem.simulator
    sized = all(is_row(t.effect) and len(t.values) == 1 for t in rows.terms)
    if closed(simulator) is None or not sized or len(simulator.state) != 2 * len(simulator.coordinates):
        return None
    starts, found = problem.windows.measured[None, :, 0], [rows]
    for wide, narrow in CUTOFFS.items():
        motion = low_passed(simulator, recording, wide)
        if motion is not None:
            forces = Forces(problem, recording.dt, motion, rows)
            for below in narrow:
                found += Regression(forces, below, tuple(delays)).found(others, rises)
    left = [problem.residuals(h, h.theta[None], starts)[0] for h in found]
    near = [int(i) for i in np.argsort([objective(problem, one) for one in left])[:CLOSEST]]
    best = _likeliest(problem, found, left, near)
    return found[best] if best else None


def _likeliest(
    problem: Problem, found: Sequence[Hypothesis], left: Sequence[FloatArray], near: Sequence[int]
) -> int:
    """Which of those near the best is likeliest, its start states fitted: noisy speeds decide between them else."""
    starts, first = problem.windows.measured[:, 0], near[0]
    known = state_jacobian(problem, found[first], starts, left[first])
    fits = [fit(problem, found[i].frozen(), starts, iterations=STARTS, known=known) for i in near]
    return near[int(np.argmin([f.objective for f in fits]))]


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

    def of_rise(self, offer: Offer, about: tuple[float, ...]) -> FloatArray:
        """(N, C, 2): what friction adds that grows by 1 as the joint slows, and that times a change of the speed."""
        joint = self.joint(offer.candidate.place.on)
        speed, slow = self._path(joint)[1], about[1]
        out = np.zeros((*self.motion.acceleration.shape, 2))
        fall = -np.exp(-((speed / slow) ** 2)) * _way(speed)
        out[:, joint, 0], out[:, joint, 1] = fall, fall * 2.0 * speed**2 / slow**3
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


@dataclass(frozen=True)
class Regression:
    """A least squares of forces below a share of the Nyquist frequency."""

    forces: Forces
    narrow: float
    delays: tuple[Candidate, ...]

    def found(self, others: Sequence[Candidate], rises: Sequence[Candidate] = ()) -> list[Hypothesis]:
        """Rows and late commands, and with what else is off where something is; nothing where too little moved."""
        rows = self.rows_part()
        if rows.columns.shape[1] < 2 * len(rows.usual):
            return []
        late, parts = self.again(self._late([rows]), [rows])
        out = [self._hypothesis(*self.fitted(late, parts))]
        late, parts = self._with_more(late, parts, others)
        out += [self._hypothesis(*self.fitted(late, parts))] if len(parts) > 1 else []
        if slowing := self._rising(late, parts, rises):
            late, parts = self._with_more(*self.again(late, [*parts, *slowing]), others)
            out.append(self._hypothesis(*self.fitted(late, parts)))
        return out

    def _with_more(
        self, late: float, parts: list[Part], others: Sequence[Candidate]
    ) -> tuple[float, list[Part]]:
        """With every body and motor that is surely off, until there are `MOST` of them."""
        taken = {place for p in parts if p.offer for place in p.offer.places}
        left = [
            self.part(o, tuple(p.starts[0] for p in o.declared), late)
            for o in offered(others)
            if not o.places & taken
        ]
        most = MOST + sum(p.offer is not None and p.offer.family == STRIBECK for p in parts)
        while left and len(parts) <= most and (more := self._one_more(late, parts, left)):
            assert more.offer is not None
            left = [p for p in left if p.offer and not p.offer.places & more.offer.places]
            late, parts = self.again(self._late([*parts, more]), [*parts, more])
        return late, parts

    def _rising(self, late: float, parts: Sequence[Part], rises: Sequence[Candidate]) -> list[Part]:
        """Of joints whose dry friction surely grows as they slow, by how much; none where they are no more than half.

        Joints are alike: of one alone something else is likelier.
        """
        lacks = self.lacks(late)
        (rows, _), *others = split(*self.fitted(late, parts)[:2])
        for part, sizes in others:
            lacks = lacks - np.tensordot(sizes, part.columns, 1)
        found = [self._rise(candidate, lacks, rows) for candidate in rises]
        kept = [part for part in found if part]
        return kept if 2 * len(kept) > lacks.shape[1] else []

    def _rise(self, candidate: Candidate, lacks: FloatArray, rows: Part) -> Part | None:
        """How a joint's dry friction grows as it slows, about the likeliest speed, where that is sure."""
        joint = [self.forces.joint(candidate.place.on)]
        alone, own = lacks[:, joint], _at(rows, joint)
        enough, found = least_squares(alone, [own]).evidence + ENOUGH, None
        for share in SLOWER:
            part = self.part(Offer(candidate), (1.0, share * candidate.place.speed), 0.0)
            fit = least_squares(alone, [own, _first(_at(part, joint))])
            if fit.evidence > enough and fit.sizes[-1] > 0.0:
                enough, found = fit.evidence, part
        return found

    def again(self, late: float, parts: Sequence[Part]) -> tuple[float, list[Part]]:
        """How late commands come, and rows and bodies linearised where they were found."""
        every, fit, late = self.fitted(late, parts)
        about = {p.offer: p.values(s) for p, s in split(every, fit) if p.offer}
        return late, [parts[0], *(self.part(o, v, late) for o, v in about.items())]

    def fitted(self, late: float, parts: Sequence[Part]) -> tuple[list[Part], Sized, float]:
        """Rows, bodies and how late commands come, fitted: all parts, their sizes, and how late then."""
        rows, *off = parts
        lateness = self.lateness(late)
        every = [rows, *lateness, *off]
        fit = least_squares(self.lacks(late), every)
        return every, fit, late + sum(float(fit.sizes[len(rows.usual)]) for _ in lateness)

    def _heard(self, force: FloatArray) -> FloatArray:
        return self.forces.motion.heard(force, self.narrow)

    def _columns(self, force: FloatArray) -> FloatArray:
        return np.moveaxis(self._heard(force), -1, 0)

    def lacks(self, late: float) -> FloatArray:
        """(K, C): what the base lacks where commands come late by so many s."""
        return self._heard(self.forces.lacking(late))

    def _late(self, parts: list[Part]) -> float:
        """How late commands come (s), by a scan; at once where that is as good."""
        if not self.delays:
            return 0.0
        scanned = [float(late) for late in np.arange(0.0, LATEST + GRID / 2.0, GRID) * self.forces.dt]
        evidence = [least_squares(self.lacks(late), parts).evidence for late in scanned]
        best = int(np.argmax(evidence))
        return scanned[best] if evidence[best] > evidence[0] + ENOUGH else 0.0

    def lateness(self, late: float) -> list[Part]:
        """How forces change where commands come later still; none where they come at once."""
        if not late:
            return []
        dt = self.forces.dt
        more = LATER * dt
        change = (self.lacks(late) - self.lacks(late + more))[None] / more
        low, high = np.array([-late]), np.array([LATEST * dt - late])
        return [Part(None, change, low, high, np.array([GRID * dt]))]

    def rows_part(self) -> Part:
        """Every row, at its own joint."""
        declared = self.forces.rows.parameters
        low, high = (np.array([getattr(p, end) for p in declared]) for end in ("low", "high"))
        usual = [ROW * max(abs(v) for v in p.starts) for p in declared]
        return Part(None, self._columns(self.forces.of_rows()), low, high, np.array(usual))

    def of_rotor(self, joint: str) -> FloatArray:
        """(1, K, C): what a rotor of size 1 takes."""
        coordinates, acceleration = self.forces.problem.simulator.coordinates, self.forces.motion.acceleration
        own = np.array([c.name == joint for c in coordinates])
        return self._columns((-acceleration * own)[..., None])

    def part(self, offer: Offer, about: tuple[float, ...], late: float) -> Part:
        """A body or a motor that is off: what it changes about these values."""
        declared = offer.declared
        if offer.of_command:
            change = self._columns(self.forces.of_gain(offer, late))
            if offer.family == GAIN:
                off = np.array([MISTAKEN])
                return Part(offer, change, -TWICE * off, TWICE * off, off, gain=True)
            low, high = (np.array([edge]) for edge in FACTOR)
            return Part(offer, change, low, high, np.array([UNKNOWN]), gain=True)
        if offer.family == STRIBECK:
            usual = np.array([declared[0].scale, declared[0].scale * declared[1].scale])
            low, high = np.array([0.0, -np.inf]), np.array([declared[0].high, np.inf])
            return Part(
                offer, self._columns(self.forces.of_rise(offer, about)), low, high, usual, np.array(about[1:])
            )
        change, off = self._columns(self.forces.of_body(offer, about)), np.array([OFF])
        if offer.family == HELD:
            low, high = np.array([declared[0].low]), np.array([declared[0].high])
            return Part(offer, change, low, high, np.ones(1))
        if offer.family != "payload":
            return Part(offer, change, -TWICE * off, TWICE * off, off)
        heavy = (declared[0].plausible or (0.0, declared[0].high))[1] / 2.0
        usual = np.array([heavy, *(heavy * p.scale for p in declared[1:])])
        moments = np.full(len(declared) - 1, np.inf)
        low, high = np.array([0.0, *-moments]), np.array([declared[0].high, *moments])
        return Part(offer, change, low, high, usual, np.array(about[1:]))

    def _one_more(self, late: float, parts: Sequence[Part], left: Sequence[Part]) -> Part | None:
        """Of what is left what brings most evidence, where that is enough."""
        lacks, every = self.lacks(late), [*parts, *self.lateness(late)]
        best, found = least_squares(lacks, every), None
        enough = best.evidence + ENOUGH
        for part in left:
            if found and found.offer and found.offer.also:
                break  # one make of servo comes first: it is asked first, and is likelier than one servo that differs
            fit = least_squares(lacks, [*every, part], best.left)
            if fit.evidence > enough and part.sensible(fit.sizes[-len(part.usual) :]):
                enough, found = fit.evidence, part
        return found

    def _hypothesis(self, parts: Sequence[Part], fit: Sized, late: float) -> Hypothesis:
        """The hypothesis that least squares say."""
        out = self.forces.rows.having(fit.sizes[: len(parts[0].usual)])
        for part, sizes in split(parts, fit):
            if part.offer is not None:
                out = out.plus(part.offer.term(part.values(sizes)), part.offer.declared)
        if self.delays and late:
            first, *others = self.delays
            declared = first.declared[0]
            term = first.term((float(np.clip(late, declared.low, declared.high)),))
            out = out.plus(replace(term, also=tuple(c.place.on for c in others)), first.declared)
        return out


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


def _first(part: Part) -> Part:
    """What the first of its values changes."""
    columns, low, high, usual = part.columns[:1], part.low[:1], part.high[:1], part.usual[:1]
    return replace(part, columns=columns, low=low, high=high, usual=usual)


def _at(part: Part, joints: Sequence[int]) -> Part:
    """What it changes at some joints."""
    return replace(part, columns=part.columns[..., joints])
