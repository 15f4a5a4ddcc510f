"""A least squares of forces: rows, and which bodies, motors and growing friction are surely off beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Hypothesis
from gpsim.diagnosis.setup.force_parts import GAIN, HELD, Offer, Part, Sized, least_squares, offered, split
from gpsim.diagnosis.setup.forces import MISTAKEN, OFF, Forces

LATEST, GRID = 2.0, 0.5  # samples that commands may be late, in steps of which that is scanned
LATER = 0.1  # samples, by which commands come later where that is asked
SLOWER = (0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4, 0.57, 0.8)
"""Of a joint's usual speed, below which its dry friction may grow: which it is shows little."""
ENOUGH = 10.0  # nats of evidence that a body, a motor or late commands must bring
MOST = 6  # bodies and motors that are off at once, at most
TWICE = 2.0  # times as much is the most: what is noisy is foreseen best by next to nothing
ROW = 3.0  # times its usual start, that a joint's row may well be
UNKNOWN, FACTOR = 0.5, (-0.9, 2.0)  # by which a servo's gain is usually off, and may be: few makers say it


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
        while rising := self._rising(late, parts, rises):
            late, parts = self._with_more(*self.again(late, [*parts, *rising]), others)
            out.append(self._hypothesis(*self.fitted(late, parts)))
            rises = [c for c in rises if c.family not in {p.offer.family for p in rising if p.offer}]
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
        most = MOST + sum(p.offer is not None and p.offer.rises for p in parts)
        while left and len(parts) <= most and (more := self._one_more(late, parts, left)):
            assert more.offer is not None
            left = [p for p in left if p.offer and not p.offer.places & more.offer.places]
            late, parts = self.again(self._late([*parts, more]), [*parts, more])
        return late, parts

    def _rising(self, late: float, parts: Sequence[Part], rises: Sequence[Candidate]) -> list[Part]:
        """Of joints whose dry friction surely grows, as they slow or under load, by how much: what is likelier.

        Joints are alike: of one alone something else is likelier.
        """
        lacks, most, best = self.lacks(late), 0.0, list[Part]()
        (rows, _), *others = split(*self.fitted(late, parts)[:2])
        for part, sizes in others:
            lacks = lacks - np.tensordot(sizes, part.columns, 1)
        for family in dict.fromkeys(c.family for c in rises):
            joints = [c for c in rises if c.family == family]
            by_load = len(joints[0].declared) == 1
            nats, found = (self._loaded if by_load else self._slowing)(joints, lacks, rows, late)
            if nats > most:
                most, best = nats, found
        return best

    def _slowing(
        self, joints: Sequence[Candidate], lacks: FloatArray, rows: Part, late: float
    ) -> tuple[float, list[Part]]:
        """How friction grows as joints slow, where that is sure of more than half, and the nats that it brings."""
        found = [self._slows(c, lacks, rows, late) for c in joints]
        kept = [(nats, part) for nats, part in found if part]
        if 2 * len(kept) <= lacks.shape[1]:
            return 0.0, []
        return sum(nats for nats, _ in kept), [part for _, part in kept]

    def _slows(
        self, candidate: Candidate, lacks: FloatArray, rows: Part, late: float
    ) -> tuple[float, Part | None]:
        """How a joint's dry friction grows below the likeliest speed, and the nats that it brings, where it is sure."""
        joint = [self.forces.joint(candidate.place.on)]
        alone, own = lacks[:, joint], _at(rows, joint)
        without, most, found = least_squares(alone, [own]).evidence, ENOUGH, None
        for share in SLOWER:
            part = self.part(Offer(candidate, fixed=(share * candidate.place.speed,)), (), late)
            fit = least_squares(alone, [own, _at(part, joint)])
            if fit.evidence > without + most and fit.sizes[-1] > 0.0:
                most, found = fit.evidence - without, part
        return most, found

    def _loaded(
        self, joints: Sequence[Candidate], lacks: FloatArray, rows: Part, late: float
    ) -> tuple[float, list[Part]]:
        """Which share of what motors give friction is, one of all joints.

        Gears are alike; and where a joint works against its friction alone, its share is whatever one likes.
        """
        first, *others = joints
        part = self.part(Offer(first, tuple(c.place.on for c in others)), (), late)
        fit = least_squares(lacks, [rows, part])
        nats = fit.evidence - least_squares(lacks, [rows]).evidence
        return (nats, [part]) if nats > ENOUGH and fit.sizes[-1] > 0.0 else (0.0, [])

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
        if offer.rises:
            low, high, usual = (np.array([edge]) for edge in (0.0, declared[0].high, declared[0].scale))
            return Part(offer, self._columns(self.forces.of_rise(offer, late)), low, high, usual)
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


def _at(part: Part, joints: Sequence[int]) -> Part:
    """What it changes at some joints."""
    return replace(part, columns=part.columns[..., joints])
