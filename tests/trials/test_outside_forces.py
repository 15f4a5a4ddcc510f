"""Forces of position, speed and time outside the catalogue, as physics: limits, energy, rest."""

import numpy as np
import pytest

from gpsim.trials.outside import forces
from gpsim.trials.truth.body import Body
from gpsim.trials.worlds import TrueEffect

from .outside_worlds import BOB, H, driven, slid

BELT = {"force": 1.5, "belt": 0.7, "speed": 0.05}
TOGGLE = {"stiffness": 40.0, "centre": 0.1, "aside": 0.15, "rest": 0.35}


def test_an_eddy_brake_brakes_most_at_its_speed():
    k, v = {"amplitude": 3.0, "speed": 0.7}, np.linspace(-5, 5, 1001)
    force = forces.EddyBrake(k).force(v, v, v)
    assert (force * v <= 0).all()
    assert np.abs(force).max() == pytest.approx(3.0)
    assert np.abs(v[np.argmax(np.abs(force))]) == pytest.approx(0.7)
    assert abs(force[-1]) < 1.0


def test_an_oil_is_newtons_when_slow_and_a_power_law_when_fast():
    k, v = {"damping": 3.0, "speed": 0.1, "exponent": 0.4}, np.linspace(-5, 5, 1001)
    force = forces.ShearThinning(k).force(v, v, v)
    assert (force * v <= 0).all()
    assert (np.diff(force) < 0).all()  # more with speed, always
    slow, fast = np.array([1e-3]), np.array([40.0])
    assert forces.ShearThinning(k).force(slow, slow, slow) == pytest.approx(-3.0 * slow, rel=1e-4)
    expected = -3.0 * 0.1 * (fast / 0.1) ** 0.4
    assert forces.ShearThinning(k).force(fast, fast, fast) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_check_valve_lets_the_damper_go_back_freely(side):
    v = np.linspace(-3, 3, 61)
    force = forces.OneWayDamper({"damping": 2.0, "side": side}).force(v, v, v)
    assert (force[v * side <= 0] == 0).all()
    np.testing.assert_allclose(force[v * side > 0], -2.0 * v[v * side > 0])


def test_two_one_way_dampers_are_a_damper():
    v = np.linspace(-3, 3, 61)
    both = sum(forces.OneWayDamper({"damping": 2.0, "side": s}).force(v, v, v) for s in (1.0, -1.0))
    np.testing.assert_allclose(both, -2.0 * v)


def test_a_cable_takes_the_weight_that_moves_times_the_way():
    """Drawn out slowly from its anchor to q and back, it takes 2 w q^2 / 2, however fast it goes."""
    k = {"drag": 3.0, "anchor": 0.2, "speed": 1e-3}
    q = np.linspace(0.2, 1.2, 2001)
    for speed in (0.1, 2.0):
        out = forces.DraggedCable(k).force(q, np.full_like(q, speed), q)
        back = forces.DraggedCable(k).force(q, np.full_like(q, -speed), q)
        assert np.trapezoid(out - back, q) == pytest.approx(-3.0, rel=1e-6)
    assert forces.DraggedCable(k).force(np.array([0.2]), np.array([1.0]), q[:1])[0] == 0.0
    same = [forces.DraggedCable(k).force(np.array([a]), np.array([1.0]), q[:1])[0] for a in (-0.3, 0.7)]
    assert same[0] == pytest.approx(same[1])


@pytest.mark.slow
@pytest.mark.parametrize("start", [-2.0, 0.0, 2.0])
def test_a_belt_takes_the_body_along_from_any_speed(start):
    s, _ = slid("running_belt", BELT, [0.0, start], lambda t: 0.0, 6.0)
    assert s[-1, 1] == pytest.approx(0.7, abs=1e-6)
    # m dv/dt = -F tanh(x / v0) with x = v - belt: sinh(x / v0) = sinh(x0 / v0) e^(-F t / (m v0)), by logarithms.
    t, x = H * np.arange(len(s)), np.abs(s[:, 1] - 0.7) / 0.05
    log_sinh = x + np.log(-np.expm1(-2 * x)) - np.log(2.0)
    near = x > 1e-4
    np.testing.assert_allclose((log_sinh + 1.5 * t / (2.0 * 0.05))[near], log_sinh[0], atol=1e-3)
    assert s[1, 1] - start == pytest.approx(0.75 * H * np.sign(0.7 - start), rel=1e-6)  # all of it at once


def test_a_pendulum_on_a_shaft_that_turns_swings_up_and_settles():
    """Froude's pendulum under smooth friction: it comes to rest where the shaft's torque and gravity's are equal."""
    effect = TrueEffect("running_belt", "theta", {"force": 1.5, "belt": 1.0, "speed": 0.6})
    s, _ = driven("pendulum", BOB, effect, [0.0, 0.0], lambda t: 0.0, 14.0)
    assert s[-1, 1] == pytest.approx(0.0, abs=1e-4)
    assert 0.8 * 9.8 * 0.5 * np.sin(s[-1, 0]) == pytest.approx(1.5 * np.tanh(1 / 0.6), rel=1e-4)


def test_a_toggle_is_the_slope_of_its_springs_energy():
    q, step = np.linspace(-0.8, 0.9, 401), 1e-6
    energy = lambda q: 20.0 * (np.hypot(q - 0.1, 0.15) - 0.35) ** 2  # noqa: E731
    force = forces.ToggleSpring(TOGGLE).force(q, q, q)
    np.testing.assert_allclose(force, -(energy(q + step) - energy(q - step)) / (2 * step), atol=1e-6)


def test_a_toggle_snaps_to_either_side_and_rests_where_its_spring_is_relaxed():
    body = Body("slider", {"mass": 2.0}, [TrueEffect("toggle_spring", "q", TOGGLE)])
    s, none = np.array([[0.101, 0.0], [0.099, 0.0]]), np.zeros(2)
    for _ in range(7000):
        s, _ = body.step(s, np.empty((2, 0)), -8.0 * s[:, 1:], none, none, H)
    relaxed = np.sqrt(0.35**2 - 0.15**2)
    np.testing.assert_allclose(s[:, 0], [0.1 + relaxed, 0.1 - relaxed], atol=1e-4)


def test_two_magnets_push_with_the_fourth_power_of_their_distance():
    k = {"amplitude": 5.0, "edge": 0.4, "reach": 0.2}
    bumper = forces.MagneticBumper(k)
    q = np.linspace(-2.0, 0.4, 200)
    force = bumper.force(q, q, q)
    distance = 0.2 + 0.4 - q
    np.testing.assert_allclose(-force * distance**4, 5.0 * 0.2**4)
    beyond = np.array([0.4, 0.7, 3.0])
    assert bumper.force(beyond, beyond, beyond).tolist() == [-5.0] * 3


def test_drag_falls_where_the_wake_narrows_and_is_quadratic_on_either_side():
    k, v = {"drag": 2.0, "loss": 0.8, "critical": 1.0, "width": 0.02}, np.linspace(0.0, 3.0, 3001)
    force = forces.DragCrisis(k).force(v, v, v)
    slow, fast = v < 0.8, v > 1.2
    np.testing.assert_allclose(force[slow], -2.0 * v[slow] ** 2, rtol=1e-3)
    np.testing.assert_allclose(force[fast], -0.2 * 2.0 * v[fast] ** 2, rtol=1e-3)
    assert -force[v > 0.8].min() > -force[np.argmin(np.abs(v - 1.1))]  # faster, and yet less
    np.testing.assert_allclose(forces.DragCrisis(k).force(v, -v, v), -force)
