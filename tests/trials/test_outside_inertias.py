"""Inertias that vary with position, speed or time, as physics: energy and momentum."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from gpsim.trials.outside import coupled_forces
from gpsim.trials.outside.kind import MECHANICAL
from gpsim.trials.truth import run
from gpsim.trials.truth.body import Body, with_inertia
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, TrueEffect, dynamics

from .outside_worlds import BOB, CART, H, driven, slid, world_of

GOVERNOR = {"inertia": 0.08, "turn": 9.0, "damping_ratio": 0.3}
TANK = {"inertia": 1.5, "time": 0.7}
CHAIN = {"density": 1.6, "edge": 0.3}


def test_an_uneven_inertia_keeps_the_energy():
    k = {"amplitude": 0.9, "wave_number": 6.0, "phase": 0.5}
    body, t = Body("slider", {"mass": 2.0}, [TrueEffect("uneven_inertia", "q", k)]), np.zeros(1)
    s, z = np.array([[0.0, 1.0]]), np.empty((1, 0))
    energy = lambda s: 0.5 * (2.0 + coupled_forces.UnevenInertia(k).inertia(s[:, 0])[0][0]) * s[0, 1] ** 2  # noqa: E731
    before, speeds = energy(s), []
    for _ in range(3000):
        s, z = body.step(s, z, np.zeros((1, 1)), t, t, 1e-3)
        speeds.append(s[0, 1])
    assert energy(s) == pytest.approx(before, rel=1e-9)
    assert max(speeds) > 1.3 * min(speeds)


def test_more_inertia_is_more_in_the_mass_matrix():
    rng = np.random.default_rng(0)
    p = {"gravity": 9.8, "cart_mass": 1.2, "pole_mass": 0.2, "pole_half_length": 0.4}
    inverse, _ = dynamics("cartpole", p, rng.normal(size=(20, 4)), np.zeros((20, 1)))
    extra = rng.uniform(-0.01, 0.1, 20)
    for coordinate in (0, 1):
        mass = np.linalg.inv(inverse)
        mass[:, coordinate, coordinate] += extra
        ours = with_inertia(inverse, coordinate, extra)
        np.testing.assert_allclose(ours, np.linalg.inv(mass), rtol=1e-9)


@pytest.mark.parametrize("system", MECHANICAL)
def test_inertia_stays_positive_at_its_plainest(system):
    for on in SYSTEMS[system].coordinates:
        world = world_of(system)
        scales = Scales(world, run(world, ()))
        k = coupled_forces.UnevenInertia.drawn(scales, on, Dial(np.random.default_rng(1), 1.0))
        s = np.random.default_rng(2).uniform(-3.2, 3.2, (500, len(SYSTEMS[system].state)))
        inverse, _ = dynamics(system, world.parameters, s, np.zeros((500, 1)))
        c = SYSTEMS[system].coordinates.index(on)
        least = with_inertia(inverse, c, np.full(500, -k["amplitude"]))
        assert (np.linalg.eigvalsh(least) > 0).all()


@pytest.mark.parametrize("damping_ratio", [0.0, 0.3])
def test_a_governor_keeps_the_energy_that_its_damper_leaves(damping_ratio):
    k = {**GOVERNOR, "damping_ratio": damping_ratio}
    effect = TrueEffect("centrifugal_governor", "theta", k)
    s, z = driven("pendulum", BOB, effect, [2.5, 3.0], lambda t: 0.0, 3.0)
    own = 0.8 * 0.5**2
    energy = 0.5 * (own + 0.08 * (z[:, 0] ** 2 - 1)) * s[:, 1] ** 2 - 0.8 * 9.8 * 0.5 * np.cos(s[:, 0])
    energy += 0.04 * z[:, 1] ** 2 + 0.04 * 81.0 * (z[:, 0] - 1) ** 2
    assert z[:, 0].max() > 1.3
    if damping_ratio:
        assert np.diff(energy).max() < 1e-9
        assert energy[-1] < energy[0] - 0.05
    else:
        np.testing.assert_allclose(energy, energy[0], rtol=1e-7)


def test_a_governor_adds_inertia_with_speed_and_none_at_rest():
    law, v = coupled_forces.CentrifugalGovernor(GOVERNOR), np.array([0.0, 2.0, 5.0])
    z = law.begin(v, v)
    assert law.inertia(z).tolist() == [0.0, 0.0, 0.0]
    for _ in range(20_000):
        z = z + H * law.drift(v, v, z)
    radius = 1 / (1 - (v / 9.0) ** 2)  # where the spring holds what is flung
    np.testing.assert_allclose(law.inertia(z), 0.08 * (radius**2 - 1), atol=1e-9)


def test_a_governor_on_a_cartpole_turns_the_pole_only():
    k, p = {**GOVERNOR, "damping_ratio": 0.0, "inertia": 0.02}, CART
    effect = TrueEffect("centrifugal_governor", "theta", k)
    s, z = driven("cartpole", p, effect, [0.0, 0.5, 2.0, 4.0], lambda t: 0.0, 2.0)
    inverse, _ = dynamics("cartpole", p, s, np.zeros((len(s), 1)))
    mass, v = np.linalg.inv(inverse), s[:, 1::2]
    mass[:, 1, 1] += 0.02 * (z[:, 0] ** 2 - 1)
    energy = 0.5 * np.einsum("bi,bij,bj->b", v, mass, v) + 0.2 * 9.8 * 0.4 * np.cos(s[:, 2])
    energy += 0.01 * z[:, 1] ** 2 + 0.01 * 81.0 * (z[:, 0] - 1) ** 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7, atol=1e-7)
    momentum = mass[:, 0, 0] * v[:, 0] + mass[:, 0, 1] * v[:, 1]
    np.testing.assert_allclose(momentum, momentum[0], atol=1e-8)  # nothing pushes the cart from outside


def test_a_tank_that_runs_out_speeds_up_as_its_equation_says():
    effect = TrueEffect("leaking_tank", "q", TANK)
    s, z = driven("slider", {"mass": 2.0}, effect, [0.0, 0.3], lambda t: 4.0, 2.0)
    t = H * np.arange(len(s))
    np.testing.assert_allclose(z[:, 0], np.exp(-t / 0.7), rtol=1e-9)
    # The integral of F / (m + J e^(-t / T)) is F T / m ln((m e^(t / T) + J) / (m + J)).
    gained = 4.0 * 0.7 / 2.0 * np.log((2.0 * np.exp(t / 0.7) + 1.5) / 3.5)
    np.testing.assert_allclose(s[:, 1], 0.3 + gained, atol=1e-9)


def test_a_tank_without_a_push_changes_nothing():
    effect = TrueEffect("leaking_tank", "q", TANK)
    s, _ = driven("slider", {"mass": 2.0}, effect, [0.0, 0.3], lambda t: 0.0, 1.0)
    assert (s[:, 1] == 0.3).all()


def test_a_chain_that_is_drawn_keeps_the_momentum():
    s, z = slid("heaped_chain", CHAIN, [0.35, 1.4], lambda t: 0.0, 2.0)
    t, out = H * np.arange(len(s)), s[:, 0] - 0.3
    momentum = (2.0 + 1.6 * 0.05) * 1.4
    np.testing.assert_allclose((2.0 + 1.6 * out) * s[:, 1], momentum, rtol=1e-9)
    way = 2.0 * out + 0.8 * out**2  # the momentum's integral
    np.testing.assert_allclose(way - way[0], momentum * t, atol=1e-9)
    np.testing.assert_allclose(z[:, 0], s[:, 0], atol=1e-12)


def test_a_chain_that_is_laid_down_leaves_the_speed_as_it_is():
    s, _ = slid("heaped_chain", CHAIN, [1.2, -0.8], lambda t: 0.0, 1.5)
    np.testing.assert_allclose(s[:, 1], -0.8, rtol=1e-12)


def test_a_driven_chain_loses_half_its_links_energy_both_ways():
    s, _ = slid("heaped_chain", CHAIN, [1.2, 0.0], lambda t: -8 * np.cos(2.0 * t), 4.0)
    q, v, t = s[:, 0], s[:, 1], H * np.arange(len(s))
    assert q.min() < 0.3 < 0.8 < q.max()
    energy = 0.5 * (2.0 + 1.6 * np.maximum(q - 0.3, 0.0)) * v**2
    power = -8 * np.cos(2.0 * t) * v - 0.8 * np.abs(v) ** 3 * (q > 0.3)
    np.testing.assert_allclose(energy, cumulative_trapezoid(power, t, initial=0.0), atol=5e-3)
