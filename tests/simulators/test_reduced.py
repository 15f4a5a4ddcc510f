"""A simulator with fewer states: a cart on a fixed mount is a pole on a pivot, a robot's yaw needs no position."""

import pickle

import numpy as np
import pytest

from gpsim.simulators import make_simulator, reduced

RNG = np.random.default_rng(0)


def held_cart():
    return reduced(make_simulator("cartpole"), {"x": 0.3, "x_dot": 0.0}, ["x"])


def test_a_pole_on_a_held_cart_swings_about_a_fixed_pivot():
    pole, p = held_cart(), make_simulator("cartpole").defaults()
    state, action = RNG.normal(size=(7, 2)), RNG.normal(size=(7, 1))
    assert pole.state.names == ("theta", "theta_dot")
    assert [c.name for c in pole.coordinates] == ["theta"]
    torque = RNG.normal(size=(7, 1))
    inertia = 4.0 / 3.0 * p["pole_mass"] * p["pole_half_length"] ** 2
    weight = p["pole_mass"] * p["gravity"] * p["pole_half_length"] * np.sin(state[:, 0])
    got = pole.rates(state, action, p, torque)
    np.testing.assert_allclose(got[:, 1], (weight + torque[:, 0]) / inertia, rtol=1e-12)
    assert (got[:, 0] == 0.0).all()
    np.testing.assert_allclose(pole.mobility(state, p, 0)[:, 1], 1.0 / inertia, rtol=1e-12)
    pushed = pole.rates(state, 100.0 * action, p)  # the mount takes it
    np.testing.assert_allclose(pushed, pole.rates(state, action, p), rtol=1e-9)


@pytest.mark.parametrize("integrator", ["euler", "semi_implicit", "rk4"])
def test_what_is_left_steps_as_it_does_in_the_whole(integrator):
    whole = make_simulator("unicycle")
    yaw = reduced(whole, {"x": 0.0, "y": 0.0})
    action, dt = RNG.normal(size=(5, 2)), np.full(5, 0.1)
    full = RNG.normal(size=(5, 3))
    np.testing.assert_allclose(
        yaw.step(full[:, 2:], action, {}, dt, integrator), whole.step(full, action, {}, dt, integrator)[:, 2:]
    )
    assert yaw.rate.names == whole.rate.names


def test_it_knows_which_rates_its_states_tell():
    assert [held_cart().measures(name) for name in ("x_acc", "theta_acc")] == [False, True]
    yaw = reduced(make_simulator("unicycle"), {"x": 0.0, "y": 0.0})
    assert [yaw.measures(name) for name in ("v", "v_lateral", "w")] == [False, False, True]


def test_nothing_fixed_is_the_simulator_itself_and_workers_get_a_copy():
    whole = make_simulator("slider")
    assert reduced(whole, {}) is whole
    again = pickle.loads(pickle.dumps(held_cart()))
    assert again.state == held_cart().state
