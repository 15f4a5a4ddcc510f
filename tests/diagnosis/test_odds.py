"""Odds against what does without an effect, and which recording separates three rivals."""

from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.assessment.experiment_design import _advice
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.judgement.odds import odds_against
from gpsim.diagnosis.judgement.ranking import Ranked
from gpsim.effects import Term
from gpsim.reports.diagnosis_text import paragraphs

FRICTION = Term("coulomb_friction", "x", {"force": 1.0})
SPRING = Term("spring", "x", {"stiffness": 1.0, "rest_position": 0.0})
DRAG = Term("quadratic_drag", "x", {"drag": 1.0})


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
    assert odds_against(ranking, leader.hypothesis, FRICTION.identity) == {
        "nats": 6.5,
        "against": [["quadratic_drag", "x"], ["spring", "x"]],
    }
    assert odds_against(ranking, leader.hypothesis, SPRING.identity)["nats"] == 29.5


def test_what_the_search_gave_up_counts_by_its_own_windows():
    leader = said(FRICTION, behind=3.0)
    ranking = [leader, said(behind=90.0), said(DRAG, behind=12.0, everything=False)]
    assert odds_against(ranking, leader.hypothesis, FRICTION.identity)["nats"] == 12.0


def test_a_richer_law_that_is_ahead_and_does_not_pay_is_no_rival():
    """Clean sensors: Stribeck's curve mends the last digits of Coulomb's friction, odds of 0 to 1 were printed."""
    leader = said(FRICTION, behind=71.6)
    mending = Ranked(Hypothesis((DRAG,), ((),), "fine"), 0.0, True, mends=True)
    assert odds_against([mending, leader, said(behind=90.0)], leader.hypothesis, FRICTION.identity)[
        "nats"
    ] == pytest.approx(18.4)


def test_three_rivals_of_which_two_are_one():
    """A recording separates the first from both others; nothing separates these two."""
    problem = SimpleNamespace(simulator=SimpleNamespace(state=SimpleNamespace(names=("q", "q_dot"))))
    gaps = np.zeros((3, 2, 2))
    gaps[0, 1] = 5.0, 9.0
    gaps[1, 1] = 4.0, 2.0
    pairs = [(0, 1), (0, 2), (1, 2)]
    first, second = _advice(problem, ["slow", "fast"], pairs, gaps, ["A", "B", "C"])
    assert (
        first == "record fast: A and B and C then differ by up to 4.0 standard deviations of the noise in q"
    )
    assert second.startswith("B and C predict the same for every excitation")


def test_pairs_that_need_two_recordings_get_two():
    problem = SimpleNamespace(simulator=SimpleNamespace(state=SimpleNamespace(names=("q",))))
    gaps = np.zeros((3, 2, 1))
    gaps[0, 0], gaps[1, 0], gaps[2, 1] = 3.0, 2.0, 6.0
    advice = _advice(problem, ["slow", "fast"], [(0, 1), (0, 2), (1, 2)], gaps, ["A", "B", "C"])
    assert [line.split(":")[0] for line in advice] == ["record slow", "record fast"]
    assert "B and C then differ by up to 6.0" in advice[1]


@pytest.mark.parametrize(
    ("nats", "words"), [(2.5, "odds of 12 to 1"), (400.0, "odds of more than a million to 1")]
)
def test_the_odds_are_said(nats, words):
    effect = {
        "family": "spring", "on": "x", "sentence": "a spring was left out", "evidence_gain": 500.0, "parameters": {},
        "odds": {"nats": nats, "against": [["constant_force", "x"]]},
    }  # fmt: skip
    report = {
        "verdict": "named", "effects": [effect], "thinned": 1, "not_measured": [], "tell_apart": None,
        "location": {"channels": {"x_acc": 1.0}, "depends_on": [], "region": {}, "since": None},
        "fit": {"one_step": {}, "rollout": {"horizon_s": 1.0}},
        "remainder": {"gp": {"used": False, "beside": None, "why_not": None}},
    }  # fmt: skip
    text = paragraphs(report)[1]
    assert f"{words} against the next best, constant_force on x" in text
