"""The ten kinds outside the catalogue that began with seed 2030, as physics: limits, energy, hidden states."""

import numpy as np
import pytest

from gpsim.trials.drawing import draws as drawing
from gpsim.trials.outside import kinds_2030
from gpsim.trials.truth.body import Body
from gpsim.trials.truth.sensing import sense
from gpsim.trials.truth.vehicle import Vehicle
from gpsim.trials.worlds.systems import SYSTEMS, dynamics
from gpsim.trials.worlds.world import TrueEffect

from .outside_worlds import H, check_replay, driven, reference

CART = {"gravity": 9.8, "cart_mass": 1.2, "pole_mass": 0.2, "pole_half_length": 0.4}
FLYWHEEL = {"grip": 1.5, "inertia": 0.8, "speed": 0.05}
TANK = {"inertia": 1.5, "time": 0.7}
TETHER = {"stiffness": 12.0, "length": 0.8, "rest": 0.6}
VALVE = {"fill": 0.02, "vent": 0.3}


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_check_valve_lets_the_damper_go_back_freely(side):
    v = np.linspace(-3, 3, 61)
    force = kinds_2030.one_way_damper({"damping": 2.0, "side": side}, v, v, v)
    assert (force[v * side <= 0] == 0).all()
    np.testing.assert_allclose(force[v * side > 0], -2.0 * v[v * side > 0])


def test_two_one_way_dampers_are_a_damper():
    v = np.linspace(-3, 3, 61)
    both = sum(kinds_2030.one_way_damper({"damping": 2.0, "side": s}, v, v, v) for s in (1.0, -1.0))
    np.testing.assert_allclose(both, -2.0 * v)


def test_a_cable_takes_the_weight_that_moves_times_the_way():
    """Drawn out slowly from its anchor to q and back, it takes 2 w q^2 / 2, however fast it goes."""
    k = {"drag": 3.0, "anchor": 0.2, "speed": 1e-3}
    q = np.linspace(0.2, 1.2, 2001)
    for speed in (0.1, 2.0):
        out = kinds_2030.dragged_cable(k, q, np.full_like(q, speed), q)
        back = kinds_2030.dragged_cable(k, q, np.full_like(q, -speed), q)
        assert np.trapezoid(out - back, q) == pytest.approx(-3.0, rel=1e-6)
    assert kinds_2030.dragged_cable(k, np.array([0.2]), np.array([1.0]), q[:1])[0] == 0.0
    same = [kinds_2030.dragged_cable(k, np.array([a]), np.array([1.0]), q[:1])[0] for a in (-0.3, 0.7)]
    assert same[0] == pytest.approx(same[1])


def test_a_slipping_flywheel_is_integrated_exactly():
    def slope(t, y):
        _, v, _, r = y
        grip = 1.5 * np.tanh((r - v) / 0.05)
        return [v, (6 * np.sin(5 * t) + grip) / 2.0, r, -grip / 0.8]

    effect = TrueEffect("slipping_flywheel", "q", FLYWHEEL)
    s, z = driven("slider", {"mass": 2.0}, effect, [0.1, 0.5], lambda t: 6 * np.sin(5 * t), 2.0)
    exact = reference(slope, [0.1, 0.5, 0.1, 0.5], 2.0, 2001)
    np.testing.assert_allclose(np.hstack([s, z]), exact, atol=5e-5)
    assert np.abs(z[:, 1] - s[:, 1]).max() > 2 * 0.05  # it slipped


@pytest.mark.parametrize(("push", "acceleration"), [(1.0, 1.0 / 2.8), (20.0, (20.0 - 1.5) / 2.0)])
def test_a_flywheel_comes_along_gently_and_slips_when_jerked(push, acceleration):
    effect = TrueEffect("slipping_flywheel", "q", FLYWHEEL)
    s, z = driven("slider", {"mass": 2.0}, effect, [0.0, 0.0], lambda t: push, 1.5)
    assert (s[-1, 1] - s[-501, 1]) / 0.5 == pytest.approx(acceleration, rel=1e-3)
    momentum = 2.0 * s[:, 1] + 0.8 * z[:, 1]
    np.testing.assert_allclose(momentum, push * H * np.arange(len(s)), atol=1e-9)


def test_a_clutch_never_gives_energy():
    effect = TrueEffect("slipping_flywheel", "q", FLYWHEEL)
    body, t, none = Body("slider", {"mass": 2.0}, [effect]), np.zeros(1), np.zeros((1, 1))
    s, z = np.array([[0.0, 3.0]]), np.array([[0.0, -1.0]])
    energies = []
    for _ in range(3000):
        energies.append(s[0, 1] ** 2 + 0.4 * z[0, 1] ** 2)
        s, z = body.step(s, z, none, t, t, H)
    assert np.diff(energies).max() < 1e-12
    assert energies[-1] == pytest.approx(0.5 * (6.0 - 0.8) ** 2 / 2.8, rel=1e-6)  # what moving together has


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


def test_a_tether_is_the_slope_of_its_energy():
    rng, step = np.random.default_rng(0), 1e-6
    s = rng.uniform(-1.5, 1.5, (300, 4)) * [1, 1, 2, 1]

    def energy(s):
        far = np.hypot(s[:, 0] + 0.8 * np.sin(s[:, 2]), 0.8 * np.cos(s[:, 2]))
        return 6.0 * np.maximum(far - 0.6, 0.0) ** 2

    force = kinds_2030.tip_tether(TETHER, s)
    for c, column in enumerate((0, 2)):
        aside = step * np.eye(4)[column]
        slope = (energy(s + aside) - energy(s - aside)) / (2 * step)
        np.testing.assert_allclose(force[:, c], -slope, atol=1e-6)
    slack = np.array([[-0.75, 0.0, np.pi / 2, 0.0]])
    assert (kinds_2030.tip_tether(TETHER, slack) == 0).all()


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


def acted(actuator, commands):
    """What acts in each fine step under commands (K,)."""
    none = np.zeros((1, 4))
    return np.array([actuator.act(np.array([u]), none, none[:, 0], H)[0] for u in commands])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_chamber_fills_fast_and_vents_slowly(side):
    out = side * acted(kinds_2030.PneumaticValve(VALVE), side * np.repeat([2.0, 0.5], [500, 500]))
    middle = H * (np.arange(500) + 0.5)  # the mean of a step is what is in its middle, to (h / T)^2 / 24
    np.testing.assert_allclose(out[:500], 2.0 * (1 - np.exp(-middle / 0.02)), atol=3e-4)
    np.testing.assert_allclose(out[500:], 0.5 + 1.5 * np.exp(-middle / 0.3), atol=1e-5)


def test_a_chamber_vents_to_nothing_and_fills_on_the_other_side():
    out = acted(kinds_2030.PneumaticValve(VALVE), np.repeat([1.0, -1.0], [500, 500]))
    crossing = int(np.flatnonzero(out < 0)[0]) - 500
    assert crossing * H == pytest.approx(0.3 * np.log(2.0), abs=2 * H)
    assert out[500 + crossing + 100] == pytest.approx(-1.0, abs=0.01)


def test_a_stick_is_soft_in_the_middle_and_right_at_its_end():
    u = np.linspace(-2, 2, 401)
    out = acted(kinds_2030.ExpoCurve({"softness": 0.6, "full": 2.0}), u)
    assert (np.diff(out) > 0).all()
    np.testing.assert_allclose(out, -out[::-1], atol=1e-12)
    assert out[-1] == pytest.approx(2.0)
    assert (out[201] - out[199]) / (u[201] - u[199]) == pytest.approx(0.4, abs=1e-4)


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
    v, w = kinds_2030.hill(k, np.full(200, 0.6), s[:, 0], s)
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


def test_an_encoder_counts_multiples_of_its_step_and_is_off_by_half_of_one():
    y = np.linspace(-1.3, 1.3, 1001)
    read = kinds_2030.coarse_encoder({"step": 0.1}, y)
    np.testing.assert_allclose(read / 0.1, np.round(read / 0.1), atol=1e-9)
    assert np.abs(read - y).max() <= 0.05 + 1e-12
    assert len(np.unique(np.round(read, 6))) == 27


def test_a_sensor_that_warms_up_is_right_when_cold_and_off_by_its_offset_when_warm():
    effect = TrueEffect("warming_sensor", "q", {"offset": 0.3, "time": 0.4})
    past = np.random.default_rng(0).normal(size=(4001, 3, 2))
    names = ("q", "q_dot")
    assert (sense([effect], names, past, 0, H) == past[0]).all()
    off = sense([effect], names, past, 400, H) - past[400]
    np.testing.assert_allclose(off[:, 0], 0.3 * (1 - np.exp(-1)))
    assert (off[:, 1] == 0).all()
    np.testing.assert_allclose((sense([effect], names, past, 4000, H) - past[4000])[:, 0], 0.3, atol=2e-5)


@pytest.mark.parametrize(
    ("kind", "system"),
    [
        ("slipping_flywheel", "cartpole"),
        ("leaking_tank", "pendulum"),
        ("tip_tether", "cartpole"),
        ("hill", "unicycle"),
    ],
)
def test_what_is_hidden_is_known_when_a_run_is_replayed(kind, system):
    check_replay(kind, system)


def test_where_they_act():
    assert drawing.places_of("tip_tether", SYSTEMS["cartpole"], "measured") == ["x"]
    assert drawing.places_of("tip_tether", SYSTEMS["slider"], "measured") == []
    assert drawing.places_of("coarse_encoder", SYSTEMS["unicycle"], None) == ["yaw"]
    assert drawing.places_of("warming_sensor", SYSTEMS["slider"], "differentiated") == ["q"]
