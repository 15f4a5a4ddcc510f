"""Sensors outside the catalogue, as physics: against equations and step-by-step oracles."""

import numpy as np
import pytest

from gpsim.trials.outside import sensors
from gpsim.trials.truth.running import sense
from gpsim.trials.worlds import TrueEffect

from .outside_worlds import H, reference


def test_a_slow_sensor_says_what_was_at_its_last_tick():
    past = np.arange(400.0)[:, None, None] * np.ones((1, 1, 2))
    effect = TrueEffect("slow_sensor", "q", {"period": 0.045})
    read = np.array([sense([effect], ("q", "q_dot"), past, i, 1e-3)[0] for i in range(0, 400, 10)])
    age = read[:, 1] - read[:, 0]
    assert (read[:, 1] == np.arange(0, 400, 10)).all()
    assert (age >= 0).all()
    assert (age < 45).all()
    assert set(read[:, 0]) == {45.0 * i for i in range(9)}


def test_a_fisheye_draws_radii_together_and_keeps_directions():
    k, radius = {"height": 2.0}, np.linspace(0.0, 8.0, 50)
    away = np.array([np.cos(0.7), np.sin(0.7)])
    seen = sensors.FisheyeCamera(k).read(radius[:, None] * away)
    far = seen @ away
    np.testing.assert_allclose(seen, far[:, None] * away, atol=1e-12)
    np.testing.assert_allclose(far, 2.0 * np.sin(np.arctan(radius / 2.0)), atol=1e-12)
    assert (np.diff(far) > 0).all()


def test_a_marker_sways_as_its_equation_says():
    k = {"frequency": 1.5, "damping_ratio": 0.2}
    true = lambda t: 0.4 + 0.3 * np.sin(4.0 * t) ** 2  # noqa: E731
    rate = lambda t: 0.3 * 4.0 * np.sin(8.0 * t)  # noqa: E731
    turn = 2 * np.pi * 1.5

    def slope(t, y):
        return [y[1], turn**2 * (true(t) - y[0]) + 0.4 * turn * (rate(t) - y[1])]

    past = np.repeat(true(H * np.arange(2001))[:, None, None], 2, axis=2).repeat(3, axis=1)
    effect = TrueEffect("loose_marker", "q", k)
    read = np.array([sense([effect], ("q", "q_dot"), past, i, H) for i in range(0, 2001, 20)])
    exact = reference(slope, [true(0.0), 0.0], 2.0, 101)
    np.testing.assert_allclose(read[:, :, 0], np.repeat(exact[:, :1], 3, axis=1), atol=1e-5)
    assert (read[:, :, 1] == past[::20, :, 1]).all()
    assert np.abs(exact[:, 0] - true(0.02 * np.arange(101))).max() > 0.05


def test_a_marker_on_a_body_at_rest_is_at_rest():
    past = np.full((500, 2, 2), 0.7)
    effect = TrueEffect("loose_marker", "q", {"frequency": 1.5, "damping_ratio": 0.2})
    assert (sense([effect], ("q", "q_dot"), past, 499, H) == 0.7).all()
    assert (sense([effect], ("q", "q_dot"), past, 0, H) == 0.7).all()


def test_an_encoder_counts_multiples_of_its_step_and_is_off_by_half_of_one():
    y = np.linspace(-1.3, 1.3, 1001)
    read = sensors.CoarseEncoder({"step": 0.1}).read(y)
    np.testing.assert_allclose(read / 0.1, np.round(read / 0.1), atol=1e-9)
    assert np.abs(read - y).max() <= 0.05 + 1e-12
    assert len(np.unique(np.round(read, 6))) == 27


def test_a_sensor_that_warms_up_is_right_when_cold_and_off_by_its_offset_when_warm():
    effect = TrueEffect("warming_sensor", "q", {"offset": 0.3, "time": 0.4})
    past = np.random.default_rng(0).normal(size=(4001, 3, 2))
    names = ("q", "q_dot")
    assert (sense([effect], names, past, 0, H) == past[0]).all()
    off = sense([effect], names, past, 400, H) - past[400]
    np.testing.assert_allclose(off[:, 0], 0.3 * (1 - np.exp(-1)))
    assert (off[:, 1] == 0).all()
    np.testing.assert_allclose((sense([effect], names, past, 4000, H) - past[4000])[:, 0], 0.3, atol=2e-5)


def test_a_gear_with_play_is_pushed_by_the_ends_of_its_gap():
    """Against the play operator step by step."""
    true = np.cumsum(np.random.default_rng(0).normal(size=(700, 5)) * 0.03, axis=0)
    level, expected = true[0], []
    for now in true:
        level = np.clip(level, now - 0.1, now + 0.1)
        expected.append(level)
    read = [sensors.EncoderPlay({"gap": 0.1}).read(true[: i + 1], H) for i in range(len(true))]
    np.testing.assert_allclose(read, expected, atol=1e-12)
    assert np.abs(read - true).max() == pytest.approx(0.1)


def test_a_gear_with_play_stands_while_the_body_crosses_the_gap():
    t = H * np.arange(1000)
    true = 0.5 - 0.3 * np.cos(2 * np.pi * t)[:, None]  # from 0.2 to 0.8 and back
    effect = TrueEffect("encoder_play", "q", {"gap": 0.05})
    past = np.repeat(true[:, :, None], 2, axis=2)
    read = np.array([sense([effect], ("q", "q_dot"), past, i, H)[0] for i in range(1000)])
    assert (read[:, 1] == true[:, 0]).all()  # the velocity's sensor has no gear
    assert read[0, 0] == true[0, 0]
    rising = (t < 0.5) & (true[:, 0] > 0.25)
    np.testing.assert_allclose(read[rising, 0], true[rising, 0] - 0.05, atol=1e-12)
    turned = (t > 0.5) & (true[:, 0] > 0.7)
    np.testing.assert_allclose(read[turned, 0], 0.75, atol=1e-6)
    back = (t > 0.5) & (true[:, 0] < 0.69)
    np.testing.assert_allclose(read[back, 0], true[back, 0] + 0.05, atol=1e-6)


def test_a_stuck_bit_is_missing_where_it_should_be_set():
    counts = np.arange(-8, 8)
    y = 0.1 * (counts + 0.3)
    read = sensors.StuckBit({"step": 0.1}).read(y)
    np.testing.assert_allclose(read, 0.1 * ((counts & ~1) + 0.3), atol=1e-12)
