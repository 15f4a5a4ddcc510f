"""What could be predicted: a box counts by what it takes off the account's error beyond the noise."""

import numpy as np
import pytest

from gpsim.diagnosis.assessment.remainder_gp import black_box

BOXES = {"gp": "alone", "after_gp": "beside"}
SEEN = [0, 1]  # of three channels


def found(rows=30, *, floor=0.1, own=1.0, alone=(1.0, 1.0), beside=(1.0, 1.0), base=10.0, seed=0):
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
    box = found(alone=(0.9, 0.9), beside=(0.5, 0.5))
    assert box.model == "after_gp"
    assert box.takes_off.low <= box.takes_off.share <= box.takes_off.high
    assert box.takes_off.share == pytest.approx(0.51, abs=0.02)  # 0.5, and the noise takes its part


def test_a_box_must_do_well_in_all_channels_together():
    """Ten times better in one channel and ten times worse in the other is no better."""
    box = found(alone=(0.1, 10.0), beside=(2.0, 2.0))
    assert box.takes_off.share == pytest.approx(0.0, abs=0.1)


def test_no_box_counts_as_better_without_bounds():
    box = found(floor=1e-9, alone=(1e-6, 1.0))
    assert box.takes_off.share == pytest.approx(1.0 - np.sqrt(0.1), abs=1e-3)


def test_what_the_noise_makes_nobody_foresees():
    assert found(floor=0.9, beside=(0.5, 0.5)) is None
    assert found(base=2000.0, beside=(0.5, 0.5)) is None  # a trifle of the base's
    assert black_box({}, {}, SEEN) is None
    assert black_box(BOXES, {}, SEEN) is None  # no held-out stretch is as long as the horizon


def test_few_rollouts_have_no_interval_and_a_simulation_that_ran_away_is_no_box():
    assert found(rows=3, beside=(0.5, 0.5)).takes_off.low is None
    box = found(alone=(np.inf, 1.0), beside=(0.8, 0.8))
    assert box.model == "after_gp"
    assert box.takes_off.low > 0.0
