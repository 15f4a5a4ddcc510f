"""The ten kinds outside the catalogue that began with seed 2028, as physics: limits and energy."""

import numpy as np
import pytest

from gpsim.trials.catalogue.strengths import Dial, Scales
from gpsim.trials.drawing import draws as drawing
from gpsim.trials.outside import kinds_2028
from gpsim.trials.outside.kind import MECHANICAL
from gpsim.trials.outside.strengths import OUTSIDE
from gpsim.trials.truth.body import Body, with_inertia
from gpsim.trials.truth.running import Chain, run
from gpsim.trials.truth.sensing import sense
from gpsim.trials.truth.vehicle import Vehicle
from gpsim.trials.worlds.systems import SYSTEMS, dynamics
from gpsim.trials.worlds.world import TrueEffect

from .outside_worlds import check_replay, world_of


def test_an_eddy_brake_brakes_most_at_its_speed():
    k, v = {"amplitude": 3.0, "speed": 0.7}, np.linspace(-5, 5, 1001)
    force = kinds_2028.eddy_brake(k, v, v, v)
    assert (force * v <= 0).all()
    assert np.abs(force).max() == pytest.approx(3.0)
    assert np.abs(v[np.argmax(np.abs(force))]) == pytest.approx(0.7)
    assert abs(force[-1]) < 1.0


def test_a_rubber_buffer_is_a_spring_at_first_and_a_damper_in_the_end():
    law, k = kinds_2028.RubberBuffer(), {"stiffness": 8.0, "time": 0.5}
    z, v, h = law.begin(np.zeros(1), np.zeros(1)), np.full(1, 0.3), 1e-4
    for step in range(50_000):
        z = z + h * law.drift(k, v, v, z)
        if step == 99:
            assert law.force(k, v, v, z)[0] == pytest.approx(-8.0 * 0.3 * 100 * h, rel=0.02)
    assert law.force(k, v, v, z)[0] == pytest.approx(-8.0 * 0.5 * 0.3, rel=1e-3)


def test_a_rubber_buffer_only_takes_energy():
    effect = TrueEffect("rubber_buffer", "q", {"stiffness": 20.0, "time": 0.3})
    body, t = Body("slider", {"mass": 2.0}, [effect]), np.zeros(1)
    s = np.array([[0.0, 1.0]])
    z, energies = body.begin(s), []
    for _ in range(2000):
        energies.append(s[0, 1] ** 2 + z[0, 0] ** 2 / (2 * 20.0))
        s, z = body.step(s, z, np.zeros((1, 1)), t, t, 1e-3)
    assert (np.diff(energies) < 1e-12).all()
    assert energies[-1] < 0.5 * energies[0]


def test_an_uneven_inertia_keeps_the_energy():
    k = {"amplitude": 0.9, "wave_number": 6.0, "phase": 0.5}
    body, t = Body("slider", {"mass": 2.0}, [TrueEffect("uneven_inertia", "q", k)]), np.zeros(1)
    s, z = np.array([[0.0, 1.0]]), np.empty((1, 0))
    energy = lambda s: 0.5 * (2.0 + kinds_2028.uneven_inertia(k, s[:, 0])[0][0]) * s[0, 1] ** 2  # noqa: E731
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
        k = OUTSIDE["uneven_inertia"](scales, on, Dial(np.random.default_rng(1), 1.0))
        s = np.random.default_rng(2).uniform(-3.2, 3.2, (500, len(SYSTEMS[system].state)))
        inverse, _ = dynamics(system, world.parameters, s, np.zeros((500, 1)))
        c = SYSTEMS[system].coordinates.index(on)
        least = with_inertia(inverse, c, np.full(500, -k["amplitude"]))
        assert (np.linalg.eigvalsh(least) > 0).all()


def test_a_worm_gear_loses_power_and_lets_a_standing_body_be():
    k = {"friction": 0.3, "speed": 0.05}
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(-2, 2, 21), np.linspace(-1, 1, 21)))
    s = np.stack([0 * v, v], axis=1)
    out = kinds_2028.WormGear(k).act(u, s, 0 * u, 1e-3)
    assert ((out - u) * v <= 0).all()
    assert (out[v == 0] == u[v == 0]).all()
    assert out[(u == 2) & (v == 1)] == pytest.approx(2 * 0.7)  # it drives
    assert out[(u == 2) & (v == -1)] == pytest.approx(2 * 1.3)  # it holds back


@pytest.mark.parametrize("clock", ["session", "episode"])
def test_in_an_outage_the_last_command_goes_on(clock):
    effect, steps = TrueEffect("lost_commands", "force", {"share": 0.25, "outage": 0.06, "phase": 2.0}), 600
    world = world_of("slider", [effect], steps=steps, clock=clock)
    commands = np.random.default_rng(0).normal(size=(steps, 4, 1))
    chain, acted = Chain("slider", [effect]), []
    for i in range(steps * 20):
        t = world.clock_offsets + i // 20 * world.dt + i % 20 * 1e-3
        acted.append(chain.act(commands[i // 20], np.zeros((4, 2)), t, 1e-3)[:, 0])
    held = np.reshape(acted, (steps, 20, 4))
    assert (held == held[:, :1]).all()  # nothing is lost halfway
    lost = held[:, 0] != commands[:, :, 0]
    assert lost.mean() == pytest.approx(0.25, abs=0.08)
    assert (held[1:, 0][lost[1:]] == held[:-1, 0][lost[1:]]).all()
    assert (lost[0::3, 0] == lost[1::3, 0]).all()
    assert (lost[0::3, 0] == lost[2::3, 0]).all()
    assert (lost[:, 0] == lost[:, 1]).all() == (clock == "episode")


def test_a_hot_motor_is_as_good_as_new_when_cold():
    k = {"loss": 0.4, "rated": 2.0, "time": 0.5}
    motor, u = kinds_2028.HotMotor(k), np.array([2.0, -2.0, 0.5])
    out = np.array([motor.act(u, np.zeros((3, 2)), np.zeros(3), 1e-3) for _ in range(6000)])
    assert out[0].tolist() == u.tolist()
    np.testing.assert_allclose(out[500], u * (1 - 0.4 * (u / 2.0) ** 2 * (1 - np.exp(-1.0))), rtol=1e-6)
    np.testing.assert_allclose(out[-1], u * (1 - 0.4 * (u / 2.0) ** 2), rtol=1e-4)


def test_no_wheel_turns_faster_than_it_can():
    k = {"half_track": 0.2, "limit": 0.8}
    rng = np.random.default_rng(0)
    v, w = rng.uniform(-1.2, 1.2, 500), rng.uniform(-2, 2, 500)
    a, b = kinds_2028.wheel_speed_limit(k, v, w, np.zeros((500, 3)))
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


@pytest.mark.parametrize(("kind", "system"), [("towed_trolley", "unicycle"), ("rubber_buffer", "cartpole")])
def test_what_is_hidden_is_known_when_a_run_is_replayed(kind, system):
    check_replay(kind, system)


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
    seen = kinds_2028.fisheye(k, radius[:, None] * away)
    far = seen @ away
    np.testing.assert_allclose(seen, far[:, None] * away, atol=1e-12)
    np.testing.assert_allclose(far, 2.0 * np.sin(np.arctan(radius / 2.0)), atol=1e-12)
    assert (np.diff(far) > 0).all()


def test_where_its_sensors_act():
    assert drawing.places_of("fisheye_camera", SYSTEMS["unicycle"], None) == ["pose"]
    assert drawing.places_of("slow_sensor", SYSTEMS["unicycle"], None) == ["yaw"]
    assert drawing.places_of("slow_sensor", SYSTEMS["slider"], "differentiated") == []
