"""The verdict: how much is explained decides, not whether something is left."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.judging import Attribution, Tried, claimed, doubts_of, verdict_of
from gpsim.diagnosis.settings import NOTHING_KNOWN, Known, Settings
from gpsim.effects import EffectParameter, Term
from gpsim.findings import BlackBox, Estimate, Explained, Odds, Share

GAIN = EffectParameter("gain", "1", -5.0, 5.0, (0.9,), 0.2, none=1.0)


def attribution(share, counts=True, roles=("headline",)):
    explained = Explained(rollout=share, counts=counts)
    return SimpleNamespace(share=share, explained=explained, roles=roles, importance=(share,) * len(roles))


def hypothesis(names, gains=None):
    """Actuator gains of 0.8, or what is said, each on the place of its name; `a` also says where it acts."""
    gains = gains or {}
    terms = tuple(
        Term("actuator_gain", n, {"gain": gains.get(n, 0.8), "place": gains.get(n, 0.8)}) for n in names
    )
    declared = (GAIN, EffectParameter("place", "m", -5.0, 5.0, (0.0,), 1.0, place=True))
    return Hypothesis(terms=terms, declared=(declared,) * len(terms))


def judgement(terms=("a",), rivals=(), structured=True, ranking=()):
    """rivals: each the names of its terms, or these with their gains."""
    others = [hypothesis(names, names if isinstance(names, dict) else None) for names in rivals]
    return SimpleNamespace(
        leader=SimpleNamespace(hypothesis=hypothesis(terms)),
        rivals=[SimpleNamespace(hypothesis=other) for other in others],
        probabilities=(1.0,) * (1 + len(others)),
        structured=structured,
        ranking=ranking,
    )


SIZE = {"gain": Estimate(0.8, 0.78, 0.82, "1")}


def said(judged, worth, forms=("holds",), sizes=None, box=None, known=NOTHING_KNOWN):
    """The verdict, and the doubts behind it."""
    sizes = sizes or (SIZE,) * len(judged.leader.hypothesis.terms)
    doubts = tuple(doubts_of(judged, worth, forms, sizes, box, Settings()))
    return verdict_of(judged, worth, doubts, Settings(), known), doubts


def verdict(*given, **named):
    return said(*given, **named)[0]


@pytest.mark.parametrize(
    ("share", "form", "rivals", "right"),
    [
        (Share(0.97, 0.95, 0.98), "holds", (), "named"),  # whatever trace is left
        (Share(0.97, 0.95, 0.98), "untested", (), "named"),
        (Share(0.97, 0.95, 0.98), "approximate", (), "partial"),
        (Share(0.97, 0.95, 0.98), "holds", [("another",)], "ambiguous"),
        (Share(0.80, 0.70, 0.89), "holds", [("another",)], "partial"),
        (Share(0.80, 0.70, 0.91), "holds", (), "named"),  # not surely less than nearly all
        (Share(0.80), "holds", (), "partial"),
        (Share(0.40, 0.30, 0.49), "holds", [("another",)], "unknown"),
        (Share(0.40, 0.30, 0.51), "holds", (), "partial"),
    ],
)
def test_the_explained_share_decides(share, form, rivals, right):
    assert verdict(judgement(rivals=rivals), attribution(share), (form,)) == right


@pytest.mark.parametrize(
    ("share", "p_value", "odds"), [(0.95, 1e-9, 3), (0.995, 1e-9, 1e6), (0.95, 0.5, 1e6)]
)
def test_odds_allow_for_a_law_that_no_catalogue_has(share, p_value, odds):
    told = Attribution.told(attribution(Share(share)), Odds(math.log(1e6), ()), p_value, Settings().verdict)
    assert told.nats == pytest.approx(math.log(odds), abs=0.01)


def test_the_form_of_a_slight_effect_never_counts():
    worth = attribution(Share(0.97, 0.95, 0.98), roles=("headline", "slight"))
    assert verdict(judgement(("a", "b")), worth, ("holds", "approximate")) == "named"


@pytest.mark.parametrize(
    ("rivals", "right"),
    [
        ([("a", "c")], "named"),  # it says something else of what is slight
        ([("a", "c"), ("a", "b", "d")], "named"),
        ([("a", "c"), ("c", "b")], "ambiguous"),
    ],
)
def test_rivals_that_share_every_headline_effect_contest_nothing(rivals, right):
    worth = attribution(Share(0.97, 0.95, 0.98), roles=("headline", "slight"))
    assert verdict(judgement(("a", "b"), rivals), worth, ("holds", "untested")) == right


def test_a_size_that_no_machine_has_is_not_named():
    worth = attribution(Share(0.97, 0.95, 0.98))
    usual = replace(hypothesis(("a",)), declared=((replace(GAIN, plausible=(0.5, 2.0)),),))
    for gain, right in ((0.8, "named"), (0.3, "named"), (0.2, "partial"), (-0.8, "partial")):
        judged = judgement()
        judged.leader.hypothesis = usual.having(np.array([gain]))
        assert verdict(judged, worth) == right, gain


def test_where_nothing_leads_nothing_is_named():
    worth = attribution(Share(0.97, 0.95, 0.98), roles=("slight",))
    assert said(judgement(("a",), [("b",)]), worth, ("untested",)) == ("partial", ("no claim",))


@pytest.mark.parametrize(("structured", "counts"), [(True, False), (False, True), (True, True)])
def test_a_share_is_missed_where_there_is_something_to_explain(structured, counts):
    """A sensor 10 ms late, of its exact size: no rollout shows it, and 0.80 of the windows' noise is explained."""
    low = attribution(Share(0.80, 0.73, 0.87), counts)
    assert verdict(judgement(structured=structured), low, ("untested",)) == "partial"
    nothing = attribution(Share(0.80, 0.73, 0.87), counts=False)
    assert verdict(judgement(structured=False), nothing, ("untested",)) == "named"


@pytest.mark.parametrize(
    ("structured", "counts", "right"),
    [(False, True, "none"), (True, False, "none"), (True, True, "unknown"), (False, False, "none")],
)
def test_without_an_effect_something_must_be_left_that_shows(structured, counts, right):
    bare = judgement(terms=(), structured=structured)
    assert verdict(bare, attribution(Share(0.0, 0.0, 0.0), counts), ()) == right


NEARLY_ALL = attribution(Share(0.998, 0.997, 0.999))


@pytest.mark.parametrize(
    ("box", "right"),
    [
        (None, "named"),
        (BlackBox("gp", Share(0.8, 0.6, 0.9)), "partial"),  # as much was reached by nonsense
        (BlackBox("curve", Share(0.4, 0.2, 0.6)), "named"),  # perhaps not by a quarter
        (BlackBox("after_gp", Share(0.3)), "partial"),
        (BlackBox("gp", Share(-2.0, -3.0, -1.0)), "named"),
    ],
)
def test_what_a_black_box_foresees_has_no_name(box, right):
    assert verdict(judgement(), attribution(Share(0.93, 0.91, 0.94)), box=box) == right
    assert verdict(judgement(), NEARLY_ALL, box=box) == "named"  # too little is left to doubt a name


@pytest.mark.parametrize(
    ("size", "doubt"),
    [
        (Estimate(-5.0, -5.0, -4.0, "1", at_bound=True), "bound"),
        (Estimate(1.05, 0.95, 1.15, "1"), "size"),  # its neutral value is 1
        (Estimate(0.8, 0.55, 0.99, "1"), "size"),  # 0.2 +- 0.22
        (Estimate(0.8, None, None, "1"), "size"),
    ],
)
def test_a_claim_of_no_certain_size_is_never_named(size, doubt):
    judged = judgement()
    judged.leader.hypothesis = Hypothesis(
        terms=(Term("actuator_gain", "u", {"gain": size.value}),), declared=((),)
    )
    assert said(judged, NEARLY_ALL, sizes=({"gain": size},)) == ("partial", (doubt,))


def test_one_of_two_gains_may_be_as_it_should():
    judged = judgement()
    terms = (Term("actuator_asymmetry", "u", {}),)
    judged.leader.hypothesis = Hypothesis(terms=terms, declared=((),))
    sizes = {"gain_positive": SIZE["gain"], "gain_negative": Estimate(1.0, 0.99, 1.01, "1")}
    assert verdict(judged, NEARLY_ALL, sizes=(sizes,)) == "named"


def test_of_a_force_of_0_and_1100_n_nothing_is_claimed():
    """Only their sum is known: a constant force of 0 +- 1100 N stood beside a bias of 0 +- 600 N."""
    terms = (
        Term("constant_force", "q", {"force": 0.4}),
        Term("actuator_bias", "u", {"bias": 0.2}),
        Term("actuator_gain", "u", {"gain": 1.1}),
    )
    judged = judgement()
    judged.leader.hypothesis = Hypothesis(terms=terms, declared=((),) * 3)
    sizes = (
        {"force": Estimate(0.4, -1100.0, 1100.0, "N")},
        {"bias": Estimate(0.2, -600.0, 600.0, "N")},
        {"gain": Estimate(1.1, 0.99, 1.21, "1")},  # vague, but known
    )
    worth = attribution(Share(1.0), roles=("headline",) * 3)
    assert claimed(judged, worth, sizes) == ("slight", "slight", "headline")


@pytest.mark.parametrize(("nats", "right"), [(0.0, "ambiguous"), (1.05, "ambiguous"), (1.15, "named")])
def test_odds_below_three_to_one_are_never_named(nats, right):
    """`named` stood twice beside odds of 1:1."""
    own = Tried(hypothesis(("a",)), 0.0)
    rival = Tried(hypothesis(("b",)), nats)
    assert verdict(judgement(ranking=(own, rival)), NEARLY_ALL) == right


@pytest.mark.parametrize(
    ("known", "counts", "verdict"),
    [
        (Known(), True, "none"),
        (Known(only=("spring",)), False, "none"),
        (Known(only=("spring",)), True, "unknown"),
        (Known(without=("spring",)), True, "unknown"),
    ],
)
def test_what_was_not_asked_for_is_not_ruled_out(known, counts, verdict):
    worth = attribution(Share(0.0), counts=counts, roles=())
    bare = judgement((), structured=False)
    assert said(bare, worth, (), known=known)[0] == verdict
    assert said(judgement(), NEARLY_ALL, known=known)[0] == "named"
