"""What an account is worth: on rollouts it did not learn from, beyond noise, effect by effect, half by half."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.attribution import attribute, explained_by, fits_without, support, supported
from gpsim.diagnosis.attribution.plainer import plainer
from gpsim.diagnosis.attribution.rollout_windows import rollout_windows
from gpsim.diagnosis.attribution.support import _hidden, _spare, _stands_in, holds_in_halves
from gpsim.diagnosis.fitting import Hypothesis, fit
from gpsim.diagnosis.report import Share
from gpsim.diagnosis.settings import Settings
from gpsim.diagnosis.setup import offers_of
from gpsim.effects import Gate, effect_of
from gpsim.recordings import HeldOut

from . import laws
from .worlds import World

BRAKED = World("slider", forces={0: lambda q, v, t: -1.2 * v - 0.6 * q})
LAWS = ("viscous_friction", "q"), ("spring", "q")


@pytest.fixture(scope="module")
def braked():
    return laws.explained_by(BRAKED, *LAWS)


def null_of(question, scheme="fine"):
    problem = question.everything
    return fit(problem, Hypothesis(scheme=scheme), problem.windows.measured[:, 0])


def test_the_right_laws_explain_it_all_and_what_they_are_of_it_adds_up(braked):
    question, leader = braked
    found = attribute(question, leader, null_of(question))
    assert found.explained.judged_on == "held-out rollouts"
    assert found.share.share > 0.99
    assert found.share.low > 0.98
    assert sum(part.share for part in found.importance) == pytest.approx(found.share.share)
    assert found.roles == ("headline", "headline")
    assert all(0.01 < part.low <= part.share <= part.high for part in found.needed)
    assert set(found.explained.channels) == {"q", "q_dot"}


def test_what_is_left_of_the_right_laws_is_what_noise_makes(braked):
    question, leader = braked
    found = attribute(question, leader, null_of(question))
    left, floor = found.squares.sum(axis=0), found.judge.mismatch.floor.sum(axis=0)
    assert left == pytest.approx(floor, rel=0.25)


def test_a_law_that_is_not_there_is_slight():
    question, leader = laws.explained_by(BRAKED, *LAWS, ("quadratic_drag", "q"))
    found = attribute(question, leader, null_of(question))
    assert found.roles == ("headline", "headline", "slight")
    assert abs(found.needed[2].share) < 0.003


def test_laws_that_explain_the_same_share_it_and_neither_is_needed_alone():
    question, leader = laws.explained_by(
        World("slider", forces={0: lambda q, v, t: 1.5 + 0.0 * v}),
        ("constant_force", "q"),
        ("actuator_bias", "force"),
    )
    found = attribute(question, leader, null_of(question))
    assert found.share.share > 0.99
    assert all(part.share == pytest.approx(0.0, abs=0.01) for part in found.needed)


@pytest.mark.parametrize(
    ("importance", "needed", "spare"),
    [(0.3, 0.001, True), (0.3, 0.03, False), (0.3, 0.1, False), (0.02, 0.001, False)],
)
def test_what_explains_much_and_is_not_needed_is_spare(importance, needed, spare):
    found = SimpleNamespace(
        importance=(Share(importance, importance, importance),),
        needed=(Share(needed, needed, needed),),
        share=Share(0.95, 0.93, 0.97),
    )
    assert _spare(found, 0, Settings()) == spare


@pytest.mark.parametrize(
    ("role", "importance", "hidden"),
    [
        ("slight", 0.0016, True),
        ("slight", -0.001, True),
        ("slight", 0.004, False),
        ("headline", 0.001, False),
    ],
)
def test_what_is_slight_and_explains_nothing_hides_behind_a_models_own_step(role, importance, hidden):
    found = SimpleNamespace(roles=(role,), importance=(Share(importance, importance, importance),))
    assert _hidden(found, 0, Settings()) == hidden


@pytest.mark.parametrize(
    ("family", "role", "needed", "low", "stands_in"),
    [
        ("cubic_spring", "slight", 0.004, -0.001, True),
        ("cubic_spring", "slight", 0.004, 0.002, False),  # surely needed
        ("cubic_spring", "slight", 0.02, -0.001, False),
        ("cubic_spring", "headline", 0.004, -0.001, False),
        ("constant_force", "slight", 0.004, -0.001, False),  # what every machine may have
    ],
)
def test_what_is_slight_and_unusual_has_to_explain_more_than_what_nobody_names(
    family, role, needed, low, stands_in
):
    leader = SimpleNamespace(hypothesis=SimpleNamespace(terms=(SimpleNamespace(effect=effect_of(family)),)))
    found = SimpleNamespace(roles=(role,), needed=(Share(needed, low, 0.03),), share=Share(0.99, 0.98, 1.0))
    assert _stands_in(leader, found, 0) == stands_in


def test_of_two_that_share_what_they_explain_one_goes_where_more_is_left_than_chance_makes():
    question, leader = laws.explained_by(
        World("slider", forces={0: lambda q, v, t: 1.5 + 0.0 * v}),
        ("constant_force", "q"),
        ("actuator_bias", "force"),
    )
    left = supported(question, leader, null_of(question), structured=True).hypothesis
    assert len(left.terms) == 1
    assert left.theta == pytest.approx([1.5], rel=0.02)


def test_with_few_blocks_held_out_all_of_it_is_judged_in_turn(braked):
    question, leader = braked
    few = replace(question, recording=replace(question.recording, held_out=HeldOut(share=0.02)))
    places = rollout_windows(few)
    assert places.judged_on == "cross-fitted rollouts"
    assert set(places.fold) == set(range(5))
    assert all(
        len(set(places.fold[places.block == b])) == 1 for b in range(places.blocks)
    )  # no block is torn
    found = attribute(few, leader, null_of(few))
    assert found.explained.judged_on == "cross-fitted rollouts"
    assert found.share.share > 0.99
    values = {h.theta[0] for h in found.judge.leaders}
    assert len(values) == 5  # each part's own


def test_nothing_counts_where_nothing_is_missing():
    question, _ = laws.explained_by(World("slider"), ("viscous_friction", "q"))
    null = null_of(question)
    found = attribute(question, null, null)
    assert not found.explained.counts
    assert found.share.share == 0.0


def test_a_share_of_another_recording_needs_no_fit(braked):
    question, leader = braked
    frozen = replace(leader, hypothesis=leader.hypothesis.frozen())
    found = explained_by(question, frozen, null_of(question))
    assert found.rollout.share > 0.99


REGION = Gate(region={"q": (-0.4, 0.1)})


def pushed(force, **how):
    """The right laws, and a constant force in a region, fitted to a world with that force on top."""

    def whole(q, v, t):
        return -1.2 * v - 0.6 * q + np.where((q > -0.4) & (q < 0.1), force(t), 0.0)

    world, every = World("slider", forces={0: whole}), (*LAWS, ("constant_force", "q"))
    return laws.explained_by(world, *every, gates=(None, None, REGION), **how)


def halves(question, leader):
    without = fits_without(question.everything, leader, null_of(question))
    return holds_in_halves(question.everything, leader, without[2], 2)


def test_a_term_behind_a_gate_that_mends_nothing_goes():
    question, leader = pushed(lambda t: 0.0 * t)
    left = supported(question, leader, null_of(question), structured=False)
    assert left.hypothesis.claims == {*LAWS}


def test_a_push_in_a_region_holds_in_both_halves():
    question, leader = pushed(lambda t: 0.8)
    assert halves(question, leader)
    assert supported(question, leader, null_of(question), structured=False) is leader


def test_a_push_in_a_region_needs_its_gate():
    question, leader = pushed(lambda t: 0.8)
    assert plainer(question.everything, leader, attribute(question, leader, null_of(question)), ()) is None


def test_a_region_that_hides_nothing_is_no_part_of_a_law():
    world = World("slider", forces={0: lambda q, v, t: -1.2 * v - 0.6 * q + 0.5})
    nearly_all = Gate(region={"q": (-0.9, 0.9)})
    question, leader = laws.explained_by(
        world, *LAWS, ("constant_force", "q"), gates=(None, None, nearly_all)
    )
    wider = plainer(question.everything, leader, attribute(question, leader, null_of(question)), ())
    assert not any(term.gate for term in wider.hypothesis.terms)
    assert supported(question, leader, null_of(question), structured=True).hypothesis.terms[-1].gate == Gate()


def test_what_paid_by_its_gate_alone_goes_with_it(monkeypatch):
    """A region that mends what nobody names is opened; everywhere its law pays for nothing."""
    question, wider = laws.explained_by(BRAKED, *LAWS, ("quadratic_drag", "q"))
    answers = iter([wider])
    monkeypatch.setattr(support, "plainer", lambda *asked: next(answers, None))
    monkeypatch.setattr(support, "_unsupported", lambda *asked: None)
    left = supported(question, wider, null_of(question), structured=True)
    assert left.hypothesis.claims == {*LAWS}


@pytest.mark.parametrize(("at_rest", "plain"), [(1.0, True), (2.5, False)])
def test_a_law_takes_its_plainer_form_where_no_rollout_misses_what_it_says_beyond(at_rest, plain):
    """Dry friction that is hardly larger at rest is told as Coulomb friction; one that is far larger is not."""
    law = {0: lambda q, v, normal: 0.5 * (1.0 + (at_rest - 1.0) * np.exp(-((v / 0.15) ** 2)))}
    unnamed = {0: lambda q, v, t: 0.1 * np.sin(9.0 * q)}
    question, leader = laws.explained_by(
        World("slider", forces=unnamed, grips=law), ("stribeck_friction", "q")
    )
    found = attribute(question, leader, null_of(question))
    less = plainer(question.everything, leader, found, offers_of(question))
    assert (less is not None) == plain
    assert less is None or [t.family for t in less.hypothesis.terms] == ["coulomb_friction"]


def test_a_gate_beside_the_same_law_everywhere_is_kept():
    question, leader = laws.explained_by(
        World("slider", forces={0: lambda q, v, t: 0.5 + 0.0 * v}),
        ("constant_force", "q"),
        ("constant_force", "q"),
        gates=(None, REGION),
    )
    assert plainer(question.everything, leader, attribute(question, leader, null_of(question)), ()) is None


def test_a_push_of_one_half_alone_does_not_hold():
    """It mends what a nuisance did in the first half of the recording."""
    question, leader = pushed(lambda t: np.where(t < 25.0, 0.4, 0.0), session=True)
    assert not halves(question, leader)
