"""Moments and regions in words: as many digits as say something."""

from dataclasses import replace

import pytest
from made_diagnoses import made_diagnosis, made_effect, made_location

from gpsim.findings import Concentration, StepErrors
from gpsim.reports.diagnosis_text import where
from gpsim.reports.quantities import in_percent


def test_it_says_when_and_where():
    location = made_location(channels={"q_acc": 0.9}, region={"q": (100.123, 100.987)}, since=1234.5)
    told = where(made_diagnosis(verdict="named", effects=(made_effect(),), location=location, dt=0.02))
    assert "q in [100.12, 100.99]; since t = 1234.50 s" in told


@pytest.mark.parametrize(
    ("finely", "said"),
    [(0.36, "with a fine step, 0.36 of q_acc's 3.4 m is left"), (3.0, None), (None, None)],
)
def test_a_coarse_step_of_the_simulators_own_is_told_where_nothing_is_missing(finely, said):
    nothing = made_diagnosis()
    errors = StepErrors(before=3.4, after=3.4, unit="m", finely=finely)
    told = where(replace(nothing, fit=replace(nothing.fit, one_step={"q_acc": errors})))
    assert ("own step" in told) == (said is not None)
    assert said is None or said in told


@pytest.mark.parametrize(
    ("share", "said"),
    [(1.0, "100"), (0.9951, "100"), (0.104, "10"), (0.0944, "9.4"), (0.00123, "0.12"), (12.3, "1230")],
)
def test_shares_are_told_without_exponents(share, said):
    assert in_percent(share) == said


@pytest.mark.parametrize(
    ("channel", "interval", "said"),
    [
        ("q", (0.1, 0.3), "lies inside q = [0.1, 0.3], in 20 % of the samples"),
        ("since_reversal:force", (0.0, 0.06), "lies within 0.06 s of a reversal of force, in 20 %"),
        ("since_reversal:force", (0.0, 0.0), "lies where force reverses, in 20 %"),
    ],
)
def test_where_a_mismatch_is_concentrated_is_told_in_words(channel, interval, said):
    part = Concentration("q_acc", channel, "inside", interval, share_of_mismatch=0.95, share_of_samples=0.2)
    assert said in where(made_diagnosis(verdict="partial", location=made_location(concentrated=part)))
