"""Several terms at once: what stands in for another law goes, and the other one comes, beside the usual machine."""

import numpy as np
import pytest

from gpsim.diagnosis.selection.reconsidered import reconsidered
from gpsim.diagnosis.selection.stepwise import _reconsidered
from gpsim.diagnosis.setup import candidates

from . import laws
from .worlds import World

HEAVY = World("cartpole", parameters={"cart_mass": 1.3}, forces={0: lambda q, v, t: -1.2 * np.abs(v) * v})
STAND_IN = ("quadratic_drag", "x"), ("parameter_offset", "pole_mass"), ("actuator_gain", "force")


@pytest.fixture(scope="module")
def stood_for():
    """A weaker drive and a lighter pole move as a heavier cart does, all forces scaled."""
    question, leader = laws.explained_by(HEAVY, *STAND_IN, episodes=8, steps=120, noise=0.1)
    problem = question.everything
    offers = candidates(question.recording, problem.simulator, problem.parameters)
    return problem, leader, offers, _reconsidered(problem, leader, offers)


def test_two_terms_make_room_for_one(stood_for):
    _, leader, _, found = stood_for
    assert leader.hypothesis.theta == pytest.approx([1.2 / 1.3, 1 / 1.3, 1 / 1.3], rel=0.05)
    heavy = [f for f in found if f.hypothesis.claims == {STAND_IN[0], ("parameter_offset", "cart_mass")}]
    assert heavy
    assert heavy[0].hypothesis.theta == pytest.approx([1.2, 1.3], rel=0.03)
    assert heavy[0].objective < leader.objective + 2.0


def test_what_is_right_stays(stood_for):
    problem, _, offers, found = stood_for
    right = min(found, key=lambda f: len(f.hypothesis.terms))
    assert right.hypothesis.claims == {STAND_IN[0], ("parameter_offset", "cart_mass")}
    for other in reconsidered(problem, right, offers):
        assert other.objective > right.objective - 10.0
