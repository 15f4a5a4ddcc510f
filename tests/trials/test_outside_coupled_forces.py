"""Forces on both axes of a cart-pole, as physics: power and energy."""

import numpy as np
from scipy.integrate import cumulative_trapezoid

from gpsim.trials.outside import coupled_forces
from gpsim.trials.worlds import TrueEffect, dynamics

from .outside_worlds import CART, H, driven

TETHER = {"stiffness": 12.0, "length": 0.8, "rest": 0.6}
AXLE = {"force": 1.2, "radius": 0.1, "speed": 0.05}


def test_a_sail_takes_the_power_of_its_tip_and_no_less():
    rng = np.random.default_rng(0)
    k, s = {"drag": 0.3, "length": 0.8}, rng.uniform(-3, 3, (200, 4))
    force = coupled_forces.TipSail(k).forces(s)
    step = 1e-6
    tip = lambda s: np.stack([s[:, 0] + 0.8 * np.sin(s[:, 2]), 0.8 * np.cos(s[:, 2])], axis=1)  # noqa: E731
    later = s + step * np.stack([s[:, 1], 0 * s[:, 1], s[:, 3], 0 * s[:, 3]], axis=1)
    speed = np.linalg.norm(tip(later) - tip(s), axis=1) / step
    np.testing.assert_allclose((force * s[:, 1::2]).sum(axis=1), -0.3 * speed**3, rtol=1e-4)
    still = np.array([[0.3, 0.8, 0.0, -1.0], [0.3, 0.8, np.pi, 1.0]])  # the pole swings back as the cart goes
    np.testing.assert_allclose(coupled_forces.TipSail(k).forces(still), 0.0, atol=1e-12)


def test_a_tether_is_the_slope_of_its_energy():
    rng, step = np.random.default_rng(0), 1e-6
    s = rng.uniform(-1.5, 1.5, (300, 4)) * [1, 1, 2, 1]

    def energy(s):
        far = np.hypot(s[:, 0] + 0.8 * np.sin(s[:, 2]), 0.8 * np.cos(s[:, 2]))
        return 6.0 * np.maximum(far - 0.6, 0.0) ** 2

    force = coupled_forces.TipTether(TETHER).forces(s)
    for c, column in enumerate((0, 2)):
        aside = step * np.eye(4)[column]
        slope = (energy(s + aside) - energy(s - aside)) / (2 * step)
        np.testing.assert_allclose(force[:, c], -slope, atol=1e-6)
    slack = np.array([[-0.75, 0.0, np.pi / 2, 0.0]])
    assert (coupled_forces.TipTether(TETHER).forces(slack) == 0).all()


def test_a_cartpole_on_a_tether_keeps_its_energy():
    s, _ = driven(
        "cartpole",
        CART,
        TrueEffect("tip_tether", "x", TETHER),
        [0.3, 0.0, 2.5, 1.0],
        lambda t: 0.0,
        2.0,
    )
    inverse, _ = dynamics("cartpole", CART, s, np.zeros((len(s), 1)))
    v = s[:, 1::2]
    kinetic = 0.5 * np.einsum("bi,bij,bj->b", v, np.linalg.inv(inverse), v)
    far = np.hypot(s[:, 0] + 0.8 * np.sin(s[:, 2]), 0.8 * np.cos(s[:, 2]))
    energy = kinetic + 0.2 * 9.8 * 0.4 * np.cos(s[:, 2]) + 6.0 * np.maximum(far - 0.6, 0.0) ** 2
    np.testing.assert_allclose(energy, energy[0], atol=1e-6)


def test_an_axle_takes_power_where_it_slips_and_none_where_it_rolls():
    rng, step = np.random.default_rng(0), 1e-6
    s = rng.uniform(-3, 3, (300, 4))
    bottom = lambda s: s[:, 0] - 0.1 * s[:, 2]  # noqa: E731  the way of the disc's rim over the track
    later = s + step * np.stack([s[:, 1], 0 * s[:, 1], s[:, 3], 0 * s[:, 3]], axis=1)
    slip = (bottom(later) - bottom(s)) / step
    force = coupled_forces.RubbingAxle(AXLE).forces(s)
    power = (force * s[:, 1::2]).sum(axis=1)
    np.testing.assert_allclose(power, -1.2 * np.tanh(slip / 0.05) * slip, atol=1e-6)
    assert (power <= 0).all()
    rolling = coupled_forces.RubbingAxle(AXLE).forces(np.array([[0.3, 0.2, 1.0, 2.0]]))
    np.testing.assert_allclose(rolling, 0.0, atol=1e-12)


def test_a_cartpole_loses_what_its_axle_rubs_away():
    effect = TrueEffect("rubbing_axle", "x", AXLE)
    s, _ = driven("cartpole", CART, effect, [0.0, 2.0, 2.5, 3.0], lambda t: 0.0, 2.0)
    inverse, _ = dynamics("cartpole", CART, s, np.zeros((len(s), 1)))
    v, slip = s[:, 1::2], s[:, 1] - 0.1 * s[:, 3]
    energy = 0.5 * np.einsum("bi,bij,bj->b", v, np.linalg.inv(inverse), v)
    energy += 0.2 * 9.8 * 0.4 * np.cos(s[:, 2])
    lost = cumulative_trapezoid(1.2 * np.tanh(slip / 0.05) * slip, dx=H, initial=0.0)
    np.testing.assert_allclose(energy - energy[0], -lost, atol=1e-5)
    assert lost[-1] > 0.3


def test_a_magnetic_rack_is_the_slope_of_its_energy_and_rolls_freely():
    rng, step, k = np.random.default_rng(0), 1e-6, {"stiffness": 1.4, "radius": 0.12}
    s = rng.uniform(-1.5, 1.5, (300, 4))
    energy = lambda s: -1.4 * np.cos(s[:, 2] - s[:, 0] / 0.12)  # noqa: E731
    force = coupled_forces.MagneticRack(k).forces(s)
    for c, column in enumerate((0, 2)):
        aside = step * np.eye(4)[column]
        slope = (energy(s + aside) - energy(s - aside)) / (2 * step)
        np.testing.assert_allclose(force[:, c], -slope, atol=1e-6)
    rolling = np.array([[0.12 * a, 0.0, a, 0.0] for a in np.linspace(-3, 3, 7)])
    np.testing.assert_allclose(coupled_forces.MagneticRack(k).forces(rolling), 0.0, atol=1e-12)
