"""The ten kinds outside the catalogue that began with seed 2029, as physics: limits, energy, hidden states."""

import numpy as np
import pytest

from gpsim.trials.drawing import draws as drawing
from gpsim.trials.outside import kinds_2029
from gpsim.trials.truth.body import Body
from gpsim.trials.truth.sensing import sense
from gpsim.trials.truth.vehicle import Vehicle
from gpsim.trials.worlds.systems import SYSTEMS, dynamics
from gpsim.trials.worlds.world import TrueEffect

from .outside_worlds import H, check_replay, driven, reference

CART = {"gravity": 9.8, "cart_mass": 1.2, "pole_mass": 0.2, "pole_half_length": 0.4}
BOB = {"gravity": 9.8, "mass": 0.8, "length": 0.5}
GREASE = {"damping": 4.0, "time": 0.4, "way": 0.15}
LOAD = {"inertia": 0.9, "gap": 0.1, "stiffness": 400.0, "loss": 0.3}
GOVERNOR = {"inertia": 0.08, "turn": 9.0, "damping_ratio": 0.3}


def test_an_oil_is_newtons_when_slow_and_a_power_law_when_fast():
    k, v = {"damping": 3.0, "speed": 0.1, "exponent": 0.4}, np.linspace(-5, 5, 1001)
    force = kinds_2029.shear_thinning(k, v, v, v)
    assert (force * v <= 0).all()
    assert (np.diff(force) < 0).all()  # more with speed, always
    slow, fast = np.array([1e-3]), np.array([40.0])
    assert kinds_2029.shear_thinning(k, slow, slow, slow) == pytest.approx(-3.0 * slow, rel=1e-4)
    expected = -3.0 * 0.1 * (fast / 0.1) ** 0.4
    assert kinds_2029.shear_thinning(k, fast, fast, fast) == pytest.approx(expected, rel=1e-4)


def test_grease_gels_at_rest_and_thins_in_motion():
    law, v = kinds_2029.Grease(), np.array([0.0, 0.3, 3.0])
    z = law.begin(v, v)
    assert law.force(GREASE, v, v, z).tolist() == (-4.0 * v).tolist()
    for _ in range(5000):
        z = z + H * law.drift(GREASE, v, v, z)
    assert z[:, 0] == pytest.approx(
        1 / (1 + 0.4 * v / 0.15), rel=1e-6
    )  # faster than that it hardly resists more
    gel = z.copy()
    for _ in range(800):
        gel = gel + H * law.drift(GREASE, v, 0 * v, gel)
    assert 1 - gel[:, 0] == pytest.approx((1 - z[:, 0]) * np.exp(-2.0), rel=5e-3)


def test_grease_on_a_slider_is_integrated_exactly():
    def slope(t, y):
        _, v, z = y
        return [v, (5 * np.sin(6 * t) - 4.0 * z * v) / 2.0, (1 - z) / 0.4 - abs(v) * z / 0.15]

    s, z = driven(
        "slider",
        {"mass": 2.0},
        TrueEffect("thixotropic_grease", "q", GREASE),
        [0.1, 0.0],
        lambda t: 5 * np.sin(6 * t),
        2.0,
    )
    exact = reference(slope, [0.1, 0.0, 1.0], 2.0, 2001)
    # The push is held for a fine step here and not there.
    np.testing.assert_allclose(np.column_stack([s, z[:, 0]]), exact, atol=2e-5)
    assert (z[:, 0] > 0).all()
    assert z[:, 0].max() <= 1.0


def test_a_loose_load_is_integrated_exactly():
    def slope(t, y):
        q, v, p, r = y
        depth, side = max(abs(p - q) - 0.1, 0.0), np.sign(p - q)
        force = 400.0 * side * depth * max(1 + 0.3 * side * (r - v), 0.0)
        return [v, (6 * np.sin(5 * t) + force) / 2.0, r, -force / 0.9]

    effect = TrueEffect("loose_load", "q", LOAD)
    s, z = driven("slider", {"mass": 2.0}, effect, [0.1, 0.5], lambda t: 6 * np.sin(5 * t), 2.0)
    exact = reference(slope, [0.1, 0.5, 0.1, 0.5], 2.0, 2001)
    np.testing.assert_allclose(np.hstack([s, z]), exact, atol=2e-4)
    assert np.abs(z[:, 0] - s[:, 0]).max() > 0.1  # it knocked


def test_a_loose_load_is_not_there_until_it_knocks_and_keeps_the_momentum():
    effect = TrueEffect("loose_load", "q", LOAD)
    body, t, none = Body("slider", {"mass": 2.0}, [effect]), np.zeros(1), np.zeros((1, 1))
    s, z = np.array([[0.0, 1.0]]), np.array([[0.0, 0.0]])
    energies = []
    for step in range(4000):
        if step == 90:
            assert (s[0, 1], z[0, 1]) == (1.0, 0.0)
        energies.append(s[0, 1] ** 2 + 0.45 * z[0, 1] ** 2)
        spring = 200.0 * max(abs(z[0, 0] - s[0, 0]) - 0.1, 0.0) ** 2
        energies[-1] += spring
        s, z = body.step(s, z, none, t, t, H)
        assert 2.0 * s[0, 1] + 0.9 * z[0, 1] == pytest.approx(2.0, rel=1e-9)
    # A buffer that is touched between two stages of a step is met a little early or late.
    assert np.diff(energies).max() < 1e-4
    assert 0.9 * energies[0] > energies[-1] > 2.0 / 2.9 - 1e-6  # what moving together has is left


def test_a_buffer_never_pulls():
    rng, law = np.random.default_rng(0), kinds_2029.LooseLoad()
    q, v = rng.uniform(-1, 1, 500), rng.uniform(-20, 20, 500)
    z = np.stack([rng.uniform(-1, 1, 500), rng.uniform(-20, 20, 500)], axis=1)
    force = law.force(LOAD, q, v, z)
    assert (force * (z[:, 0] - q) >= 0).all()
    assert (force[np.abs(z[:, 0] - q) < 0.1] == 0).all()


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
    law, v = kinds_2029.Governor(), np.array([0.0, 2.0, 5.0])
    z = law.begin(v, v)
    assert law.inertia(GOVERNOR, z).tolist() == [0.0, 0.0, 0.0]
    for _ in range(20_000):
        z = z + H * law.drift(GOVERNOR, v, v, z)
    radius = 1 / (1 - (v / 9.0) ** 2)  # where the spring holds what is flung
    np.testing.assert_allclose(law.inertia(GOVERNOR, z), 0.08 * (radius**2 - 1), atol=1e-9)


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


def test_a_sail_takes_the_power_of_its_tip_and_no_less():
    rng = np.random.default_rng(0)
    k, s = {"drag": 0.3, "length": 0.8}, rng.uniform(-3, 3, (200, 4))
    force = kinds_2029.tip_sail(k, s)
    step = 1e-6
    tip = lambda s: np.stack([s[:, 0] + 0.8 * np.sin(s[:, 2]), 0.8 * np.cos(s[:, 2])], axis=1)  # noqa: E731
    later = s + step * np.stack([s[:, 1], 0 * s[:, 1], s[:, 3], 0 * s[:, 3]], axis=1)
    speed = np.linalg.norm(tip(later) - tip(s), axis=1) / step
    np.testing.assert_allclose((force * s[:, 1::2]).sum(axis=1), -0.3 * speed**3, rtol=1e-4)
    still = np.array([[0.3, 0.8, 0.0, -1.0], [0.3, 0.8, np.pi, 1.0]])  # the pole swings back as the cart goes
    np.testing.assert_allclose(kinds_2029.tip_sail(k, still), 0.0, atol=1e-12)


def test_a_sticky_valve_stays_within_its_band_and_then_jumps():
    valve = kinds_2029.StickyValve({"band": 0.5})
    commands = [0.3, 0.5, 0.6, 0.2, 0.09, 0.5, -0.5, -0.4]
    none = np.zeros((2, 2))
    acted = [valve.act(np.array([u, -u]), none, none[:, 0], H)[0] for u in commands]
    assert acted == [0.0, 0.0, 0.6, 0.6, 0.09, 0.09, -0.5, -0.5]


def test_a_supply_gives_so_much_power_and_brakes_in_full():
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(-2, 2, 21), np.linspace(-3, 3, 21)))
    out = kinds_2029.PowerLimit({"power": 1.5}).act(u, np.stack([0 * v, v], axis=1), 0 * u, H)
    assert (out * v <= 1.5 + 1e-12).all()
    free = u * v <= 1.5
    assert (out[free] == u[free]).all()
    np.testing.assert_allclose((out * v)[~free], 1.5)
    assert (np.sign(out) == np.sign(u)).all()


def twisted(kind, k, u, seconds):
    """(K + 1, 3) and (K + 1, 1) pose and hidden state under the twist u (2,)."""
    vehicle = Vehicle([TrueEffect(kind, "vehicle", k)])
    s, t = np.zeros((1, 3)), np.zeros(1)
    z = vehicle.begin(s)
    poses, hidden = [s[0]], [z[0]]
    for _ in range(round(seconds / H)):
        s, z = vehicle.step(s, z, np.array([u]), t, t, H)
        poses.append(s[0])
        hidden.append(z[0])
    return np.array(poses), np.array(hidden)


def test_an_eccentric_wheel_swings_the_vehicle_once_a_turn_and_keeps_its_course():
    k = {"depth": 0.2, "half_track": 0.2, "radius": 0.1}
    turn = 2 * np.pi * 0.1 / 0.5  # s
    poses, angle = twisted("eccentric_wheel", k, [0.5, 0.0], 3 * turn)
    assert angle[-1, 0] == pytest.approx(6 * np.pi, abs=0.01)
    t = H * np.arange(len(poses))
    np.testing.assert_allclose(poses[:, 2], -0.2 * 0.1 / 0.4 * (1 - np.cos(5 * t)), atol=1e-9)
    way = 0.5 * t + 0.2 * 0.1 / 2 * (1 - np.cos(5 * t))
    rolled = np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))
    np.testing.assert_allclose(rolled, way[1:], atol=1e-6)


def test_one_wheel_at_rest_does_not_run_out_of_true():
    """Turning about the left wheel, that wheel stands."""
    law, k = kinds_2029.EccentricWheel(), {"depth": 0.2, "half_track": 0.2, "radius": 0.1}
    v, w, moved = law.twist(k, np.array([0.2]), np.array([1.0]), np.array([[1.3]]))
    assert (v[0], w[0], moved[0, 0]) == (0.2, 1.0, 0.0)


@pytest.mark.parametrize("speed", [0.2, 0.8, -0.8])
def test_tyres_need_the_same_way_at_any_speed(speed):
    poses, z = twisted("tyre_relaxation", {"length": 0.3}, [speed, 0.7], 3.0)
    way = abs(speed) * H * np.arange(len(z))
    np.testing.assert_allclose(z[:, 0], 0.7 * (1 - np.exp(-way / 0.3)), atol=1e-9)
    turned = 0.7 * (way - 0.3 * (1 - np.exp(-way / 0.3))) / abs(speed)
    np.testing.assert_allclose(poses[:, 2], turned, atol=1e-9)


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


@pytest.mark.parametrize(
    ("kind", "system"),
    [
        ("thixotropic_grease", "cartpole"),
        ("loose_load", "pendulum"),
        ("centrifugal_governor", "cartpole"),
        ("eccentric_wheel", "unicycle"),
        ("tyre_relaxation", "unicycle"),
    ],
)
def test_what_is_hidden_is_known_when_a_run_is_replayed(kind, system):
    check_replay(kind, system)


def test_where_they_act():
    assert drawing.places_of("centrifugal_governor", SYSTEMS["cartpole"], "measured") == ["theta"]
    assert drawing.places_of("centrifugal_governor", SYSTEMS["slider"], "measured") == []
    assert drawing.places_of("tip_sail", SYSTEMS["cartpole"], "measured") == ["x"]
    assert drawing.places_of("loose_marker", SYSTEMS["unicycle"], None) == ["yaw"]
