"""Which bodies, rotors and motors may stand in another's place: the recording shows their sum alone.

Of a robot's inertial parameters some show in no motion but by their sums, the base parameters (Gautier 1991, Journal of
Robotic Systems 8(4)); of others the sum shows best in this one. In the forces that its motion took each parameter is a
direction: what a told one brings, with all else adapted, another brings as well where both point the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Hypothesis, Problem, is_row
from gpsim.diagnosis.setup.asked import LATE, is_structure
from gpsim.diagnosis.setup.force_parts import HELD, Offer, Part, least_squares
from gpsim.diagnosis.setup.forces import Forces
from gpsim.diagnosis.setup.low_passed import low_passed
from gpsim.diagnosis.setup.regression import Regression
from gpsim.effects import Term, closed
from gpsim.recordings import Recording

WIDE, NARROW = 0.2, 0.06  # bands of motion and forces (see `inverse_dynamics.CUTOFFS`): the middle one of its
SHOWS = 10.0  # nats that a parameter must bring to be asked after, as many as bring it in
NO_LOSS = 2.0  # nats that forces may lose where another stands in its place: nobody notices
SAME_WAY = 0.95  # squared cosine of both directions, at least: what is slight and noisy resembles much
MOST = 2  # others that are told of one


@dataclass(frozen=True)
class Alike:
    """A told term (its index) and a candidate that could stand in its place at `size`, from what is believed."""

    told: int
    other: Candidate
    size: float


def alike(
    problem: Problem, recording: Recording, told: Hypothesis, offers: Sequence[Candidate]
) -> list[Alike]:
    """Whatever could stand in the place of a rotor, a body or a gain that is told; empty where motion does not tell."""
    simulator, asked = problem.simulator, [i for i in range(len(told.terms)) if _is_asked(told, i, offers)]
    if closed(simulator) is None or not asked or len(simulator.state) != 2 * len(simulator.coordinates):
        return []
    motion = low_passed(simulator, recording, WIDE)
    if motion is None:
        return []
    is_rows = [
        is_row(t.effect) and len(declared) == 1 == len(t.values) and not t.gate and not t.owners
        for t, declared in zip(told.terms, told.declared, strict=True)
    ]
    rows = told
    for i in reversed(range(len(told.terms))):
        rows = rows if is_rows[i] else rows.without(i)
    regression = Regression(Forces(problem, recording.dt, motion, rows), NARROW, ())
    late = max((t.values.get("delay", 0.0) for t in told.terms if t.family == LATE), default=0.0)
    return _found(regression, late, told, [i for i, row in enumerate(is_rows) if row], asked, offers)


def _found(
    regression: Regression,
    late: float,
    told: Hypothesis,
    rows: Sequence[int],
    asked: Sequence[int],
    offers: Sequence[Candidate],
) -> list[Alike]:
    parts = [regression.rows_part(), *regression.lateness(late)]
    if parts[0].columns.shape[1] < 2 * len(told.parameters):
        return []
    bodies = {i: _candidate(told.terms[i], offers) for i in asked if i not in rows}
    own = {
        i: regression.part(Offer(c, told.terms[i].also), _values(told.terms[i], c), late)
        for i, c in bodies.items()
        if c
    }
    parts += own.values()
    root = np.sqrt(least_squares(regression.lacks(late), parts).left)
    of_rows = _flat(parts[0].columns, root)
    told_columns = {index: of_rows[k : k + 1] for k, index in enumerate(rows)}
    told_columns |= {i: _flat(part.columns, root) for i, part in own.items()}
    besides = [_flat(part.columns, root) for part in parts[1 : len(parts) - len(own)]]
    others = [(c, _flat(_other(regression, c, late), root)) for c in offers if _may_stand(c, told)]
    found: list[Alike] = []
    for index in (i for i in asked if i in told_columns):
        rest = [columns for i, columns in told_columns.items() if i != index] + besides
        brings = _moved(told.terms[index], own.get(index)) @ told_columns[index]
        found += _standing_in(index, brings, np.concatenate(rest) if rest else None, others)
    return found


def _standing_in(
    index: int, brings: FloatArray, rest: FloatArray | None, others: Sequence[tuple[Candidate, FloatArray]]
) -> list[Alike]:
    """What could bring what a term `brings` (N,), with the `rest` (P, N) adapted."""
    space = None if rest is None else np.linalg.qr(rest.T)[0]
    alone = _beside(brings, space)
    worth = float(alone @ alone) / 2.0
    found = []
    for candidate, columns in others if worth > SHOWS else ():
        other = _beside(columns[0], space)
        size = float(alone @ other) / max(float(other @ other), np.finfo(float).tiny)
        same = size * float(alone @ other) / (2.0 * worth)
        declared = candidate.declared[0]
        low, high = declared.plausible or (declared.low, declared.high)
        if same > SAME_WAY and worth * (1.0 - same) < NO_LOSS and low <= declared.none + size <= high:
            found.append((worth * (1.0 - same), Alike(index, candidate, size)))
    return [one for _, one in sorted(found, key=lambda pair: pair[0])[:MOST]]


def _is_asked(told: Hypothesis, index: int, offers: Sequence[Candidate]) -> bool:
    """Whether it is a rotor, a body or a gain that was fitted, to all recordings alike."""
    term = told.terms[index]
    alone = term.gate or term.owners or not told.declared[index]
    return not alone and (term.family == "armature" or _candidate(term, offers) is not None)


def _candidate(term: Term, offers: Sequence[Candidate]) -> Candidate | None:
    return next((c for c in offers if is_structure(c) and c.identity == term.identity), None)


def _may_stand(candidate: Candidate, told: Hypothesis) -> bool:
    """Whether it is a rotor, a mass or a gain that is not told."""
    one = candidate.family == "armature" or is_structure(candidate)
    return one and candidate.family not in ("payload", HELD) and candidate.identity not in told.claims


def _other(regression: Regression, candidate: Candidate, late: float) -> FloatArray:
    """(1, K, C) what a candidate of size 1 takes."""
    if candidate.family == "armature":
        return regression.of_rotor(candidate.place.on)
    about = tuple(p.starts[0] for p in candidate.declared)
    return regression.part(Offer(candidate), about, late).columns


def _values(term: Term, candidate: Candidate) -> tuple[float, ...]:
    return tuple(float(term.values[p.name]) for p in candidate.declared)


def _moved(term: Term, part: Part | None) -> FloatArray:
    """(P,) how far a term's columns are from what is believed: of a payload its mass about where it sits."""
    if part is None:
        return np.array(list(term.values.values()), dtype=float)
    assert part.offer is not None
    said = np.array(_values(term, part.offer.candidate)) - [p.none for p in part.offer.declared]
    return np.concatenate([said[:1], np.zeros(len(said) - 1)])


def _flat(columns: FloatArray, root: FloatArray) -> FloatArray:
    """(P, K C) in parts of the noise at each joint, `root` (C,)."""
    return np.asarray((columns / root).reshape(len(columns), int(np.prod(columns.shape[1:]))))


def _beside(direction: FloatArray, space: FloatArray | None) -> FloatArray:
    """What of a direction others do not bring; space: (N, P) orthonormal."""
    return direction if space is None else direction - space @ (space.T @ direction)
