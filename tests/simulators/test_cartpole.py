"""The cart-pole against energy conservation and a direct solve of Newton's equations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsim.errors import UsageError
from gpsim.simulators import RandomisedPlant, make_simulator, restart
from gpsim.targets import FrictionCartPole
from gpsim.targets.cartpole import cart_pole_accelerations

CARTPOLE = make_simulator("cartpole")
P = CARTPOLE.defaults()


def newton(state, force, mu, p):
    """Newton and Euler for cart and pole: unknowns x_acc, theta_acc, pivot force (h, v) on the pole, ground force n."""
    _, x_dot, theta, theta_dot = state
    m, mc, l, g = p["pole_mass"], p["cart_mass"], p["pole_half_length"], p["gravity"]
    s, c, sign = np.sin(theta), np.cos(theta), np.sign(x_dot)
    equations = np.array(
        [
            [m, m * l * c, -1, 0, 0],  # pole, horizontal
            [0, -m * l * s, 0, -1, 0],  # pole, vertical
            [0, m * l**2 / 3, l * c, -l * s, 0],  # pole, about its centre of mass
            [mc, 0, 1, 0, mu * sign],  # cart, horizontal
            [0, 0, 0, -1, 1],  # cart, vertical
        ]
    )
    right = np.array([m * l * s * theta_dot**2, m * l * c * theta_dot**2 - m * g, 0, force, mc * g])
    return np.linalg.solve(equations, right)[:2]


states = st.tuples(
    st.floats(-2, 2), st.floats(-3, 3), st.floats(-1.2, 1.2), st.floats(-4, 4)
)  # upright half: the normal force stays positive


@settings(max_examples=200, deadline=None)
@given(states, st.floats(-20, 20), st.floats(0, 1.2), st.floats(0.05, 1.0), st.floats(0.1, 3.0))
def test_friction_agrees_with_newton(state, force, mu, half_length, pole_mass):
    p = {**P, "pole_half_length": half_length, "pole_mass": pole_mass}
    got = cart_pole_accelerations(np.array([state]), np.array([force]), np.sign(np.array([state[1]])), p, mu)[
        0
    ]
    np.testing.assert_allclose(got, newton(state, force, mu, p), rtol=1e-9, atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(states, st.floats(-20, 20))
def test_simulator_agrees_with_newton_without_friction(state, force):
    got = CARTPOLE.rates(np.array([state]), np.array([[force]]), P)[0]
    np.testing.assert_allclose(got, newton(state, force, 0.0, P), rtol=1e-10, atol=1e-10)


def test_thesis_denominator_is_off_by_what_the_text_says():
    """The printed cos^2 (1 - mu sin) differs from Newton's cos (cos - mu sin), slightly but measurably."""
    theta, mu = 0.2, 0.9
    m, total = P["pole_mass"], P["pole_mass"] + P["cart_mass"]
    right = 4 / 3 - m * np.cos(theta) * (np.cos(theta) - mu * np.sin(theta)) / total
    printed = 4 / 3 - m * np.cos(theta) ** 2 * (1 - mu * np.sin(theta)) / total
    assert 0 < abs(right - printed) < 1e-3


def test_generalised_force_on_the_cart_is_an_action():
    rng = np.random.default_rng(0)
    state, action, extra = rng.normal(size=(20, 4)), rng.normal(size=(20, 1)), rng.normal(size=(20, 1))
    forces = np.hstack([extra, np.zeros((20, 1))])
    np.testing.assert_allclose(
        CARTPOLE.rates(state, action, P, forces), CARTPOLE.rates(state, action + extra, P), atol=1e-12
    )


def energy(states):
    m, mc, l, g = P["pole_mass"], P["cart_mass"], P["pole_half_length"], P["gravity"]
    _, v, th, w = states.T
    pole = 0.5 * m * (v**2 + 2 * v * w * l * np.cos(th)) + 0.5 * (4 / 3) * m * l**2 * w**2
    return 0.5 * mc * v**2 + pole + m * g * l * np.cos(th)


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("semi_implicit", 1), ("rk4", 4)])
def test_integrators_converge_at_their_order_and_conserve_energy(integrator, order):
    start, action = np.array([[0.1, 0.4, 0.5, -0.3]]), np.zeros((1, 1))

    def final(steps):
        state = start
        for _ in range(steps):
            state = CARTPOLE.step(state, action, P, np.array([1.0 / steps]), integrator)
        return state

    truth = start
    for _ in range(2000):
        truth = CARTPOLE.step(truth, action, P, np.array([1.0 / 2000]), "rk4")
    assert abs(energy(truth) - energy(start))[0] < 1e-10
    coarse, fine = (np.abs(final(n) - truth).max() for n in (160, 320))
    assert 2 ** (order - 0.3) < coarse / fine < 2 ** (order + 0.4)


def test_a_cart_at_rest_sticks_until_friction_gives_way():
    target = FrictionCartPole(P, 0.9, 0.02, contact="stick", substeps=20)
    rng = np.random.default_rng(0)
    still = np.array([[0.0, 0.0, 0.02, 0.0]])
    held = target.step(still, np.array([[5.0]]), {}, rng)
    assert held[0, 0] == 0.0
    assert held[0, 1] == 0.0
    assert held[0, 3] > 0.0  # the pole falls about the fixed pivot
    pushed = target.step(still, np.array([[15.0]]), {}, rng)
    assert pushed[0, 1] > 0.0


def test_sticking_friction_stops_a_coasting_cart_for_good_and_never_reverses_it():
    target = FrictionCartPole({**P, "pole_mass": 1e-3}, 0.5, 0.02, contact="stick", substeps=20)
    state, rng, speeds = np.array([[0.0, 1.0, 0.0, 0.0]]), np.random.default_rng(0), []
    for _ in range(40):
        state = target.step(state, np.zeros((1, 1)), {}, rng)
        speeds.append(state[0, 1])
    assert min(speeds) >= 0.0
    assert speeds[-1] == 0.0
    # v^2 / (2 mu g), all but exactly for a light pole
    assert state[0, 0] == pytest.approx(1.0 / (2 * 0.5 * 9.8), rel=0.01)


def test_chatter_and_stick_differ_only_near_zero_speed():
    rng = np.random.default_rng(1)
    state = np.column_stack([np.zeros(500), rng.uniform(-3, 3, 500), rng.uniform(-0.2, 0.2, (500, 2))])
    action = rng.choice([-10.0, 10.0], (500, 1))
    chatter = FrictionCartPole(P, 0.9, 0.02).step(state, action, {}, rng)
    stick = FrictionCartPole(P, 0.9, 0.02, contact="stick", substeps=200).step(state, action, {}, rng)
    difference = np.abs(chatter - stick)[:, 1]
    crossing = np.sign(stick[:, 1]) != np.sign(state[:, 1])
    assert difference[~crossing & (np.abs(state[:, 1]) > 0.5)].max() < 0.02
    assert difference[crossing].max() > 0.1


def test_randomised_episodes_draw_their_own_parameters():
    plant, rng = RandomisedPlant(CARTPOLE, P, "euler", 0.02, 0.1), np.random.default_rng(0)
    memory = plant.begin(1000, rng)
    for name, values in memory.items():
        assert np.all(np.abs(values / P[name] - 1) <= 0.1)
        assert np.ptp(values / P[name]) > 0.19
    kept = {name: values.copy() for name, values in memory.items()}
    rows = np.arange(1000) < 10
    restart(memory, rows, plant.begin(10, rng))
    for name, values in memory.items():
        assert np.all(values[~rows] == kept[name][~rows])
        assert np.all(values[rows] != kept[name][rows])


def test_an_episode_may_draw_parameters_and_a_gain_of_its_force():
    plant, rng = RandomisedPlant(CARTPOLE, P, "euler", 0.02, 0.1, "both"), np.random.default_rng(0)
    memory, still = plant.begin(1000, rng), np.zeros((1000, 4))
    after = plant.step(still, np.full((1000, 1), 10.0), memory, rng)
    masses, half = memory["cart_mass"] + memory["pole_mass"], memory["pole_half_length"]
    # An upright pole at rest adds a quarter of its mass to what the force has to move.
    gains = after[:, 1] / 0.02 * (masses - 0.75 * memory["pole_mass"]) / 10.0
    assert np.all(np.abs(gains - 1) <= 0.1)
    assert np.ptp(gains) > 0.19
    for drawn in (memory["cart_mass"], half, memory["gravity"]):
        assert abs(np.corrcoef(gains, drawn)[0, 1]) < 0.1


def test_wrong_parameters_are_named():
    with pytest.raises(UsageError, match="no parameter 'mass'; it has: gravity, cart_mass"):
        CARTPOLE.defaults({"mass": 1.0})
    with pytest.raises(UsageError, match=r"cart_mass=-1 kg: expected more than 0"):
        CARTPOLE.defaults({"cart_mass": -1.0})
    with pytest.raises(UsageError, match="registered are: cartpole"):
        make_simulator("cartpol")
