"""The ten kinds outside the catalogue that began with seed 2031, as physics: limits, energy, hidden states."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from gpsim.trials.drawing import draws as drawing
from gpsim.trials.outside import kinds_2031
from gpsim.trials.truth.body import Body
from gpsim.trials.truth.running import Chain
from gpsim.trials.truth.sensing import sense
from gpsim.trials.truth.vehicle import Vehicle
from gpsim.trials.worlds.systems import SYSTEMS, dynamics
from gpsim.trials.worlds.world import TrueEffect

from .outside_worlds import H, check_replay, driven, reference

CART = {"gravity": 9.8, "cart_mass": 1.2, "pole_mass": 0.2, "pole_half_length": 0.4}
BOB = {"gravity": 9.8, "mass": 0.8, "length": 0.5}
BELT = {"force": 1.5, "belt": 0.7, "speed": 0.05}
TOGGLE = {"stiffness": 40.0, "centre": 0.1, "aside": 0.15, "rest": 0.35}
CHAIN = {"density": 1.6, "edge": 0.3}
SLEDGE = {"friction": 2.0, "slack": 0.2, "inertia": 0.4, "stiffness": 250.0, "speed": 0.02}
AXLE = {"force": 1.2, "radius": 0.1, "speed": 0.05}
FOLDBACK = {"share": 0.6, "rated": 2.0, "reset": 0.7, "time": 0.3}
WHEEL = {"time": 0.2, "half_track": 0.2}


def slid(kind, k, start, push, seconds):
    """State and hidden state of a slider of 2 kg, every fine step."""
    return driven("slider", {"mass": 2.0}, TrueEffect(kind, "q", k), start, push, seconds)


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
    s, _ = driven("pendulum", BOB, effect, [0.0, 0.0], lambda t: 0.0, 30.0)
    assert s[-1, 1] == pytest.approx(0.0, abs=1e-6)
    assert 0.8 * 9.8 * 0.5 * np.sin(s[-1, 0]) == pytest.approx(1.5 * np.tanh(1 / 0.6), rel=1e-6)


def test_a_toggle_is_the_slope_of_its_springs_energy():
    q, step = np.linspace(-0.8, 0.9, 401), 1e-6
    energy = lambda q: 20.0 * (np.hypot(q - 0.1, 0.15) - 0.35) ** 2  # noqa: E731
    force = kinds_2031.toggle_spring(TOGGLE, q, q, q)
    np.testing.assert_allclose(force, -(energy(q + step) - energy(q - step)) / (2 * step), atol=1e-6)


def test_a_toggle_snaps_to_either_side_and_rests_where_its_spring_is_relaxed():
    body = Body("slider", {"mass": 2.0}, [TrueEffect("toggle_spring", "q", TOGGLE)])
    s, none = np.array([[0.101, 0.0], [0.099, 0.0]]), np.zeros(2)
    for _ in range(20_000):
        s, _ = body.step(s, np.empty((2, 0)), -3.0 * s[:, 1:], none, none, H)
    relaxed = np.sqrt(0.35**2 - 0.15**2)
    np.testing.assert_allclose(s[:, 0], [0.1 + relaxed, 0.1 - relaxed], atol=1e-4)


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


def test_a_sledge_is_integrated_exactly():
    def slope(t, y):
        q, v, p, r = y
        rope = 250.0 * np.sign(p - q) * max(abs(p - q) - 0.2, 0.0)
        return [v, (6 * np.sin(4 * t) + rope) / 2.0, r, -(rope + 2.0 * np.tanh(r / 0.02)) / 0.4]

    s, z = slid("towed_sledge", SLEDGE, [0.1, 0.5], lambda t: 6 * np.sin(4 * t), 2.0)
    exact = reference(slope, [0.1, 0.5, 0.1, 0.5], 2.0, 2001)
    np.testing.assert_allclose(np.hstack([s, z]), exact, atol=5e-4)
    assert np.abs(z[:, 0] - s[:, 0]).max() > 0.2  # the rope was taut


def test_a_sledge_is_not_there_within_the_slack_and_then_costs_its_friction():
    s, z = slid("towed_sledge", SLEDGE, [0.0, 0.0], lambda t: 3.0, 6.0)
    first = int(np.argmax(np.abs(z[:, 0] - s[:, 0]) >= 0.2))
    t = H * np.arange(len(s))
    np.testing.assert_allclose(s[:first, 0], 0.75 * t[:first] ** 2, atol=1e-9)
    assert s[first, 0] == pytest.approx(0.2, abs=2e-3)
    momentum = 2.0 * s[:, 1] + 0.4 * z[:, 1]
    lost = cumulative_trapezoid(2.0 * np.tanh(z[:, 1] / 0.02), t, initial=0.0)
    np.testing.assert_allclose(momentum, 3.0 * t - lost, atol=1e-4)
    assert (momentum[-1] - momentum[-1001]) / 1.0 == pytest.approx(3.0 - 2.0, rel=1e-3)


def test_a_sledge_never_gives_energy():
    s, z = slid("towed_sledge", SLEDGE, [0.0, 3.0], lambda t: 0.0, 4.0)
    far = np.maximum(np.abs(z[:, 0] - s[:, 0]) - 0.2, 0.0)
    energy = s[:, 1] ** 2 + 0.2 * z[:, 1] ** 2 + 125.0 * far**2
    # A rope that is taut between two stages of a step only pulls a little early or late.
    assert np.diff(energy).max() < 2e-4
    assert energy[-1] < 0.2 * energy[0]


def test_an_axle_takes_power_where_it_slips_and_none_where_it_rolls():
    rng, step = np.random.default_rng(0), 1e-6
    s = rng.uniform(-3, 3, (300, 4))
    bottom = lambda s: s[:, 0] - 0.1 * s[:, 2]  # noqa: E731  the way of the disc's rim over the track
    later = s + step * np.stack([s[:, 1], 0 * s[:, 1], s[:, 3], 0 * s[:, 3]], axis=1)
    slip = (bottom(later) - bottom(s)) / step
    force = kinds_2031.rubbing_axle(AXLE, s)
    power = (force * s[:, 1::2]).sum(axis=1)
    np.testing.assert_allclose(power, -1.2 * np.tanh(slip / 0.05) * slip, atol=1e-6)
    assert (power <= 0).all()
    rolling = kinds_2031.rubbing_axle(AXLE, np.array([[0.3, 0.2, 1.0, 2.0]]))
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


def acted(actuator, commands, start=0.0):
    """What acts in each fine step under commands (K,)."""
    none = np.zeros((1, 4))
    return np.array(
        [actuator.act(np.array([u]), none, np.full(1, start + i * H), H)[0] for i, u in enumerate(commands)]
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drive_folds_back_when_hot_and_recovers_when_cool(sign):
    out = sign * acted(kinds_2031.OverloadFoldback(FOLDBACK), np.full(3000, sign * 2.5))
    turns = (np.flatnonzero(np.diff(out)) + 1) * H
    assert (set(out.tolist()), len(turns) > 5) == ({2.5, 1.5}, True)
    full, less = 2.5**2 / 4.0, 1.5**2 / 4.0  # what its heat goes to
    heating = 0.3 * np.log((full - 0.7) / (full - 1.0))
    cooling = 0.3 * np.log((1.0 - less) / (0.7 - less))
    assert turns[0] == pytest.approx(0.3 * np.log(full / (full - 1.0)), abs=2 * H)
    np.testing.assert_allclose(np.diff(turns)[0:4:2], cooling, atol=2 * H)
    np.testing.assert_allclose(np.diff(turns)[1:4:2], heating, atol=2 * H)


def test_a_drive_within_its_rating_never_folds_back():
    """Whatever another one of the batch does."""
    drive, none = kinds_2031.OverloadFoldback(FOLDBACK), np.zeros((2, 2))
    command = np.array([1.99, 2.5])
    out = np.array([drive.act(command, none, none[:, 0], H) for _ in range(3000)])
    assert (out[:, 0] == 1.99).all()
    assert (out[:, 1] == acted(kinds_2031.OverloadFoldback(FOLDBACK), np.full(3000, 2.5))).all()


@pytest.mark.parametrize("u", [1.2, -0.4, 0.0, 3.0])
def test_thrusters_are_open_for_their_share_and_give_the_mean(u):
    out = acted(kinds_2031.PulsedThrusters({"full": 2.0, "period": 0.0437}), np.full(4370, u), start=3.1)
    wanted = np.clip(u, -2.0, 2.0)
    np.testing.assert_allclose(out.mean(), wanted, atol=1e-9)  # a hundred periods
    middle = 3.1 + H * (np.arange(4370) + 0.5)
    phase = (middle / 0.0437) % 1.0
    share = abs(wanted) / 2.0
    edge = np.minimum.reduce([np.abs(phase - share), phase, 1.0 - phase]) * 0.0437 < H
    expected = np.where(phase < share, 2.0 * np.sign(u), 0.0)
    np.testing.assert_allclose(out[~edge], expected[~edge], atol=1e-9)


def test_a_slider_under_pulses_gains_the_momentum_of_the_command_once_a_period():
    effect = TrueEffect("pulsed_thrusters", "force", {"full": 4.0, "period": 0.05})
    chain, body = Chain("slider", [effect]), Body("slider", {"mass": 2.0}, [effect])
    s, z, command = np.zeros((1, 2)), np.empty((1, 0)), np.array([[1.0]])
    speeds = [0.0]
    for i in range(1000):
        t = np.full(1, i * H)
        s, z = body.step(s, z, chain.act(command, s, t, H), t, t, H)
        speeds.append(s[0, 1])
    speeds = np.array(speeds)
    np.testing.assert_allclose(speeds[::50], 0.025 * np.arange(21), atol=1e-9)
    # Ahead of a steady push by the most when they shut, a quarter into the period.
    ahead = speeds - 0.5 * H * np.arange(1001)
    assert ahead.max() == pytest.approx(0.0125 * (2.0 - 0.5), abs=3e-4)


def rolled(kind, k, u, seconds, yaw=0.0):
    """(K + 1, 3) and (K + 1, H) pose and hidden state under the twist u (2,)."""
    vehicle = Vehicle([TrueEffect(kind, "vehicle", k)])
    s, t = np.array([[0.0, 0.0, yaw]]), np.zeros(1)
    z = vehicle.begin(s)
    poses, hidden = [s[0]], [z[0]]
    for _ in range(round(seconds / H)):
        s, z = vehicle.step(s, z, np.array([u]), t, t, H)
        poses.append(s[0])
        hidden.append(z[0])
    return np.array(poses), np.array(hidden)


def test_a_vane_turns_into_the_wind_as_its_equation_says():
    poses, _ = rolled("weathervane", {"turn": 0.4, "wind": 1.0}, [0.5, 0.0], 10.0, 3.0)
    # x' = -a sin x: tan(x / 2) = tan(x0 / 2) e^(-a t).
    off = 2 * np.arctan(np.tan(1.0) * np.exp(-0.4 * H * np.arange(len(poses))))
    np.testing.assert_allclose(poses[:, 2] - 1.0, off, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*np.diff(poses[:, :2], axis=0).T), 0.5 * H, rtol=1e-6)


@pytest.mark.parametrize(("v", "w"), [(0.6, 0.0), (0.4, 1.1), (0.0, -0.8)])
def test_a_wheel_that_follows_late_turns_the_vehicle_once(v, w):
    poses, wheel = rolled("lagging_wheel", WHEEL, [v, w], 2.0)
    left, t = v - 0.2 * w, H * np.arange(len(wheel))
    fading = np.exp(-t / 0.2)
    np.testing.assert_allclose(wheel[:, 0], left * (1 - fading), atol=1e-9)
    # What the wheel has not rolled, left T (1 - e^(-t / T)), over the track.
    np.testing.assert_allclose(poses[:, 2], w * t + left * 0.2 * (1 - fading) / 0.4, atol=1e-9)
    along = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    way = (np.gradient(poses[:, :2], H, axis=0).T * along).sum(axis=0)
    np.testing.assert_allclose(way[1:-1], (v - left * fading / 2)[1:-1], atol=1e-5)


def test_a_turn_about_a_wheel_that_stands_is_what_was_commanded():
    poses, wheel = rolled("lagging_wheel", WHEEL, [0.2, 1.0], 1.0)
    np.testing.assert_allclose(wheel, 0.0, atol=1e-12)
    np.testing.assert_allclose(poses[:, 2], H * np.arange(len(wheel)), atol=1e-12)


def test_a_gear_with_play_is_pushed_by_the_ends_of_its_gap():
    """Against the play operator step by step."""
    true = np.cumsum(np.random.default_rng(0).normal(size=(700, 5)) * 0.03, axis=0)
    level, expected = true[0], []
    for now in true:
        level = np.clip(level, now - 0.1, now + 0.1)
        expected.append(level)
    read = [kinds_2031.encoder_play({"gap": 0.1}, true[: i + 1], H) for i in range(len(true))]
    np.testing.assert_allclose(read, expected, atol=1e-12)
    assert np.abs(read - true).max() == pytest.approx(0.1)


def test_a_gear_with_play_stands_while_the_body_crosses_the_gap():
    t = H * np.arange(1000)
    true = 0.5 - 0.3 * np.cos(2 * np.pi * t)[:, None]  # from 0.2 to 0.8 and back
    effect = TrueEffect("encoder_play", "q", {"gap": 0.05})
    past = np.repeat(true[:, :, None], 2, axis=2)
    read = np.array([sense([effect], ("q", "q_dot"), past, i, H)[0] for i in range(1000)])
    assert (read[:, 1] == true[:, 0]).all()  # the velocity's sensor has no gear
    assert read[0, 0] == true[0, 0]
    rising = (t < 0.5) & (true[:, 0] > 0.25)
    np.testing.assert_allclose(read[rising, 0], true[rising, 0] - 0.05, atol=1e-12)
    turned = (t > 0.5) & (true[:, 0] > 0.7)
    np.testing.assert_allclose(read[turned, 0], 0.75, atol=1e-6)
    back = (t > 0.5) & (true[:, 0] < 0.69)
    np.testing.assert_allclose(read[back, 0], true[back, 0] + 0.05, atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "system"),
    [
        ("heaped_chain", "pendulum"),
        ("towed_sledge", "cartpole"),
        ("rubbing_axle", "cartpole"),
        ("overload_foldback", "unicycle"),
        ("pulsed_thrusters", "slider"),
        ("lagging_wheel", "unicycle"),
    ],
)
def test_what_is_hidden_is_known_when_a_run_is_replayed(kind, system):
    check_replay(kind, system)


def test_where_they_act():
    assert drawing.places_of("rubbing_axle", SYSTEMS["cartpole"], "measured") == ["x"]
    assert drawing.places_of("rubbing_axle", SYSTEMS["slider"], "measured") == []
    assert drawing.places_of("pulsed_thrusters", SYSTEMS["unicycle"], None) == []
    assert drawing.places_of("encoder_play", SYSTEMS["unicycle"], None) == ["yaw"]
    assert drawing.places_of("weathervane", SYSTEMS["pendulum"], "measured") == []
