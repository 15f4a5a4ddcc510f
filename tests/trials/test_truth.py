"""The truth: against MuJoCo, against energy and rest, and against the catalogue's own laws, written twice."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gpsim.corrected import EffectsPlant
from gpsim.effects import Gate, Term
from gpsim.simulators import make_simulator
from gpsim.trials import catalogue, drawing, out_of_catalogue
from gpsim.trials import drawing as draws
from gpsim.trials.bodies import Body, Now
from gpsim.trials.truth import H, Replay, limited, run, sense
from gpsim.trials.worlds import (
    SYSTEMS,
    Dial,
    Scales,
    TrueEffect,
    dynamics,
)


def world_of(system, effects=(), engine="rk4", **changes):
    """A short, perfect world of a system."""
    rng = np.random.default_rng(3)
    place = SYSTEMS[system]
    base = draws.bare_world(3, 7, 1, "single", False, place, None if place.vehicle else "measured", [], rng)
    small = {"episodes": 3, "steps": 30, "dt": min(place.steps), "noise": dict.fromkeys(place.state, 0.0)}
    return replace(base, effects=tuple(effects), engine=engine, **{**small, **changes})


@cache
def scales_of(system):
    world = world_of(system)
    return Scales(world, run(world, (), world.dt / 4))


@cache
def driven_by_sines(system):
    world = world_of(system, excitation="sines", clock="episode")
    return world, run(world, ())


def effect_of(family, on, system, strength):
    scales = scales_of(system)
    return draws.effect(
        family, on, scales, Dial(np.random.default_rng(1), strength), False, np.random.default_rng(2)
    )


CASES = [
    (family, system, drawing.places_of(family, SYSTEMS[system], "measured")[-1])
    for family in sorted(catalogue.STRENGTHS)
    for system in drawing.systems_of(family)
    # Their history is not at hand here.
    if family
    not in ("sensor_delay", "sensor_lag", "lugre_friction", "torque_speed_limit", "flexible_coupling")
]
LENGTH = 25


@pytest.mark.parametrize(("family", "system", "on"), CASES, ids=lambda c: str(c))
def test_every_law_is_the_catalogues_though_written_twice(family, system, on):
    """Stepped side by side from the same starts under the same commands, truth and catalogue stay together."""
    effect = effect_of(family, on, system, 0.9)
    world, driven = driven_by_sines(system)
    variant = "coefficient" if "coefficient" in effect.values else ""
    term = Term(family, on, effect.values, Gate(effect.region, effect.since), variant)
    plant = EffectsPlant(
        make_simulator(system), world.parameters, (term,), "fine", driven.per_sample, world.dt
    )
    rng, ours = np.random.default_rng(0), Replay(world, driven, (effect,))
    theirs, memory = driven.fine[0], plant.begin(world.episodes, np.random.default_rng(0))
    for k in range(LENGTH):
        theirs = plant.step(theirs, driven.commands[k], memory, rng)
    picks = np.stack([np.zeros(world.episodes, dtype=np.int64), np.arange(world.episodes)])
    own = ours.states(picks, LENGTH)
    names = SYSTEMS[system].names
    read = limited((effect,), names, sense((effect,), names, own[None], 0, H))
    said = plant.measure(theirs, memory, rng)
    changed = np.abs(said - driven.clean[LENGTH]).max()
    few = 1e-6 if family in catalogue.LAST_SENSORS else 1e-9  # a range may leave these readings as they are
    assert np.abs(read - said).max() < 1e-2 * changed + few


def test_cartpoles_mass_matrix_is_that_of_the_simulator():
    rng = np.random.default_rng(0)
    p = {"gravity": 9.8, "cart_mass": 1.2, "pole_mass": 0.2, "pole_half_length": 0.4}
    s, u = rng.normal(size=(50, 4)), rng.normal(size=(50, 1))
    inverse, force = dynamics("cartpole", p, s, u)
    ours = (inverse * force[:, None, :]).sum(axis=2)
    np.testing.assert_allclose(ours, make_simulator("cartpole").rates(s, u, p), rtol=1e-10)


@pytest.mark.parametrize("system", ["cartpole", "slider", "pendulum"])
def test_two_engines_agree(system):
    pytest.importorskip("mujoco")
    on = SYSTEMS[system].coordinates[0]
    effects = [TrueEffect("viscous_friction", on, {"damping": 0.3}), TrueEffect("spring", on, {"stiffness": 1.0, "rest_position": 0.1})]  # fmt: skip
    first = run(world_of(system, effects, excitation="sines"), effects)
    second = run(world_of(system, effects, "mujoco", excitation="sines"), effects)
    np.testing.assert_allclose(first.clean, second.clean, atol=1e-6)


def test_a_body_sticks_below_the_friction_and_slides_above():
    body = Body("slider", {"mass": 2.0}, [TrueEffect("coulomb_friction", "q", {"force": 3.0})])
    s, z = np.zeros((2, 2)), np.empty((2, 0))
    u, t = np.array([[2.9], [3.5]]), np.zeros(2)
    for _ in range(1000):
        s, z = body.step(s, z, Now(u, t, t), 1e-3)
    assert s[0].tolist() == [0.0, 0.0]
    assert s[1, 1] == pytest.approx((3.5 - 3.0) / 2.0, rel=1e-9)


def test_a_sliding_body_stops_where_newton_says():
    body = Body("slider", {"mass": 2.0}, [TrueEffect("coulomb_friction", "q", {"force": 3.0})])
    s, z, t = np.array([[0.0, 1.0]]), np.empty((1, 0)), np.zeros(1)
    for _ in range(1500):
        s, z = body.step(s, z, Now(np.zeros((1, 1)), t, t), 1e-3)
    assert s[0, 1] == 0.0
    assert s[0, 0] == pytest.approx(2.0 / (2 * 3.0), rel=1e-6)  # v^2 m / (2 F)


def test_a_free_pendulum_keeps_its_energy():
    p = {"mass": 1.0, "length": 0.5, "gravity": 9.81}
    body = Body("pendulum", p, ())
    s, z, t = np.array([[1.5, 0.0]]), np.empty((1, 0)), np.zeros(1)
    energy = lambda s: 0.5 * 0.25 * s[0, 1] ** 2 - 9.81 * 0.5 * np.cos(s[0, 0])  # noqa: E731
    before = energy(s)
    for _ in range(3000):
        s, z = body.step(s, z, Now(np.zeros((1, 1)), t, t), 1e-3)
    assert energy(s) == pytest.approx(before, abs=1e-8)


def test_no_kind_outside_is_a_family_of_the_catalogue():
    from gpsim.effects import FAMILIES

    of_models = {family for family, effect in FAMILIES.items() if effect.acts_on}  # drawn for robots
    of_users = {"overflow", "spillover"}  # acts on simulators of the first order, which no world has
    assert set(catalogue.STRENGTHS) == set(FAMILIES) - of_models - of_users
    assert not set(out_of_catalogue.KINDS) & set(FAMILIES)
    assert set(catalogue.SMOOTH) | set(catalogue.GRIP) | set(catalogue.TWIST) <= set(FAMILIES)


def test_a_rate_limit_acts_for_the_part_of_a_millisecond_that_it_takes():
    """A command that is reached inside a step counts by what it does, not as if it took all of the step."""
    once, finely = (catalogue.ACTUATORS["actuator_rate_limit"]({"rate": 500.0}) for _ in range(2))
    nowhere, at, pieces = np.zeros((4, 2)), np.zeros(4), 2000
    for u in (np.array([0.1, -0.3, 0.5, 2.0]), np.array([0.15, 0.3, -0.7, 2.0]), np.zeros(4)):
        small = [finely.act(u, nowhere, at, H / pieces) for _ in range(pieces)]
        np.testing.assert_allclose(once.act(u, nowhere, at, H), np.mean(small, axis=0), atol=1e-6)
