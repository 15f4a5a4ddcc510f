"""Recordings that show a part of their system only: free swings, held carts, a robot of which the yaw is known."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.setup import check_moves, look, not_asked, offers_of, prepare
from gpsim.errors import UsageError
from gpsim.recordings import Episode
from gpsim.reports.diagnosis_text import not_asked_lines
from gpsim.simulators import make_simulator

from .worlds import H, World, mechanical_step, record


def without_actions(recording):
    return replace(
        recording,
        action=Channels(()),
        episodes=tuple(replace(e, actions=np.zeros((len(e), 0))) for e in recording.episodes),
    )


def with_states(recording, change):
    return replace(recording, episodes=tuple(replace(e, states=change(e.states)) for e in recording.episodes))


def commanding(recording, *levels):
    still = [np.tile(levels, (len(e), 1)) for e in recording.episodes]
    pairs = zip(recording.episodes, still, strict=True)
    return replace(recording, episodes=tuple(replace(e, actions=a) for e, a in pairs))


def keeping(recording, *names):
    columns = [recording.state.index(name) for name in names]
    return replace(
        recording,
        state=Channels(tuple(c for c in recording.state if c.name in names)),
        episodes=tuple(replace(e, states=e.states[:, columns]) for e in recording.episodes),
        noise={n: recording.noise[n] for n in names if n in recording.noise},
    )


def free_decay(damping=0.02, episodes=6, steps=150, dt=0.02, noise=0.002):
    """A damped pendulum that nobody drives."""
    world = World("pendulum", forces={0: lambda q, v, t: -damping * v})
    rng, fine = np.random.default_rng(5), round(dt / H)
    state = np.stack([rng.uniform(1.0, 2.0, episodes), np.zeros(episodes)], axis=1)
    rows, none = [state], np.zeros((episodes, 1))
    for k in range(steps * fine):
        state = mechanical_step(world, state, none, k * H, H)
        rows.append(state)
    clean = np.stack(rows)[::fine]
    measured = clean + rng.normal(size=clean.shape) * [noise, 10 * noise]
    t, actions = dt * np.arange(steps + 1), np.zeros((steps, 1))
    like = record(World("pendulum"), episodes=1, steps=5)
    told = {"theta": noise, "theta_dot": 10 * noise}
    own = tuple(Episode(str(i), t, measured[:, i], actions) for i in range(episodes))
    return replace(like, episodes=own, held_out=None, noise=told)


def prepared(recording):
    simulator = make_simulator(recording.system)
    return prepare(recording, simulator, simulator.defaults(recording.parameters))


def test_a_free_decay_without_any_command_is_diagnosed():
    recording = without_actions(free_decay())
    simulator = make_simulator("pendulum")
    found = diagnose(recording, simulator, {**simulator.defaults()}, np.random.default_rng(0))
    (effect,) = found.diagnosis.effects
    assert (effect.family, effect.on) == ("viscous_friction", "theta")
    assert effect.parameters["damping"].value == pytest.approx(0.02, rel=0.05)
    (entry,) = found.diagnosis.not_asked
    assert (entry.because, entry.channel, entry.value) == ("no command", "torque", 0.0)
    assert "actuator_bias" in entry.families
    (line,) = not_asked_lines(found.diagnosis.not_asked)
    assert line.startswith("torque was not recorded and is taken as 0 N m; not asked: actuator gain, ")


@pytest.mark.parametrize("level", [0.0, 1.5])
def test_of_a_command_that_never_changes_only_what_shows_is_asked(level):
    question = prepared(commanding(free_decay(), level))
    asked = {c.family for c in offers_of(question) if c.place.on == "torque"}
    assert asked == ({"actuator_gain", "actuator_bias", "battery_sag"} if level else set())
    (entry,) = not_asked(question)
    assert (entry.because, entry.value) == ("constant command", level)


def test_a_constant_speed_is_a_command_for_a_vehicle():
    recording = record(World("unicycle"), episodes=5, steps=100)
    turning = [np.stack([np.full(len(e), 0.5), e.actions[:, 1]], axis=1) for e in recording.episodes]
    pairs = zip(recording.episodes, turning, strict=True)
    recording = replace(recording, episodes=tuple(replace(e, actions=a) for e, a in pairs))
    asked = {(c.family, c.place.on) for c in offers_of(prepared(recording))}
    assert ("actuator_gain", "v_cmd") in asked
    assert ("actuator_delay", "v_cmd") not in asked
    assert ("actuator_delay", "w_cmd") in asked


def test_a_held_cart_is_a_mount_for_its_pole():
    recording = with_states(
        record(World("cartpole"), episodes=5, steps=100), lambda s: s * [0.0, 0.0, 1.0, 1.0] + [0.2, 0, 0, 0]
    )
    question = prepared(recording)
    assert question.sight.held == {"x": 0.2, "x_dot": 0.0}
    assert question.everything.simulator.state.names == ("theta", "theta_dot")
    assert question.whole.state.names == recording.state.names
    assert not {c.place.on for c in offers_of(question)} & {"x", "x_dot"}
    said = not_asked_lines(not_asked(question))
    assert said[0].startswith("x never changes (0.2 m): it is taken as held by a mount; not asked: coulomb")


def test_a_dead_sensor_and_a_recording_in_which_nothing_moves_are_refused():
    recording = record(World("slider"), episodes=5, steps=60)
    simulator = make_simulator("slider")
    dead = with_states(recording, lambda s: s * [1.0, 0.0])
    with pytest.raises(
        UsageError, match="channel q_dot is constant \\(0\\) .* while q moves; check the sensor"
    ):
        prepared(dead)
    with pytest.raises(UsageError, match="nothing moves: q, q_dot never change from episode 0 to episode 4"):
        prepared(with_states(recording, lambda s: 0.0 * s))
    check_moves(recording, simulator, look(recording, simulator))


def looked(system, *names):
    return look(keeping(record(World(system), episodes=4, steps=40), *names), make_simulator(system))


def test_states_that_no_measured_rate_needs_are_dropped_and_others_estimated():
    assert (looked("unicycle", "yaw").dropped, looked("unicycle", "yaw").hidden) == (("x", "y"), ())
    assert (looked("unicycle", "x", "y").dropped, looked("unicycle", "x", "y").hidden) == ((), ("yaw",))
    assert looked("unicycle", "x").hidden == ("yaw",)
    assert looked("unicycle", "x").dropped == ("y",)
    assert looked("cartpole", "x", "theta").hidden == ("x_dot", "theta_dot")
    assert looked("cartpole", "theta", "theta_dot").dropped == ("x", "x_dot")
    assert looked("slider", "q_dot").hidden == ("q",)
    assert looked("pendulum", "theta_dot").hidden == ("theta",)


def test_a_recording_with_none_of_the_states_or_with_another_is_refused():
    recording, simulator = record(World("slider"), episodes=4, steps=40), make_simulator("slider")
    for names in ((), ("speed",)):
        strange = replace(
            recording,
            state=Channels.of(dict.fromkeys(names, "m")),
            episodes=tuple(replace(e, states=e.states[:, : len(names)]) for e in recording.episodes),
            noise={},
        )
        with pytest.raises(UsageError, match="simulator slider needs"):
            look(strange, simulator)


def test_a_heading_is_guessed_from_where_the_commands_lead():
    full = record(World("unicycle"), seed=3, episodes=3, steps=60)
    recording = keeping(full, "x", "y")
    guessed = look(recording, make_simulator("unicycle")).completed(recording)
    assert guessed.state.names == full.state.names
    driven = [np.abs(e.actions[:, 0]) > 0.4 for e in full.episodes]
    pairs = zip(guessed.episodes, full.episodes, driven, strict=True)
    off = [np.cos(g.states[:-1, 2] - f.states[:-1, 2])[d] for g, f, d in pairs]
    assert np.mean(np.concatenate(off) > 0.9) > 0.9


def test_a_velocity_is_guessed_from_its_position_and_the_other_way_round():
    full = record(World("slider"), episodes=3, steps=60, noise=0.0)
    simulator = make_simulator("slider")
    recording = keeping(full, "q")
    guessed = look(recording, simulator).completed(recording)
    for g, f in zip(guessed.episodes, full.episodes, strict=True):
        np.testing.assert_allclose(g.states[1:-1, 1], f.states[1:-1, 1], atol=0.05)


@pytest.mark.slow
def test_a_robot_of_which_only_the_yaw_is_known_is_diagnosed():
    world = World("unicycle", twist=lambda v, lateral, w: (v, lateral, w / (1.0 + 0.8 * v * v)))
    recording = keeping(record(world, episodes=6, steps=120), "yaw")
    simulator = make_simulator("unicycle")
    found = diagnose(recording, simulator, {}, np.random.default_rng(0))
    (effect,) = found.diagnosis.effects
    assert effect.family == "understeer"
    assert effect.parameters["gradient"].value == pytest.approx(0.8, rel=0.03)
    assert set(found.diagnosis.fit.one_step) == {"w"}
    assert set(found.diagnosis.fit.rollout.channels) == {"yaw"}
    assert found.plant.state.names == ("x", "y", "yaw")
    said = not_asked_lines(found.diagnosis.not_asked)
    assert len(said) == 2
    assert said[0].startswith("x was not measured, and no measured channel depends on it: it is left out")


@pytest.mark.slow
def test_a_robot_of_which_the_yaw_is_not_known_is_diagnosed():
    def weak(u, t, h, memory):
        return u * [1.0, 0.8]

    recording = keeping(record(World("unicycle", filters=[weak]), episodes=6, steps=120), "x", "y")
    simulator = make_simulator("unicycle")
    found = diagnose(recording, simulator, {}, np.random.default_rng(0))
    (effect,) = found.diagnosis.effects
    assert (effect.family, effect.on) == ("actuator_gain", "w_cmd")
    assert effect.parameters["gain"].value == pytest.approx(0.8, rel=0.03)
    assert found.diagnosis.not_measured == ("yaw",)
