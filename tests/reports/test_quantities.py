"""Numbers as a person would say them."""

import math
from dataclasses import replace

import pytest

from gpsim.findings import Combination, Estimate, LogFact, Share
from gpsim.reports.diagnosis_text import (
    combination_text,
    combination_texts,
    fixed_text,
    log_fact_text,
    open_text,
)
from gpsim.reports.quantities import brief, percent, share_text, size_text


@pytest.mark.parametrize(
    ("value", "low", "high", "unit", "said"),
    [
        (8.7123, 8.657, 8.769, "N", "8.71 ± 0.06 N"),
        (1.2021, 1.190, 1.214, "N", "1.202 ± 0.012 N"),
        (0.93, 0.918, 0.942, "1", "0.930 ± 0.012"),
        (12345.0, 12298.0, 12392.0, "N", "12340 ± 50 N"),
        (1.234e-6, 1.2e-6, 1.27e-6, "m", "1.23e-06 ± 3.5e-08 m"),
        (2.0, 1.9, 5.0, "m/s^2", "2.0 (1.9 to 5.0) m/s²"),
        (8.71, 8.71, 8.71, "N", "8.71 N"),
        (8.71, 8.709999, 8.710001, "N", "8.71 ± <9e-05 N"),
        (8.7123, None, None, "N", "8.71 ± ? N"),
        (math.nan, None, None, "N", "–"),
        (0.0, -0.1, 0.1, "N", "0.00 ± 0.10 N"),
    ],
)
def test_a_size_has_as_many_digits_as_its_interval_says(value, low, high, unit, said):
    assert size_text("force", Estimate(value, low, high, unit)) == said


def test_a_ratio_is_so_many_times_and_a_bound_is_no_measurement():
    assert size_text("gain", Estimate(0.93, 0.92, 0.94, "1")) == "0.930 ± 0.010 times"
    assert size_text("force", Estimate(5.0, 4.9, 5.1, "N", at_bound=True)) == "5 N, at its bound"


@pytest.mark.parametrize(
    ("share", "said"),
    [(0.934, "93"), (0.997, "99.7"), (0.99999, ">99.9"), (1.0, "100"), (0.004, "0.4"), (1e-6, "<0.1"), (0.0, "0"),
     (-0.02, "-2"), (-0.001, "0"), (math.nan, "–")],
)  # fmt: skip
def test_a_share_never_claims_all_or_nothing_by_rounding(share, said):
    assert percent(share) == said


def test_a_share_has_its_interval_where_there_is_one():
    assert share_text(Share(0.93, 0.88, 0.96)) == "93 % (88 to 96)"
    assert share_text(Share(0.93)) == "93 %"


@pytest.mark.parametrize(
    ("value", "said"), [(9.213, "9.2"), (123.4, "123"), (0.0102, "0.010"), (math.nan, "diverged")]
)
def test_an_error_has_two_digits(value, said):
    assert brief(value) == said


@pytest.mark.parametrize(
    ("fact", "said"),
    [
        (LogFact("repeated", "theta", 3), "3 samples of theta repeat the one before"),
        (LogFact("repeated", "theta", 1), "1 sample of theta repeats the one before"),
        (LogFact("quantised", "theta", 0, 0.001, "rad"), "theta is quantised to 0.001 rad"),
        (LogFact("outliers", "x", 12), "12 samples of x leap and were left out"),
        (LogFact("missing", "", 7), "7 samples are missing"),
        (LogFact("jitter", "", 0, 0.4, "ms"), "the clock jitters by 0.4 ms"),
        (
            LogFact("pushed", "", 5, 2.0, "s"),
            "something from outside acted from 2 s on (a push, a bump) and was left out, at 5 samples",
        ),
    ],
)
def test_a_fact_of_the_log_is_said(fact, said):
    assert log_fact_text(fact) == said


def together(*exponents, **changes):
    of = ("parameter_offset on cart_mass: ratio", "actuator_gain on force: gain")
    return Combination(of=of, fixed="", open="", exponents=exponents, **changes)


def test_what_is_fixed_and_what_is_open_is_said():
    ratio = together(1.0, -1.0, value=2.5, low=2.4, high=2.6)
    assert fixed_text(ratio) == "cart_mass / force gain = 2.50 (2.40 to 2.60)"
    assert open_text(ratio) == "both may be scaled alike"
    product = together(1.0, 2.0, value=2.5, unit="N")
    assert fixed_text(product) == "cart_mass · force gain^2 = 2.5 N"
    assert open_text(product) == "one may grow as the other shrinks"
    assert fixed_text(together()) == "one combination of them"
    first, second = (replace(c, fixed=fixed_text(c), open=open_text(c)) for c in (ratio, product))
    assert combination_texts([first, second]) == [combination_text(first), combination_text(second)]
    said, alone = combination_texts([first, second, first])
    assert said.startswith(
        "only cart_mass / force gain = 2.50 (2.40 to 2.60) and cart_mass / force gain = 2.50"
    )
    assert said.endswith(" are fixed: these may all be scaled alike")
    assert alone == combination_text(second)
    own = Combination(of=("cart_mass", "force gain"), fixed="their ratio", open="both scaled alike")
    assert combination_text(own) == "of cart_mass and force gain only their ratio is fixed; both scaled alike"
