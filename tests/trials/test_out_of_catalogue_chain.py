"""Actuators, sensors and twists outside the catalogue, held against closed forms, loops and another integrator."""

from itertools import accumulate

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gpsim.trials.bodies import Now, Vehicle
from gpsim.trials.out_of_catalogue import KINDS
from gpsim.trials.truth import ActuatorChain, frame_of, sense
from gpsim.trials.worlds import TrueEffect

from .outside_worlds import H, world_of

COMMAND = np.repeat([1.0, 2.0, -2.0, 0.0, -1.0, 3.0, 0.3, 0.09, -0.5], 100)
T = H * np.arange(len(COMMAND))  # s
Q, V = 0.4 * np.sin(3 * T), 1.5 * np.cos(7 * T)  # what a body does meanwhile


def acted(kind, values, command):
    """(K,) what acts in each fine step of a slider."""
    chain = ActuatorChain(frame_of(world_of("slider")), [TrueEffect(kind, "force", values)])
    each = zip(command[:, None, None], np.stack([Q, V], axis=1)[:, None], T[:, None], strict=True)
    return np.array([chain.act(u, s, t, H)[0, 0] for u, s, t in each])


def superposed(steps, response):
    """(K,) the sum of the responses to every change of what is held, from 0; response(s since it)."""
    changes = np.diff(steps, prepend=0.0)
    return sum((T[i] <= T) * changes[i] * response(np.abs(T - T[i])) for i in np.flatnonzero(changes))


def nearest(y, step):
    """The level next to y of all multiples of the step."""
    levels = step * np.arange(-60, 61)
    return levels[np.abs(np.subtract.outer(y, levels)).argmin(axis=-1)]


def pulses(u):
    """Open for the first |u| / U of every period: the mean over each step, of 400 moments in it."""
    phase = (T[:, None] + H * (np.arange(400) + 0.5) / 400) / 0.0437 % 1
    return 2.5 * np.sign(u) * (phase < np.abs(u)[:, None] / 2.5).mean(axis=1)


def ringing(u):
    turn, decay = 2 * np.pi * 4, 0.2 * 2 * np.pi * 4
    ring = turn * np.sqrt(1 - 0.2**2)
    respond = lambda t: 1 - np.exp(-decay * t) * (np.cos(ring * t) + decay / ring * np.sin(ring * t))  # noqa: E731
    return superposed(u, lambda t: (respond(t) + respond(t + H)) / 2)  # a step's two ends


def filled(u):
    """By many short steps of its equation; the mean over each of the fine ones."""
    level, out = 0.0, []
    for want in np.repeat(u, 100):
        level += H / 100 * (want - level) / (0.1 if (want - level) * level >= 0 else 0.3)
        out.append(level)
    return np.reshape(out, (-1, 100)).mean(axis=1)


def lost(u):
    """The last command before an outage, by the published hash of its number."""
    chance = np.abs(np.sin(12.9898 * np.floor((T + H / 2) / 0.06) + 2)) * 43758.5453 % 1
    arrived = np.where(chance < 0.25, 0, np.arange(1, len(u) + 1))
    return np.append(0.0, u)[np.maximum.accumulate(arrived)]


def reversing(u):
    """Open between a change of sign and the end of its pause; the share of each step in which it is closed."""
    opened, side, until = [], 0.0, 0.0
    for t, want in zip(T, u, strict=True):
        until = t + 0.0305 if want * side < 0 else until
        side = np.sign(want) or side
        opened.append(np.clip((until - t) / H, 0, 1))
    return u * (1 - np.array(opened))


WAVES = {"wave_number": 5.0, "phase": 0.4}
ACTUATORS = [
    ("position_gain", {"depth": 0.5, **WAVES}, lambda u: u + 0.5 * np.sin(5 * Q + 0.4) * u, 1e-12),
    ("quantised_actuator", {"step": 0.7}, lambda u: nearest(u, 0.7), 1e-12),
    ("worm_gear", {"friction": 0.3, "speed": 0.05}, lambda u: u - 0.3 * abs(u) * np.tanh(20 * V), 1e-12),
    ("power_limit", {"power": 1.5}, lambda u: np.where(u * V > 1.5, 1.5 / V, u), 1e-12),
    ("expo_curve", {"softness": 0.6, "full": 2.0}, lambda u: 0.4 * u + 0.15 * u**3, 1e-12),
    ("pulsed_thrusters", {"full": 2.5, "period": 0.0437}, pulses, 0.02),
    ("supply_ripple", {"depth": 0.3, "frequency": 0.5, "phase": 0.7},
     lambda u: u * (1 + 0.3 * np.sin(np.pi * T + 0.7)), 1e-12),
    ("ringing_actuator", {"frequency": 4.0, "damping_ratio": 0.2}, ringing, 1e-9),
    ("lost_commands", {"share": 0.25, "outage": 0.06, "phase": 2.0}, lost, 0),
    ("hot_motor", {"loss": 0.4, "rated": 2.0, "time": 0.5},
     lambda u: u * (1 - 0.1 * superposed(u**2, lambda t: 1 - np.exp(-2 * t))), 1e-9),
    ("sticky_valve", {"band": 0.5}, lambda u: list(accumulate(
        u, lambda at, want: want if abs(want - at) > 0.5 else at, initial=0.0))[1:], 0),
    ("pneumatic_valve", {"fill": 0.1, "vent": 0.3}, filled, 0.02),
    ("reversing_contactor", {"pause": 0.0305}, reversing, 1e-9),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values", "expected", "near"), ACTUATORS)
def test_a_command_becomes_what_its_law_says(kind, values, expected, near):
    found = acted(kind, values, COMMAND)
    np.testing.assert_allclose(found, expected(COMMAND), rtol=0, atol=near)
    assert np.abs(found - COMMAND).max() > 0.2


def test_a_drive_folds_back_when_hot_and_recovers_when_cool():
    values = {"share": 0.6, "rated": 2.0, "reset": 0.7, "time": 0.1}
    out = -acted("overload_foldback", values, np.full(len(T), -2.5))
    turns = (np.flatnonzero(np.diff(out)) + 1) * H
    assert set(out.tolist()) == {2.5, 1.5}
    full, less = 2.5**2 / 4, 1.5**2 / 4  # what its heat goes to
    first, cool, heat = np.log([full / (full - 1), (1 - less) / (0.7 - less), (full - 0.7) / (full - 1)]) / 10
    np.testing.assert_allclose(np.diff(turns, prepend=0)[:4], [first, cool, heat, cool], atol=2 * H)
    assert (acted("overload_foldback", values, np.full(len(T), 1.99)) == 1.99).all()  # within its rating


AMPLITUDE, SPEED = np.array([0.3, 1.0, -0.7]), np.array([6.0, 4.0, 9.0])


def true(t):
    """(..., 3) of three episodes, which begin at rest."""
    return 0.4 + AMPLITUDE * np.sin(SPEED * np.asarray(t)[..., None] / 2) ** 2


def swaying(y):
    """The marker's own equation, by another method."""

    def slope(t, y):
        rate = AMPLITUDE * SPEED / 2 * np.sin(SPEED * t)
        return [*y[3:], *((3 * np.pi) ** 2 * (true(t) - y[:3]) + 1.2 * np.pi * (rate - y[3:]))]

    exact = solve_ivp(slope, (0, T[-1]), [0.4] * 3 + [0.0] * 3, "DOP853", t_eval=T, rtol=1e-10, atol=1e-12)
    return exact.y[:3].T


SENSORS = [
    ("eccentric_encoder", {"amplitude": 0.2, **WAVES}, lambda y: y + 0.2 * np.sin(5 * y + 0.4), 1e-12),
    ("coarse_encoder", {"step": 0.1}, lambda y: nearest(y, 0.1), 1e-12),
    ("stuck_bit", {"step": 0.1}, lambda y: y - 0.1 * (np.floor(y / 0.1).astype(int) & 1), 1e-12),
    ("slow_sensor", {"period": 0.045}, lambda y: y[np.arange(len(y)) // 45 * 45], 0),
    ("loose_marker", {"frequency": 1.5, "damping_ratio": 0.2}, swaying, 1e-4),
    ("warming_sensor", {"offset": 0.3, "time": 0.4}, lambda y: y + 0.3 * (1 - np.exp(-T / 0.4))[:, None], 1e-12),
    ("encoder_play", {"gap": 0.1},  # pushed by the ends of its gap, from the middle
     lambda y: list(accumulate(y, lambda at, now: np.clip(at, now - 0.1, now + 0.1))), 1e-12),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values", "expected", "near"), SENSORS)
def test_a_reading_is_what_its_law_says_and_its_velocity_is_another_sensors(kind, values, expected, near):
    past = np.stack([true(T), true(T + 1)], axis=2)
    effect = TrueEffect(kind, "q", values)
    read = np.array([sense([effect], ("q", "q_dot"), past, i, H) for i in range(len(T))])
    np.testing.assert_allclose(read[:, :, 0], expected(true(T)), rtol=0, atol=near)
    assert (read[:, :, 1] == past[:, :, 1]).all()
    assert np.abs(read - past).max() > 0.04


def test_a_fisheye_draws_radii_together_and_keeps_directions():
    past = np.random.default_rng(0).uniform(-5, 5, (1, 50, 3))
    x, y, yaw = past[0].T
    way, seen = np.arctan2(y, x), 2 * np.sin(np.arctan(np.hypot(x, y) / 2))
    read = sense([TrueEffect("fisheye_camera", "pose", {"height": 2.0})], ("x", "y", "yaw"), past, 0, H)
    np.testing.assert_allclose(read.T, [seen * np.cos(way), seen * np.sin(way), yaw], atol=1e-12)


def height(x, y):
    return np.exp(-2 * ((x - 0.4) ** 2 + (y + 0.3) ** 2))  # of radius 0.5


def uphill(v, w, s, z):
    """Slower by the slope along the way, in parts of the steepest."""
    x, y, cos, sin = s[0], s[1], np.cos(s[2]) * 1e-5, np.sin(s[2]) * 1e-5
    return v - 0.2 * (height(x + cos, y + sin) - height(x - cos, y - sin)) / 2e-5 * 0.5 * np.exp(0.5), w


def wheels(left, right, *more):
    """Twist of a vehicle whose wheels, 0.4 m apart, roll so fast."""
    return (left + right) / 2, (right - left) / 0.4, *more


def trolley(v, w, s, z):
    """The trolley's axle does not slip, so it turns by what its drawbar's end moves aside."""
    aside = v * np.sin(z) / 0.4
    return v, w - 0.5 * aside, w - 0.5 * aside - aside


TWISTS = [  # kind, values; v, w and the slope of the hidden state, of the commanded twist, the pose and that state
    ("curve_slowdown", {"loss": 0.3}, lambda v, w, s, z: (v - 0.3 * v * np.minimum(abs(w), 2.5), w)),
    ("heading_slope", {"amplitude": 0.2, "phase": 0.4}, lambda v, w, s, z: (v + 0.2 * np.sin(s[2] - 0.4), w)),
    ("carpet", {"depth": 0.6, "x": 0.4, "y": -0.3, "radius": 0.5},
     lambda v, w, s, z: (v - 0.6 * v * height(s[0], s[1]), w)),
    ("hill", {"loss": 0.2, "x": 0.4, "y": -0.3, "radius": 0.5}, uphill),
    ("wheel_speed_limit", {"half_track": 0.2, "limit": 0.55},
     lambda v, w, s, z: wheels(*np.clip([v - 0.2 * w, v + 0.2 * w], -0.55, 0.55))),
    ("weathervane", {"turn": 0.4, "wind": 1.0}, lambda v, w, s, z: (v, w - 0.4 * np.sin(s[2] - 1))),
    ("grooved_floor", {"turn": 0.3, "line": 0.8}, lambda v, w, s, z: (v, w - 0.3 * np.sin(2 * s[2] - 1.6))),
    ("towed_trolley", {"length": 0.4, "pull": 0.5}, trolley),
    ("eccentric_wheel", {"depth": 0.2, "half_track": 0.2, "radius": 0.1},
     lambda v, w, s, z: wheels((v - 0.2 * w) * (1 + 0.2 * np.sin(z)), v + 0.2 * w, 10 * (v - 0.2 * w))),
    ("tyre_relaxation", {"length": 0.3}, lambda v, w, s, z: (v, z, abs(v) / 0.3 * (w - z))),
    ("lagging_wheel", {"time": 0.2, "half_track": 0.2},
     lambda v, w, s, z: wheels(z, v + 0.2 * w, (v - 0.2 * w - z) / 0.2)),
    ("twisting_cable", {"rate": 0.4}, lambda v, w, s, z: (v, w - 0.4 * z, w - 0.4 * z)),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "values", "twist"), TWISTS)
def test_a_vehicle_goes_where_its_twist_takes_it_by_another_method(kind, values, twist):
    u, none = np.array([[0.5, 0.0], [0.4, 2.8], [-0.6, 0.7]]), np.zeros(3)
    vehicle, s = Vehicle([TrueEffect(kind, "vehicle", values)]), np.transpose([none, none, [0.0, -2.0, 1.5]])
    path = [(s, vehicle.begin(s))]
    for _ in range(3000):
        path.append(vehicle.step(*path[-1], Now(u, none, none), H))
    found = np.array([np.hstack(part).T.ravel() for part in path[::1000]])

    def slope(t, y):
        x, y, heading, *hidden = y.reshape(-1, 3)
        ahead, turn, *more = twist(*u.T, (x, y, heading), *hidden or [0])
        return np.concatenate([ahead * np.cos(heading), ahead * np.sin(heading), turn, *more])

    exact = solve_ivp(slope, (0, 3), found[0], "DOP853", t_eval=range(4), rtol=1e-10, atol=1e-12).y.T
    np.testing.assert_allclose(found, exact, atol=1e-7)


def test_every_kind_before_and_after_a_body_is_held_against_something():
    told = {row[0] for row in (*ACTUATORS, *SENSORS, *TWISTS)}
    alone = {"overload_foldback", "fisheye_camera"}
    assert told | alone == {n for n, kind in KINDS.items() if not kind.of_body or "unicycle" in kind.systems}
