"""Twists of a vehicle outside the catalogue, as physics: poses in closed form."""

import numpy as np
import pytest

from gpsim.trials.outside import twists
from gpsim.trials.truth.body import Vehicle
from gpsim.trials.worlds import TrueEffect

from .outside_worlds import H, rolled

WHEEL = {"time": 0.2, "half_track": 0.2}


def test_no_wheel_turns_faster_than_it_can():
    k = {"half_track": 0.2, "limit": 0.8}
    rng = np.random.default_rng(0)
    v, w = rng.uniform(-1.2, 1.2, 500), rng.uniform(-2, 2, 500)
    a, b = twists.WheelSpeedLimit(k).twist(v, w, np.zeros((500, 3)))
    assert (np.abs(a) + 0.2 * np.abs(b) <= 0.8 + 1e-12).all()
    slow = np.abs(v) + 0.2 * np.abs(w) <= 0.8
    assert 50 < slow.sum() < 450
    np.testing.assert_allclose(np.stack([a, b])[:, slow], np.stack([v, w])[:, slow], atol=1e-12)


def test_a_trolley_pulls_a_curve_straight_and_does_nothing_straight_ahead():
    k = {"length": 0.4, "pull": 0.5}
    vehicle = Vehicle([TrueEffect("towed_trolley", "vehicle", k)])
    s, t, u = np.zeros((2, 3)), np.zeros(2), np.array([[0.6, 0.0], [0.6, 0.9]])
    z = vehicle.begin(s)
    first, _ = vehicle.step(s, z, u, t, t, 1e-3)
    assert first[1, 2] == pytest.approx(0.9e-3, rel=2e-3)  # it follows late
    for _ in range(8000):
        before = s
        s, z = vehicle.step(s, z, u, t, t, 1e-3)
    assert (z[0], s[0, 2]) == (0.0, 0.0)
    turning = (s[1, 2] - before[1, 2]) / 1e-3
    assert turning == pytest.approx(0.9 / 1.5, rel=1e-6)
    assert np.sin(z[1, 0]) == pytest.approx(turning * 0.4 / 0.6, rel=1e-6)


def test_an_eccentric_wheel_swings_the_vehicle_once_a_turn_and_keeps_its_course():
    k = {"depth": 0.2, "half_track": 0.2, "radius": 0.1}
    turn = 2 * np.pi * 0.1 / 0.5  # s
    poses, angle = rolled("eccentric_wheel", k, [0.5, 0.0], 3 * turn)
    assert angle[-1, 0] == pytest.approx(6 * np.pi, abs=0.01)
    t = H * np.arange(len(poses))
    np.testing.assert_allclose(poses[:, 2], -0.2 * 0.1 / 0.4 * (1 - np.cos(5 * t)), atol=1e-9)
    way = 0.5 * t + 0.2 * 0.1 / 2 * (1 - np.cos(5 * t))
    gone = np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))
    np.testing.assert_allclose(gone, way[1:], atol=1e-6)


def test_one_wheel_at_rest_does_not_run_out_of_true():
    """Turning about the left wheel, that wheel stands."""
    law = twists.EccentricWheel({"depth": 0.2, "half_track": 0.2, "radius": 0.1})
    v, w, moved = law.twist(np.array([0.2]), np.array([1.0]), np.array([[1.3]]))
    assert (v[0], w[0], moved[0, 0]) == (0.2, 1.0, 0.0)


@pytest.mark.parametrize("speed", [0.2, 0.8, -0.8])
def test_tyres_need_the_same_way_at_any_speed(speed):
    poses, z = rolled("tyre_relaxation", {"length": 0.3}, [speed, 0.7], 3.0)
    way = abs(speed) * H * np.arange(len(z))
    np.testing.assert_allclose(z[:, 0], 0.7 * (1 - np.exp(-way / 0.3)), atol=1e-9)
    turned = 0.7 * (way - 0.3 * (1 - np.exp(-way / 0.3))) / abs(speed)
    np.testing.assert_allclose(poses[:, 2], turned, atol=1e-9)


def test_a_hill_is_climbed_slowly_and_left_as_it_was():
    """The speed it costs is the slope along the way: straight over it, what is lost is won again."""
    k = {"loss": 0.2, "x": 0.4, "y": -0.3, "radius": 0.5}
    rng, step = np.random.default_rng(0), 1e-6
    s = rng.uniform(-1, 1, (200, 3)) * [1, 1, np.pi]

    def height(x, y):
        return np.exp(-((x - 0.4) ** 2 + (y + 0.3) ** 2) / (2 * 0.25))

    cos, sin = np.cos(s[:, 2]), np.sin(s[:, 2])
    up = (height(s[:, 0] + step * cos, s[:, 1] + step * sin) - height(*s[:, :2].T)) / step
    steepest = np.exp(-0.5) / 0.5
    v, w = twists.Hill(k).twist(np.full(200, 0.6), s[:, 0], s)
    np.testing.assert_allclose(0.6 - v, 0.2 * up / steepest, atol=1e-5)
    assert (w == s[:, 0]).all()
    vehicle = Vehicle([TrueEffect("hill", "vehicle", k)])
    pose, t = np.array([[-1.6, -0.3, 0.0]]), np.zeros(1)
    speeds = []
    for _ in range(8000):
        before = pose
        pose, _ = vehicle.step(pose, vehicle.begin(pose), np.array([[0.6, 0.0]]), t, t, H)
        speeds.append((pose[0, 0] - before[0, 0]) / H)
    assert min(speeds) == pytest.approx(0.4, abs=1e-4)  # at its steepest
    assert max(speeds) == pytest.approx(0.8, abs=1e-4)
    assert speeds[0] == pytest.approx(0.6, abs=1e-3)
    assert speeds[-1] == pytest.approx(0.6, abs=1e-3)


def test_a_vane_turns_into_the_wind_as_its_equation_says():
    poses, _ = rolled("weathervane", {"turn": 0.4, "wind": 1.0}, [0.5, 0.0], 10.0, 3.0)
    # x' = -a sin x: tan(x / 2) = tan(x0 / 2) e^(-a t).
    off = 2 * np.arctan(np.tan(1.0) * np.exp(-0.4 * H * np.arange(len(poses))))
    np.testing.assert_allclose(poses[:, 2] - 1.0, off, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*np.diff(poses[:, :2], axis=0).T), 0.5 * H, rtol=1e-6)


@pytest.mark.parametrize(("v", "w"), [(0.6, 0.0), (0.4, 1.1), (0.0, -0.8)])
def test_a_wheel_that_follows_late_turns_the_vehicle_once(v, w):
    poses, wheel = rolled("lagging_wheel", WHEEL, [v, w], 2.0)
    left, t = v - 0.2 * w, H * np.arange(len(wheel))
    fading = np.exp(-t / 0.2)
    np.testing.assert_allclose(wheel[:, 0], left * (1 - fading), atol=1e-9)
    # What the wheel has not rolled, left T (1 - e^(-t / T)), over the track.
    np.testing.assert_allclose(poses[:, 2], w * t + left * 0.2 * (1 - fading) / 0.4, atol=1e-9)
    along = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    way = (np.gradient(poses[:, :2], H, axis=0).T * along).sum(axis=0)
    np.testing.assert_allclose(way[1:-1], (v - left * fading / 2)[1:-1], atol=1e-5)


def test_a_turn_about_a_wheel_that_stands_is_what_was_commanded():
    poses, wheel = rolled("lagging_wheel", WHEEL, [0.2, 1.0], 1.0)
    np.testing.assert_allclose(wheel, 0.0, atol=1e-12)
    np.testing.assert_allclose(poses[:, 2], H * np.arange(len(wheel)), atol=1e-12)


def test_grooves_turn_along_whichever_way_and_as_their_equation_says():
    k = {"turn": 0.3, "line": 0.8}
    poses, _ = rolled("grooved_floor", k, [0.5, 0.0], 6.0, yaw=2.0)
    # x' = -2 a sin x with x = 2 (yaw - line): tan(x / 2) = tan(x0 / 2) e^(-2 a t).
    off = np.arctan(np.tan(1.2) * np.exp(-0.6 * H * np.arange(len(poses))))
    np.testing.assert_allclose(poses[:, 2] - 0.8, off, atol=1e-9)
    back, _ = rolled("grooved_floor", k, [0.5, 0.0], 6.0, yaw=2.0 + np.pi)
    np.testing.assert_allclose(back[:, 2] - np.pi, poses[:, 2], atol=1e-9)


def test_a_cable_is_wound_up_until_it_holds_the_turning():
    poses, wound = rolled("twisting_cable", {"rate": 0.4}, [0.3, 0.8], 12.0)
    expected = 0.8 / 0.4 * (1 - np.exp(-0.4 * H * np.arange(len(poses))))
    np.testing.assert_allclose(poses[:, 2], expected, atol=1e-9)
    np.testing.assert_allclose(wound[:, 0], expected, atol=1e-9)
