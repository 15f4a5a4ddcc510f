"""Actuators outside the catalogue, as physics: limits, memory, means."""

import numpy as np
import pytest

from gpsim.trials.outside import actuators
from gpsim.trials.truth.body import Body
from gpsim.trials.truth.running import ActuatorChain, frame_of
from gpsim.trials.worlds import TrueEffect

from .outside_worlds import H, acted, world_of

VALVE = {"fill": 0.02, "vent": 0.3}
FOLDBACK = {"share": 0.6, "rated": 2.0, "reset": 0.7, "time": 0.3}


def test_a_worm_gear_loses_power_and_lets_a_standing_body_be():
    k = {"friction": 0.3, "speed": 0.05}
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(-2, 2, 21), np.linspace(-1, 1, 21)))
    s = np.stack([0 * v, v], axis=1)
    out = actuators.WormGear(k).act(u, s, 0 * u, 1e-3)
    assert ((out - u) * v <= 0).all()
    assert (out[v == 0] == u[v == 0]).all()
    assert out[(u == 2) & (v == 1)] == pytest.approx(2 * 0.7)  # it drives
    assert out[(u == 2) & (v == -1)] == pytest.approx(2 * 1.3)  # it holds back


@pytest.mark.parametrize("clock", ["session", "episode"])
def test_in_an_outage_the_last_command_goes_on(clock):
    effect, steps = TrueEffect("lost_commands", "force", {"share": 0.25, "outage": 0.06, "phase": 2.0}), 600
    world = world_of("slider", [effect], steps=steps, clock=clock)
    commands = np.random.default_rng(0).normal(size=(steps, 4, 1))
    chain, given = ActuatorChain(frame_of(world_of("slider")), [effect]), []
    for i in range(steps * 20):
        t = world.clock_offsets + i // 20 * world.dt + i % 20 * 1e-3
        given.append(chain.act(commands[i // 20], np.zeros((4, 2)), t, 1e-3)[:, 0])
    held = np.reshape(given, (steps, 20, 4))
    assert (held == held[:, :1]).all()  # nothing is lost halfway
    lost = held[:, 0] != commands[:, :, 0]
    assert lost.mean() == pytest.approx(0.25, abs=0.08)
    assert (held[1:, 0][lost[1:]] == held[:-1, 0][lost[1:]]).all()
    assert (lost[0::3, 0] == lost[1::3, 0]).all()
    assert (lost[0::3, 0] == lost[2::3, 0]).all()
    assert (lost[:, 0] == lost[:, 1]).all() == (clock == "episode")


def test_a_hot_motor_is_as_good_as_new_when_cold():
    k = {"loss": 0.4, "rated": 2.0, "time": 0.5}
    motor, u = actuators.HotMotor(k), np.array([2.0, -2.0, 0.5])
    out = np.array([motor.act(u, np.zeros((3, 2)), np.zeros(3), 1e-3) for _ in range(6000)])
    assert out[0].tolist() == u.tolist()
    np.testing.assert_allclose(out[500], u * (1 - 0.4 * (u / 2.0) ** 2 * (1 - np.exp(-1.0))), rtol=1e-6)
    np.testing.assert_allclose(out[-1], u * (1 - 0.4 * (u / 2.0) ** 2), rtol=1e-4)


def test_a_sticky_valve_stays_within_its_band_and_then_jumps():
    valve = actuators.StickyValve({"band": 0.5})
    commands = [0.3, 0.5, 0.6, 0.2, 0.09, 0.5, -0.5, -0.4]
    none = np.zeros((2, 2))
    acted = [valve.act(np.array([u, -u]), none, none[:, 0], H)[0] for u in commands]
    assert acted == [0.0, 0.0, 0.6, 0.6, 0.09, 0.09, -0.5, -0.5]


def test_a_supply_gives_so_much_power_and_brakes_in_full():
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(-2, 2, 21), np.linspace(-3, 3, 21)))
    out = actuators.PowerLimit({"power": 1.5}).act(u, np.stack([0 * v, v], axis=1), 0 * u, H)
    assert (out * v <= 1.5 + 1e-12).all()
    free = u * v <= 1.5
    assert (out[free] == u[free]).all()
    np.testing.assert_allclose((out * v)[~free], 1.5)
    assert (np.sign(out) == np.sign(u)).all()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_chamber_fills_fast_and_vents_slowly(side):
    out = side * acted(actuators.PneumaticValve(VALVE), side * np.repeat([2.0, 0.5], [500, 500]))
    middle = H * (np.arange(500) + 0.5)  # the mean of a step is what is in its middle, to (h / T)^2 / 24
    np.testing.assert_allclose(out[:500], 2.0 * (1 - np.exp(-middle / 0.02)), atol=3e-4)
    np.testing.assert_allclose(out[500:], 0.5 + 1.5 * np.exp(-middle / 0.3), atol=1e-5)


def test_a_chamber_vents_to_nothing_and_fills_on_the_other_side():
    out = acted(actuators.PneumaticValve(VALVE), np.repeat([1.0, -1.0], [500, 500]))
    crossing = int(np.flatnonzero(out < 0)[0]) - 500
    assert crossing * H == pytest.approx(0.3 * np.log(2.0), abs=2 * H)
    assert out[500 + crossing + 100] == pytest.approx(-1.0, abs=0.01)


def test_a_stick_is_soft_in_the_middle_and_right_at_its_end():
    u = np.linspace(-2, 2, 401)
    out = acted(actuators.ExpoCurve({"softness": 0.6, "full": 2.0}), u)
    assert (np.diff(out) > 0).all()
    np.testing.assert_allclose(out, -out[::-1], atol=1e-12)
    assert out[-1] == pytest.approx(2.0)
    assert (out[201] - out[199]) / (u[201] - u[199]) == pytest.approx(0.4, abs=1e-4)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drive_folds_back_when_hot_and_recovers_when_cool(sign):
    out = sign * acted(actuators.OverloadFoldback(FOLDBACK), np.full(3000, sign * 2.5))
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
    drive, none = actuators.OverloadFoldback(FOLDBACK), np.zeros((2, 2))
    command = np.array([1.99, 2.5])
    out = np.array([drive.act(command, none, none[:, 0], H) for _ in range(3000)])
    assert (out[:, 0] == 1.99).all()
    assert (out[:, 1] == acted(actuators.OverloadFoldback(FOLDBACK), np.full(3000, 2.5))).all()


@pytest.mark.parametrize("u", [1.2, -0.4, 0.0, 3.0])
def test_thrusters_are_open_for_their_share_and_give_the_mean(u):
    out = acted(actuators.PulsedThrusters({"full": 2.0, "period": 0.0437}), np.full(4370, u), start=3.1)
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
    chain, body = (
        ActuatorChain(frame_of(world_of("slider")), [effect]),
        Body("slider", {"mass": 2.0}, [effect]),
    )
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


def test_a_ripple_of_the_supply_is_a_gain_that_swings_about_one():
    t = H * np.arange(4000)
    k = {"depth": 0.3, "frequency": 0.5, "phase": 0.7}
    out = acted(actuators.SupplyRipple(k), np.full(4000, 2.0))
    np.testing.assert_allclose(out, 2.0 * (1 + 0.3 * np.sin(np.pi * t + 0.7)), atol=1e-12)
    assert out.mean() == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("pause", [0.03, 0.0305])
def test_a_contactor_is_open_for_its_pause_at_every_change_of_sign_and_at_no_other(pause):
    command = np.repeat([1.0, 2.0, -2.0, 0.0, -1.0, 3.0], 100)
    out = acted(actuators.ReversingContactor({"pause": pause}), command)
    lost = (command - out) * H
    assert lost[:200].tolist() == [0.0] * 200  # more is no reversal
    assert lost[200:300].sum() == pytest.approx(-2.0 * pause)
    assert lost[300:500].tolist() == [0.0] * 200  # nor is nothing, and then the same side again
    assert lost[500:].sum() == pytest.approx(3.0 * pause)
