"""What the forces on a robot's joints say of the sizes in an account that a search has found.

A simulation takes commands as exact. Where they are torques that somebody measured, their noise drives the simulation
and not the robot, and a fit makes that less by rotors, masses and friction that are too large. Least squares of forces,
below a frequency, have that noise on the side where they expect it (Janot, Vandanjon and Gautier 2014, IEEE
Transactions on Control Systems Technology 22(1), compare both).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Candidate, Hypothesis, Problem, is_row
from gpsim.diagnosis.setup.asked import LATE, is_law, is_structure, rises_of
from gpsim.diagnosis.setup.force_parts import Offer, Part, Sized, least_squares, split
from gpsim.diagnosis.setup.forces import Forces
from gpsim.diagnosis.setup.inverse_dynamics import CUTOFFS
from gpsim.diagnosis.setup.low_passed import low_passed
from gpsim.diagnosis.setup.regression import Regression
from gpsim.effects import RISE, Term, closed
from gpsim.recordings import Recording
from gpsim.simulators import Simulator

ROWS_A_PARAMETER = 4  # at least, below which the scatter of blocks says nothing
BLOCKS = 8  # of rows in their order, each of which is left out once
OF_MEDIAN = 1.48  # times a median deviation is the standard one, of normal numbers
AGAIN = 2  # times bodies are linearised where they were found


@dataclass(frozen=True)
class Sizes:
    """An account with the values that forces say, and how uncertain these are together (P, P): 0 of one that stayed."""

    account: Hypothesis
    covariance: FloatArray


@dataclass(frozen=True)
class _Asked:
    """Which terms of an account are rows, which bodies and motors, which one says that commands are late.

    laws: other forces, whose values stay.
    """

    rows: tuple[int, ...]
    bodies: dict[int, Offer]
    laws: tuple[int, ...]
    late: int | None
    candidate: Candidate | None


def by_forces(
    problem: Problem, recording: Recording, account: Hypothesis, offers: Sequence[Candidate]
) -> list[Sizes]:
    """The account's values in each band of frequencies, as uncertain as these differ.

    Empty where forces do not say all of them.
    """
    simulator, asked = problem.simulator, _asked(problem.simulator, account, offers)
    if closed(simulator) is None or asked is None or len(simulator.state) != 2 * len(simulator.coordinates):
        return []
    rows = account.without_all([i for i in range(len(account.terms)) if i not in asked.rows])
    laws = tuple(account.terms[i] for i in asked.laws)
    delays = (asked.candidate,) if asked.candidate else ()
    found = []
    for wide, narrow in CUTOFFS.items():
        motion = low_passed(simulator, recording, wide)
        if motion is not None:
            forces = Forces(problem, recording.dt, motion, rows, laws)
            found += [_sizes(Regression(forces, below, delays), account, asked) for below in narrow]
    return _widened([sizes for sizes in found if sizes is not None])


def _asked(simulator: Simulator, account: Hypothesis, offers: Sequence[Candidate]) -> _Asked | None:
    """What each term is; None where one of them is something else, or differs between recordings."""
    rows, bodies, laws, late = [], {}, [], []
    known = {(c.identity, c.variant): c for c in (*rises_of(simulator, offers), *offers)}
    for i, (term, declared) in enumerate(zip(account.terms, account.declared, strict=True)):
        candidate = known.get((term.identity, term.variant))
        fixed = tuple(term.values.values())[len(declared) :]
        if term.gate or term.owners or candidate is None or (fixed and term.variant != RISE):
            return None
        if term.family == LATE:
            late.append((i, candidate))
        elif is_structure(candidate) or term.variant == RISE:
            bodies[i] = Offer(candidate, term.also, fixed)
        elif is_row(term.effect) and len(declared) == 1:
            rows.append(i)
        elif is_law(term):
            laws.append(i)
        else:
            return None
    if len(late) > 1 or not rows:
        return None
    index, first = late[0] if late else (None, None)
    return _Asked(tuple(rows), bodies, tuple(laws), index, first)


def _widened(found: Sequence[Sizes]) -> list[Sizes]:
    """Uncertain by as much as bands usually differ: what an account leaves out does not act alike in all of them."""
    every = np.array([sizes.account.theta for sizes in found])
    out = []
    for i, sizes in enumerate(found if len(found) > 1 else ()):
        apart = OF_MEDIAN * np.median(np.abs(np.delete(every, i, axis=0) - sizes.account.theta), axis=0)
        own = np.sqrt(np.maximum(np.diag(sizes.covariance), np.finfo(float).tiny))
        ratio = np.maximum(apart / own, 1.0)
        out.append(replace(sizes, covariance=sizes.covariance * np.outer(ratio, ratio)))
    return out or list(found)


def _sizes(regression: Regression, account: Hypothesis, asked: _Asked) -> Sizes | None:
    """By one regression; None where too few rows tell."""
    late = account.terms[asked.late].values["delay"] if asked.late is not None else 0.0
    parts = [regression.rows_part()]
    if parts[0].columns.shape[1] < ROWS_A_PARAMETER * len(account.parameters):
        return None
    parts += [regression.part(o, _values(account.terms[i], o), late) for i, o in asked.bodies.items()]
    for _ in range(AGAIN):
        late, parts = regression.again(late, parts)
    every, fit, _ = regression.fitted(late, parts)
    if any(len(part.centre) and sizes[0] <= 0.0 for part, sizes in split(every, fit)):
        return None  # a payload that weighs nothing is nowhere
    theta, slope = _theta(account, asked, split(every, fit), late)
    covariance = slope @ _covariance(regression.lacks(late), every, fit) @ slope.T
    return Sizes(account.having(theta), covariance)


def _theta(
    account: Hypothesis, asked: _Asked, sized: Sequence[tuple[Part, FloatArray]], late: float
) -> tuple[FloatArray, FloatArray]:
    """(P,) the account's parameters as least squares size them, and how they change with these sizes (P, sizes)."""
    first = np.cumsum([0, *(len(group) for group in account.declared)])
    theta = np.array(account.theta)
    slope = np.zeros((len(theta), sum(len(sizes) for _, sizes in sized)))
    at, bodies = 0, list(asked.bodies)
    for k, (part, sizes) in enumerate(sized):
        own = np.arange(at, at + len(sizes))
        if part.offer is not None:
            index = bodies[k - len(sized)]
            rows = np.arange(first[index], first[index + 1])
            theta[rows] = part.values(sizes)
            slope[np.ix_(rows, own)] = _of_payload(part, sizes) if len(part.centre) else np.eye(len(sizes))
        elif k == 0:
            rows = first[list(asked.rows)]
            theta[rows] = sizes
            slope[rows, own] = 1.0
        elif asked.late is not None:
            theta[first[asked.late]] = late + sizes[0]
            slope[first[asked.late], at] = 1.0
        at += len(sizes)
    return theta, slope


def _of_payload(part: Part, sizes: FloatArray) -> FloatArray:
    """(4, 4): mass and place by mass and first moments about where it was taken to be."""
    slope = np.eye(len(sizes)) / sizes[0]
    slope[0, 0] = 1.0
    slope[1:, 0] = -sizes[1:] / sizes[0] ** 2
    return np.asarray(slope)


def _covariance(lacks: FloatArray, parts: Sequence[Part], fit: Sized) -> FloatArray:
    """(P, P) the model's own, as much larger as blocks of rows scatter more (Efron 1982, the jackknife)."""
    kept = [np.ones(len(lacks), dtype=bool) for _ in range(BLOCKS)]
    for one, rows in zip(kept, np.array_split(np.arange(len(lacks)), BLOCKS), strict=True):
        one[rows] = False
    less = [[replace(part, columns=part.columns[:, one]) for part in parts] for one in kept]
    said = np.array([least_squares(lacks[one], p, fit.left).sizes for one, p in zip(kept, less, strict=True)])
    scatter = (BLOCKS - 1) / BLOCKS * ((said - said.mean(axis=0)) ** 2).sum(axis=0)
    own = np.diag(fit.covariance)
    ratio = np.sqrt(np.maximum(scatter / np.maximum(own, np.finfo(float).tiny), 1.0))
    return np.asarray(fit.covariance * np.outer(ratio, ratio))


def _values(term: Term, offer: Offer) -> tuple[float, ...]:
    return tuple(float(term.values[p.name]) for p in offer.declared)
