"""Odds against what does without an effect, and which recording separates three rivals."""

import numpy as np
import pytest
from made_diagnoses import made_diagnosis, made_effect

from gpsim.diagnosis.assessment.experiment_design import _advice
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.judgement.odds import odds_against
from gpsim.diagnosis.judgement.ranking import Ranked
from gpsim.diagnosis.report import Discrimination, Excitation, Odds, Separation
from gpsim.effects import Term
from gpsim.reports.account_effects import row_of
from gpsim.reports.statistics_text import effects_sheet
from gpsim.reports.wording import tell_apart_text

FRICTION = Term("coulomb_friction", "x", {"force": 1.0})
SPRING = Term("spring", "x", {"stiffness": 1.0, "rest_position": 0.0})
DRAG = Term("quadratic_drag", "x", {"drag": 1.0})
A, B, C = (("a", "x"),), (("b", "x"),), (("c", "x"), ("d", "y"))
SHARED = (("c", "y"), ("d", "x"))
VISIBLE = 1.0  # standard deviations
SLOW, FAST = Excitation("u", "slow wave", 2.0), Excitation("u", "fast wave", 2.0)


def said(*terms, behind, scheme="fine", everything=True):
    return Ranked(Hypothesis(terms, ((),) * len(terms), scheme), behind, everything)


def test_the_odds_are_those_against_the_best_that_lacks_the_effect():
    leader = said(FRICTION, SPRING, behind=0.5)
    ranking = [
        said(FRICTION, SPRING, DRAG, behind=0.0),  # says all of it and more: no rival
        leader,
        said(DRAG, SPRING, behind=7.0),
        said(FRICTION, behind=30.0),
        said(behind=200.0),
        said(DRAG, behind=1.0, scheme="euler"),  # coarse steps make up for much
    ]
    assert odds_against(ranking, leader.hypothesis, FRICTION.identity) == Odds(
        6.5, (("quadratic_drag", "x"), ("spring", "x"))
    )
    assert odds_against(ranking, leader.hypothesis, SPRING.identity).nats == 29.5


def test_what_the_search_gave_up_counts_by_its_own_windows():
    leader = said(FRICTION, behind=3.0)
    ranking = [leader, said(behind=90.0), said(DRAG, behind=12.0, everything=False)]
    assert odds_against(ranking, leader.hypothesis, FRICTION.identity).nats == 12.0


def test_a_richer_law_that_is_ahead_and_does_not_pay_is_no_rival():
    """Clean sensors: Stribeck's curve mends the last digits of Coulomb's friction, odds of 0 to 1 were printed."""
    leader = said(FRICTION, behind=71.6)
    mending = Ranked(Hypothesis((DRAG,), ((),), "fine"), 0.0, True, idle=True)
    found = odds_against([mending, leader, said(behind=90.0)], leader.hypothesis, FRICTION.identity)
    assert found.nats == pytest.approx(18.4)


def test_odds_and_probabilities_go_by_the_same_nats():
    """Nothing apart on training windows, 4.1 nats with the held-out ones: `named` stood beside odds of 1:1."""
    leader = said(FRICTION, behind=0.0)
    rival = Ranked(Hypothesis((DRAG,), ((),), "fine"), 0.0, True, in_all=4.1)
    assert odds_against([leader, rival], leader.hypothesis, FRICTION.identity).nats == 4.1


def test_three_rivals_of_which_two_are_one():
    """A recording separates the first from both others; nothing separates these two."""
    gaps = np.zeros((3, 2, 2))
    gaps[0, 1] = 5.0, 9.0
    gaps[1, 1] = 4.0, 2.0
    pairs = [(0, 1), (0, 2), (1, 2)]
    found = _advice(VISIBLE, ("q", "q_dot"), (SLOW, FAST), pairs, gaps, (A, B, C))
    assert found == Discrimination((Separation(FAST, (A, B, C), "q", 4.0),), ((B, C),))
    said = tell_apart_text(found)
    first, second = said.split("; ", 1)
    assert first == (
        "record a fast wave of u with amplitude 2: a on x and b on x and c on x with d on y then differ by up to "
        "4 standard deviations of the noise in q"
    )
    assert second.startswith(
        "b on x and c on x with d on y predict the same for every excitation that was tried: "
    )


def test_what_all_rivals_share_is_not_said():
    first, second = (*SHARED, ("a", "x")), (*SHARED, ("b", "x"))
    found = Discrimination((Separation(SLOW, (first, second, SHARED), "q", 78.81),), ())
    assert tell_apart_text(found).endswith(
        ": a on x and b on x and neither of them then differ by up to 78.8 standard deviations of the noise in q"
    )


def test_pairs_that_need_two_recordings_get_two():
    gaps = np.zeros((3, 2, 1))
    gaps[0, 0], gaps[1, 0], gaps[2, 1] = 3.0, 2.0, 6.0
    found = _advice(VISIBLE, ("q",), (SLOW, FAST), [(0, 1), (0, 2), (1, 2)], gaps, (A, B, C))
    assert [recording.excitation for recording in found.recordings] == [SLOW, FAST]
    assert found.recordings[1] == Separation(FAST, (B, C), "q", 6.0)
    assert found.inseparable == ()


@pytest.mark.parametrize(
    ("nats", "words", "certainty"),
    [
        (2.5, "12:1", "12 to 1"),
        (-1.0, "0.37:1", "undecided"),
        (13.0, ">1e4", "sure"),
        (400.0, ">1e4", "sure"),
        (None, "–", "–"),
    ],
)
def test_the_odds_are_said(nats, words, certainty):
    odds = Odds(nats, (("constant_force", "x"),))
    found = made_diagnosis(verdict="named", effects=(made_effect(odds=odds),))
    assert row_of(found.effects[0], found).certainty == certainty
    ((*_, said, against),) = effects_sheet(found).rows
    assert (said.text, against.text) == (words, "constant_force on x")
