"""How large things may be: long delays on fast clocks, commands that are seldom given, declared bounds."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.channels import Channel, Channels
from gpsim.corrected import Features
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.setup import candidates, prepare
from gpsim.effects import Place, effect_of
from gpsim.simulators import Parameter, make_simulator

from .truths import delayed
from .worlds import World, record


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.08, 0.25])
def test_a_long_delay_on_a_fast_clock_is_named(delay):
    recording = record(World("slider", filters=[delayed(delay)]), seed=3, episodes=6, steps=400, dt=0.01)
    simulator = make_simulator("slider")
    report = diagnose(recording, simulator, recording.parameters, np.random.default_rng(0)).diagnosis
    assert [(e.family, e.on) for e in report.effects] == [("actuator_delay", "force")]
    assert report.effects[0].parameters["delay"].value == pytest.approx(delay, rel=0.01)


def test_a_command_that_is_seldom_given_has_a_size():
    recording = record(World("slider"), episodes=4, steps=100)
    episodes = []
    for episode in recording.episodes:
        actions = np.zeros_like(episode.actions)
        actions[::33] = 7.0
        episodes.append(replace(episode, actions=actions))
    seldom = replace(recording, episodes=tuple(episodes))
    offers = candidates(seldom, make_simulator("slider"), recording.parameters)
    spans = {c.place.span for c in offers if c.place.on == "force"}
    assert spans == {7.0}


def test_a_parameter_stays_within_what_its_simulator_declares():
    simulator = make_simulator("slider")
    simulator.parameters = {"mass": Parameter("kg", 2.0, 1.0, 5.0, "")}  # type: ignore[misc]
    recording = record(World("slider"), episodes=4, steps=100)
    offers = candidates(recording, simulator, {"mass": 2.0})
    (ratio,) = next(c.declared for c in offers if c.family == "parameter_offset")
    assert (ratio.low, ratio.high) == (0.5, 2.5)
    assert effect_of("parameter_offset").parameters(Place("mass", "1"))[0].high == 20.0


def test_features_take_angles_that_run_on_back_into_their_range():
    channels = Channels((Channel("yaw", "rad", wraps=True), Channel("theta", "rad")))
    features = Features.of(["yaw", "theta", "cos(yaw)"], channels)
    values = np.array([[0.5, 0.5], [0.5 + 6 * np.pi, 0.5 + 6 * np.pi]])
    first, later = features(values)
    assert later[0] == pytest.approx(first[0])
    assert later[1] == pytest.approx(0.5 + 6 * np.pi)
    assert later[2] == pytest.approx(first[2])


@pytest.mark.parametrize(("noise", "episodes", "length"), [(1.0, 24, 25), (60.0, 24, 50), (60.0, 12, 25)])
def test_windows_are_longer_where_noise_hides_what_happens_in_one(noise, episodes, length):
    """Noise in units of the worlds' decent sensors; too few windows are not made fewer still."""
    recording = record(World("slider"), seed=3, noise=noise, episodes=episodes, steps=160)
    simulator = make_simulator("slider")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    assert question.everything.windows.length == length
    assert question.held_out.windows.length == length


@pytest.mark.parametrize(("episodes", "steps"), [(100, 24), (12, 40)])
def test_windows_are_not_longer_than_episodes_can_fill(episodes, steps):
    recording = record(World("slider"), seed=3, noise=60.0, episodes=episodes, steps=steps)
    simulator = make_simulator("slider")
    question = prepare(recording, simulator, simulator.defaults(recording.parameters))
    assert question.everything.windows.length <= 25
