"""A diagnosis.json that contradicts itself is found out; what this version says contradicts nothing."""

import json
from dataclasses import replace

import pytest
from rich_diagnoses import RICH, friction, named, size, viscous

from gpsim.findings import Alternative, BlackBox, HeldOutFit, Odds, Share
from gpsim.reports.wording import worded
from gpsim.trials.scoring import contradictions


def found_in(diagnosis):
    """As a program that reads the file finds it."""
    return contradictions(json.loads(json.dumps(worded(diagnosis).to_dict())))


def sure(**changes):
    """A named account of one claim."""
    parts = {"probability": 0.999, "odds": Odds(7.0, ())}
    return replace(named(), effects=(friction(**parts | changes),), alternatives=())


def boxed(low, explained=0.93):
    """A black box that takes so much off at least, beside an account that explains so much at most."""
    fit = named().fit
    box = BlackBox("gp", Share(0.5, low, 0.7))
    share = replace(sure().explained, rollout=Share(explained - 0.01, explained - 0.02, explained))
    return replace(sure(), fit=HeldOutFit(fit.held_out, fit.one_step, fit.rollout, box), explained=share)


def rival(effect, probability):
    return Alternative((replace(effect, probability=probability),), probability)


def test_a_sound_account_contradicts_nothing():
    assert found_in(sure()) == []
    assert found_in(boxed(0.1)) == []
    assert found_in(boxed(0.3, explained=0.99)) == []  # of what little is left
    assert found_in(RICH["none"]()) == []


@pytest.mark.parametrize(
    ("diagnosis", "words"),
    [
        (sure(odds=Odds(0.0, ())), "odds"),
        (sure(parameters={"force": size(20.0, 0.1, "N", at_bound=True)}), "stopped at its bound"),
        (sure(parameters={"force": size(0.02, 0.03, "N")}), "the size of coulomb_friction on x is unknown"),
        (sure(parameters={"force": size(0.0, 1100.0, "N")}), "the size of"),
        (sure(role="slight"), "without a headline effect"),
        (sure(form="approximate"), "only approximately"),
        (boxed(0.3), "black box"),
        (sure(acts_in=0.97, region={"x": (-9.0, 9.0)}), "97 % of the samples"),
        (sure(acts_in=0.01, region={"x": (0.0, 0.1)}), "1 % of the samples"),
        (replace(sure(probability=1e-33), alternatives=(rival(viscous(), 0.99999),)), "probability is 1e-33"),
        (replace(sure(probability=0.4), alternatives=(rival(viscous(), 0.35),)), "an alternative lacks"),
        (replace(sure(probability=0.5), alternatives=(rival(friction(), 0.5),)), None),
        (replace(sure(), verdict="unknown"), "verdict unknown, and coulomb_friction on x is a headline effect"),
        (replace(sure(), verdict="ambiguous"), "without an alternative"),
        (replace(sure(), effects=()), "without an effect"),
    ],
)  # fmt: skip
def test_every_rule_of_a_verdict_is_checked(diagnosis, words):
    found = found_in(diagnosis)
    assert any(words in line for line in found) if words else found == []


def test_a_force_and_a_bias_of_which_only_the_sum_is_known_are_no_two_claims():
    force = friction(family="constant_force", parameters={"force": size(0.0, 1100.0, "N")})
    bias = friction(family="actuator_bias", on="force", parameters={"bias": size(0.0, 600.0, "N")})
    diagnosis = replace(sure(), verdict="partial", effects=(force, bias))
    assert len(found_in(diagnosis)) == 2
    slight = tuple(replace(e, role="slight") for e in (force, bias))
    assert found_in(replace(diagnosis, effects=slight)) == []


def test_odds_and_probabilities_of_a_file_agree():
    likely = sure(probability=0.7, odds=Odds(6.0, ()))
    found = found_in(replace(likely, verdict="ambiguous", alternatives=(rival(viscous(), 0.3),)))
    assert found == ["the odds against an account without coulomb_friction on x contradict its probability"]
    agreed = sure(probability=0.7, odds=Odds(0.84, ()))
    assert found_in(replace(agreed, verdict="ambiguous", alternatives=(rival(viscous(), 0.3),))) == []


def test_the_simplest_may_lead_where_the_data_cannot_tell():
    less = replace(
        sure(probability=0.3, odds=Odds(-0.84, ())),
        verdict="ambiguous",
        alternatives=(rival(viscous(), 0.69),),
    )
    assert found_in(replace(less, leads="simplest")) == []
    assert found_in(less) == ["the leader is called the likeliest, but an alternative is more likely"]
