"""What every joint of a robot has, friction, a rotor and an offset, and which of it an account gets almost for free.

A joint without friction is no likelier than a catalogue law is a priori: where most joints of a robot rub, the others
do, too (a hierarchical prior: Gelman et al. 2013, Bayesian Data Analysis, chapter 5). The price of the BIC would take
the friction of each joint that is known to half of its size alone, and what shares the motion with it, a bus that is
late or a mass, would stand in for all of it.
"""

from __future__ import annotations

from collections import defaultdict

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.problem import Problem
from gpsim.effects import RISE, Effect, closed

EVERY_JOINT = 9  # the rank of viscous and dry friction and of a rotor: no joint is without
FEWEST_JOINTS = 3  # of a robot, of which most joints say what the others are like
FREE_ROW = 1.0  # nats that a row which most joints have must bring (Akaike 1974)


def is_row(effect: Effect) -> bool:
    """Whether it is one of what every joint of a robot usually has: friction, a motor's inertia, an offset."""
    return bool(effect.usual) and (effect.site == "force" or effect.family == "armature")


def expected(problem: Problem, hypothesis: Hypothesis) -> frozenset[int]:
    """Rows of families that most joints have: friction, how it grows, rotors; offsets differ from joint to joint."""
    return frozenset(i for family in _of_most_joints(problem, hypothesis) for i in family)


def free(problem: Problem, hypothesis: Hypothesis) -> int:
    """How many of them there are beyond half of the joints: so many cost `FREE_ROW` each, and nothing else."""
    half = len(problem.simulator.coordinates) // 2
    return sum(len(family) - half for family in _of_most_joints(problem, hypothesis))


def _of_most_joints(problem: Problem, hypothesis: Hypothesis) -> list[list[int]]:
    """Which terms are rows, family by family, of those that more than half of the joints have."""
    joints = len(problem.simulator.coordinates)
    if closed(problem.simulator) is None or joints < FEWEST_JOINTS:
        return []
    rows: dict[str, list[int]] = defaultdict(list)
    for i, (term, declared) in enumerate(zip(hypothesis.terms, hypothesis.declared, strict=True)):
        plain = len(declared) == 1 and not term.gate and not term.owners
        of_every_joint = is_row(term.effect) and term.effect.usual >= EVERY_JOINT
        if plain and (of_every_joint or term.variant == RISE):  # bearings and gears are alike, too
            rows[term.family].append(i)
    return [family for family in rows.values() if 2 * len(family) > joints]
