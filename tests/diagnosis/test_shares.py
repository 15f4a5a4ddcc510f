"""Shares of a mismatch: clipped, beyond the noise, over the channels that count, with intervals from blocks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsim.diagnosis.judging.attribution import _shapley, role_of
from gpsim.diagnosis.judging.judges import Mismatch, draws
from gpsim.diagnosis.settings import VerdictSettings
from gpsim.findings import Share

SETTINGS = VerdictSettings()


def mismatch(before, floor, scale=None, times=2.0):
    before, floor = np.array(before, float), np.array(floor, float)
    drawn = draws(len(before), 400, np.random.default_rng(0))
    scale = np.ones(before.shape[1]) if scale is None else np.array(scale, float)
    return Mismatch(before, floor, scale, np.ones(before.shape[1], bool), times, drawn)


def test_what_noise_makes_is_neither_mismatch_nor_left():
    of = mismatch(np.full((10, 1), 101.0), np.full((10, 1), 1.0))
    assert of.overall(np.full((10, 1), 1.0))[0] == pytest.approx(1.0)
    assert of.overall(np.full((10, 1), 26.0))[0] == pytest.approx(0.75)
    assert of.overall(np.full((10, 1), 0.2))[0] == 1.0  # better than noise allows
    assert of.overall(np.full((10, 1), 300.0))[0] == 0.0  # worse than the base


def test_a_channel_counts_where_its_mismatch_stands_out_of_the_noise_in_most_draws():
    rng = np.random.default_rng(1)
    blocks = np.column_stack(
        [np.full(12, 9.0), np.full(12, 3.0), np.where(rng.permutation(12) == 0, 100.0, 0.5)]
    )
    assert mismatch(blocks, np.ones((12, 3))).counts.tolist() == [True, False, False]
    assert mismatch(blocks, np.ones((12, 3)), times=0.0).counts.tolist() == [True, True, False]


def test_a_draw_without_what_is_rare_says_nothing_of_it():
    """An axis meets its stop in one block of ten: a third of the draws do not hold it."""
    before = np.full((10, 1), 1.001)
    before[4] = 1e4
    of = mismatch(before, np.ones((10, 1)))
    left = of.share(of.overall(np.full((10, 1), 1.002)))
    assert left.low == pytest.approx(left.share) == pytest.approx(1.0, abs=1e-4)
    worse = of.share(of.overall(np.where(before > 2.0, 2e4, 1.0)))  # the law is wrong where it matters
    assert worse == Share(0.0, 0.0, 0.0)


def test_a_channel_weighs_as_much_as_its_excess_in_units_of_its_own_spread():
    of = mismatch(np.tile([10.0, 1000.0], (9, 1)), np.zeros((9, 2)), scale=[1.0, 1000.0])
    left = np.tile([0.0, 1000.0], (9, 1))  # all of the one, nothing of the other
    assert of.overall(left)[0] == pytest.approx(10.0 / 11.0)


def test_there_is_no_interval_of_few_blocks():
    few, many = (mismatch(np.full((n, 1), 9.0), np.ones((n, 1))) for n in (7, 8))
    assert few.share(few.overall(np.full((7, 1), 5.0))) == Share(0.5, None, None)
    assert many.share(many.overall(np.full((8, 1), 5.0))).low == pytest.approx(0.5)


def test_the_interval_covers_what_more_data_would_say():
    """Of 200 recordings of twelve blocks whose base errors vary, nine in ten hold the share of infinitely many."""
    rng, held = np.random.default_rng(3), 0
    for _ in range(200):
        before = rng.gamma(4.0, 1.0, (24, 1))
        after = before * rng.uniform(0.0, 0.4, (24, 1))
        share = mismatch(before, np.zeros((24, 1))).share(mismatch(before, np.zeros((24, 1))).overall(after))
        held += share.low <= 0.8 <= share.high
    assert 165 <= held <= 195


worths = st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7)


@given(worths)
def test_importances_add_up_and_a_bystander_has_none(values):
    """Shapley (1953): efficiency and the null player; three players, the third of which changes nothing."""
    pairs = dict(zip([frozenset(s) for s in ((0,), (1,), (0, 1))], values, strict=False))
    worth = {frozenset(): 0.0} | pairs
    worth |= {subset | {2}: value for subset, value in worth.items()}
    worth = {subset: np.array([value]) for subset, value in worth.items()}
    parts = [float(_shapley(i, 3, worth)[0]) for i in range(3)]
    assert sum(parts) == pytest.approx(float(worth[frozenset({0, 1, 2})][0]))
    assert parts[2] == pytest.approx(0.0)


def test_effects_that_explain_the_same_share_it():
    worth = {frozenset(): 0.0, frozenset({0}): 0.8, frozenset({1}): 0.8, frozenset({0, 1}): 0.9}
    worth = {subset: np.array([value]) for subset, value in worth.items()}
    assert [float(_shapley(i, 2, worth)[0]) for i in range(2)] == pytest.approx([0.45, 0.45])


@pytest.mark.parametrize(
    ("importance", "needed", "left", "decided", "role"),
    [
        (Share(0.40, 0.3, 0.5), Share(0.060, 0.05, 0.07), 0.40, 0, "headline"),
        (
            Share(0.25, 0.2, 0.3),
            Share(-0.004, -0.01, 0.001),
            0.03,
            0,
            "slight",
        ),  # alone it mimics the friction
        (
            Share(0.18, 0.1, 0.3),
            Share(0.019, 0.01, 0.03),
            0.013,
            0,
            "slight",
        ),  # it may stand in for what is left
        (Share(0.40, 0.3, 0.5), Share(0.003, 0.002, 0.004), 0.0002, 0, "headline"),  # nothing is left
        (Share(0.019, 0.01, 0.03), Share(0.010, 0.005, 0.02), 0.0015, 4, "slight"),
        (
            Share(0.019, 0.01, 0.03),
            Share(0.010, 0.005, 0.02),
            0.0015,
            5,
            "headline",
        ),  # a limit that is seldom met
        (Share(0.019, 0.01, 0.03), Share(0.060, 0.005, 0.07), 0.040, 15, "slight"),  # as much is left
        (Share(0.40, 0.3, 0.5), Share(0.0200, -0.001, 0.05), 0.001, 9, "slight"),  # perhaps not at all
        (
            Share(0.42, 0.3, 0.5),
            Share(0.023, 0.01, 0.03),
            0.010,
            0,
            "headline",
        ),  # others make good for much of it
        (Share(0.42, 0.3, 0.5), Share(0.009, 0.005, 0.02), 0.013, 0, "slight"),
        (Share(0.40), Share(0.06), 0.10, 0, "headline"),  # too few blocks for an interval
    ],
)
def test_a_headline_is_important_and_needed(importance, needed, left, decided, role):
    assert role_of(importance.share, needed, left, 0.0, decided, 1.0, SETTINGS) == role


def test_what_some_channel_surely_needs_is_a_headline_however_little_it_is_of_the_whole():
    """A cart's dry friction beside a pole that falls: the pole's error decides what is a share of the whole."""
    little = (0.01, Share(0.001, -0.002, 0.003), 0.003, 0.0)
    assert role_of(*little, 50, 13.0, SETTINGS) == "headline"
    assert role_of(*little, 50, 3.0, SETTINGS) == "slight"
    assert role_of(*little, 2, 13.0, SETTINGS) == "slight"  # in a moment or two
