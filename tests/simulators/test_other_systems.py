"""Slider, pendulum, unicycle and ackermann against conservation laws, Newton's law and circles."""

import numpy as np
import pytest

from gpsim.simulators import SIMULATORS, make_simulator


def run(simulator, state, action, parameters, dt, steps, integrator="rk4"):
    step = np.full(len(state), dt)
    for _ in range(steps):
        state = simulator.step(state, action, parameters, step, integrator)
    return state


def test_free_pendulum_keeps_its_energy_and_swings_with_its_small_period():
    pendulum, p = make_simulator("pendulum"), {"gravity": 9.81, "mass": 0.7, "length": 0.5}
    start = np.array([[2.0, 0.0], [1e-3, 0.0]])
    period = 2 * np.pi * np.sqrt(p["length"] / p["gravity"])
    end = run(pendulum, start, np.zeros((2, 1)), p, period / 2000, 2000)

    def energy(s):
        return 0.5 * p["length"] * s[:, 1] ** 2 - p["gravity"] * np.cos(s[:, 0])

    np.testing.assert_allclose(energy(end), energy(start), rtol=1e-10)
    np.testing.assert_allclose(end[1], start[1], atol=1e-8)


def test_pendulum_torque_against_newtons_law_in_the_plane():
    pendulum, p = make_simulator("pendulum"), {"gravity": 9.81, "mass": 0.7, "length": 0.5}
    theta, torque = 0.8, 1.3
    # the bob along the tangent (cos, sin): m a = torque / l - m g sin; the rod carries the rest
    tangent = np.array([np.cos(theta), np.sin(theta)])
    force = torque / p["length"] * tangent + p["mass"] * np.array([0.0, -p["gravity"]])
    expected = force @ tangent / p["mass"] / p["length"]
    got = pendulum.rates(np.array([[theta, 2.0]]), np.array([[torque]]), p)
    np.testing.assert_allclose(got, [[expected]], rtol=1e-12)


def test_slider_under_constant_force_follows_the_parabola():
    slider = make_simulator("slider")
    end = run(slider, np.array([[0.2, -1.0]]), np.array([[3.0]]), {"mass": 2.0}, 0.01, 100)
    np.testing.assert_allclose(end, [[0.2 - 1.0 + 0.75, 0.5]], rtol=1e-12)


def test_forces_add_to_the_action():
    for name in ("slider", "pendulum"):
        simulator = make_simulator(name)
        p, state = simulator.defaults(), np.array([[0.3, 0.2]])
        pushed = simulator.rates(state, np.array([[0.5]]), p, np.array([[0.7]]))
        np.testing.assert_allclose(pushed, simulator.rates(state, np.array([[1.2]]), p), rtol=1e-12)


@pytest.mark.parametrize(("name", "second"), [("unicycle", 0.8), ("ackermann", 0.25)])
def test_vehicles_drive_circles(name, second):
    simulator = make_simulator(name)
    p, v = simulator.defaults(), 0.6
    w = second if name == "unicycle" else v * np.tan(second) / p["wheelbase"]
    turn = 2 * np.pi / w
    start = np.array([[1.0, -2.0, 0.7]])
    action = np.array([[v, second]])
    half = run(simulator, start, action, p, turn / 400, 200)
    whole = run(simulator, start, action, p, turn / 400, 400)
    np.testing.assert_allclose(np.hypot(*(half - start)[0, :2]), 2 * v / w, rtol=1e-6)
    np.testing.assert_allclose(whole, start + np.array([[0, 0, 2 * np.pi]]), atol=1e-6)


@pytest.mark.parametrize("name", list(SIMULATORS))
def test_measured_rates_invert_an_euler_step(name):
    simulator = make_simulator(name)
    rng = np.random.default_rng(0)
    state = rng.normal(size=(50, len(simulator.state)))
    action = rng.normal(scale=0.5, size=(50, len(simulator.action)))
    dt = rng.uniform(0.01, 0.1, 50)
    p = simulator.defaults()
    after = simulator.step(state, action, p, dt, "euler")
    np.testing.assert_allclose(
        simulator.measured_rates(state, after, dt), simulator.rates(state, action, p), atol=1e-9
    )


def test_cart_poles_normal_force_is_what_the_track_must_carry():
    cartpole = make_simulator("cartpole")
    p, rng = cartpole.defaults(), np.random.default_rng(1)
    state, action = rng.normal(size=(20, 4)), rng.normal(size=(20, 1))
    rates = cartpole.rates(state, action, p)
    # height of the pole's centre of mass is l cos theta: its second derivative by finite differences
    h = 1e-4

    def height(t):
        angle = state[:, 2] + t * state[:, 3] + t**2 / 2 * rates[:, 1]
        return p["pole_half_length"] * np.cos(angle)

    upward = (height(h) - 2 * height(0) + height(-h)) / h**2
    expected = p["cart_mass"] * p["gravity"] + p["pole_mass"] * (p["gravity"] + upward)
    np.testing.assert_allclose(cartpole.normal_force(state, rates, p)["x"], expected, rtol=1e-5)


def test_a_servo_joint_goes_where_it_is_told_as_a_damped_oscillator_does():
    """Within its torque J theta'' + kd theta' + kp theta = kp target; beyond it a constant torque; at last a balance."""
    joint = make_simulator("servo_joint")
    p = joint.defaults({"inertia": 0.02, "stiffness": 2.0, "damping": 0.04, "torque_limit": 1.0})
    natural, half = np.sqrt(p["stiffness"] / p["inertia"]), p["damping"] / p["inertia"] / 2
    t, fast = 0.3, np.sqrt(natural**2 - half**2)
    end = run(joint, np.array([[0.0, 0.0]]), np.array([[0.4]]), p, 0.001, 300)
    swing = np.exp(-half * t) * (np.cos(fast * t) + half / fast * np.sin(fast * t))
    np.testing.assert_allclose(end[0, 0], 0.4 * (1 - swing), rtol=1e-6)
    start = run(joint, np.array([[0.0, 0.0]]), np.array([[9.0]]), p, 0.001, 50)
    np.testing.assert_allclose(start[0], [0.05**2 / 2 * 50.0, 0.05 * 50.0], rtol=1e-9)
    loaded = p | {"gravity_torque": 0.5, "damping": 0.4}
    rest = run(joint, np.array([[0.0, 0.0]]), np.array([[0.6]]), loaded, 0.002, 2000)[0, 0]
    np.testing.assert_allclose(2.0 * (0.6 - rest), 0.5 * np.sin(rest), atol=1e-9)
