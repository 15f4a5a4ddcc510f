"""How much smaller an error is, and how sure that is."""

import numpy as np
import pytest

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
