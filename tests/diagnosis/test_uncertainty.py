"""How much smaller an error is, how sure that is, and what the data do not determine."""

import numpy as np
import pytest

from gpsim.diagnosis.assessment.remainder_gp import black_box
from gpsim.diagnosis.assessment.rollouts import MODELS, over_before


def ratios(count, shrink=0.5, seed=0, **keywords):
    rng = np.random.default_rng(seed)
    base = rng.normal(size=count)
    errors = {kind: base if kind == "before" else shrink * rng.normal(size=count) for kind in MODELS}
    return over_before(errors, rng, **keywords)


def test_every_model_has_an_interval_that_covers():
    inside = 0
    for seed in range(200):
        found = ratios(400, seed=seed)
        assert all(ratio.low < ratio.high for ratio in found.values())
        inside += found["gp"].low <= 0.5 <= found["gp"].high
    assert 165 <= inside <= 195  # 90 % of 200, with the binomial's own spread


def test_few_samples_do_not_look_certain():
    """Fewer than a block of 25 once gave an interval of no width."""
    left = ratios(20)["after"]
    assert left.high - left.low > 0.1
    assert ratios(5)["after"].low is None


def test_the_interval_is_paired():
    rng = np.random.default_rng(0)
    base = rng.normal(size=300) * np.exp(rng.normal(size=300))
    found = over_before({kind: base if kind == "before" else 0.1 * base for kind in MODELS}, rng)
    assert found["after"].low == pytest.approx(0.1)
    assert found["after"].high == pytest.approx(0.1)


BOXES = {"gp": "alone", "after_gp": "beside"}
SEEN = [0, 1]  # of three channels


def boxed(rows=30, *, floor=0.1, own=1.0, alone=(1.0, 1.0), beside=(1.0, 1.0), base=10.0, seed=0):
    """Errors of so many rollouts in two measured channels and a hidden one; alone, beside: times the account's."""
    rng = np.random.default_rng(seed)
    shared = rng.normal(size=(rows, 3))
    times = {"alone": [*alone, 1e-6], "beside": [*beside, 1e-6]}
    errors = {name: own * np.array(t) * shared for name, t in times.items()}
    errors |= {
        "after": own * shared,
        "before": base * shared,
        "noise_floor": floor * rng.normal(size=(rows, 3)),
    }
    return black_box(BOXES, errors, SEEN)


def test_the_best_box_is_told_with_its_interval():
    box = boxed(alone=(0.9, 0.9), beside=(0.5, 0.5))
    assert box.model == "after_gp"
    assert box.takes_off.low <= box.takes_off.share <= box.takes_off.high
    assert box.takes_off.share == pytest.approx(0.51, abs=0.02)  # 0.5, and the noise takes its part


def test_a_box_must_do_well_in_all_channels_together():
    """Ten times better in one channel and ten times worse in the other is no better."""
    box = boxed(alone=(0.1, 10.0), beside=(2.0, 2.0))
    assert box.takes_off.share == pytest.approx(0.0, abs=0.1)


def test_no_box_counts_as_better_without_bounds():
    box = boxed(floor=1e-9, alone=(1e-6, 1.0))
    assert box.takes_off.share == pytest.approx(1.0 - np.sqrt(0.1), abs=1e-3)


def test_what_the_noise_makes_nobody_foresees():
    assert boxed(floor=0.9, beside=(0.5, 0.5)) is None
    assert boxed(base=2000.0, beside=(0.5, 0.5)) is None  # a trifle of the base's
    assert black_box({}, {}, SEEN) is None
    assert black_box(BOXES, {}, SEEN) is None  # no held-out stretch is as long as the horizon


def test_few_rollouts_have_no_interval_and_a_simulation_that_ran_away_is_no_box():
    assert boxed(rows=3, beside=(0.5, 0.5)).takes_off.low is None
    box = boxed(alone=(np.inf, 1.0), beside=(0.8, 0.8))
    assert box.model == "after_gp"
    assert box.takes_off.low > 0.0
