"""What is peculiar to a log is found in it and left out; what bodies do is not."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.channels import Channels, wrap_angle
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.data import clock, cut, thinned
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.settings import LogFactSettings, WindowSettings
from gpsim.diagnosis.setup import look, look_at, mended, prepare
from gpsim.findings import LogFact
from gpsim.recordings import Episode, Recording
from gpsim.simulators import make_simulator

from .worlds import World, record

DT = 0.02
SETTINGS = LogFactSettings()


def swinging(noise=0.001, count=600, seed=0):
    """A position and its speed that swing, with noise, and a command that has nothing to do with it."""
    rng, t = np.random.default_rng(seed), DT * np.arange(count)
    states = np.stack([np.sin(2 * t), 2 * np.cos(2 * t)], axis=1) + noise * rng.normal(size=(count, 2))
    return t, states, rng.uniform(-1, 1, (count - 1, 1))


def logged(t, states, actions, units=("m", "m/s"), wraps=()):
    names = ("q", "q_dot")[: states.shape[1]]
    channels = Channels.of(dict(zip(names, units, strict=True)), wraps)
    return Recording("slider", channels, Channels.of({"force": "N"}), (Episode("0", t, states, actions),), DT)


def flagged(recording):
    return look_at(recording, SETTINGS).left_out


def facts_of(recording, kind):
    return {f.channel: f for f in look_at(recording, SETTINGS).facts if f.kind == kind}


@pytest.mark.parametrize(
    ("world", "more"),
    [
        (World("slider", grips={0: lambda q, v, n: 5.5 + 0 * q}), {"noise": 0.0}),
        (World("slider", grips={0: lambda q, v, n: 5.5 + 0 * q}), {"noise": 0.0, "hold": 1}),
        (World("slider", grips={0: lambda q, v, n: 3.0 + 0 * q}), {"noise": 0.0, "euler_truth": True}),
        (
            World("slider", forces={0: lambda q, v, t: -4000 * np.where(abs(q) > 0.3, q - np.sign(q) * 0.3, 0)}),
            {"noise": 0.0, "dt": 0.1},
        ),
        (World("unicycle"), {"noise": 1.0, "steps": 120}),
        (World("cartpole", grips={0: lambda q, v, n: 4.0 + 0 * q}), {"noise": 0.0, "dt": 0.01, "steps": 200}),
    ],
    ids=["sticks", "dithers", "chatters", "bounces", "drives", "balances"],
)  # fmt: skip
def test_of_clean_recordings_nothing_is_said(world, more):
    recording = record(world, seed=4, episodes=4, **{"steps": 150, **more})
    look = look_at(recording, SETTINGS)
    assert look.facts == ()
    assert not any(flags.any() for flags in look.left_out)
    assert mended(recording, look.left_out) is recording


def test_stale_packets_are_found_where_the_motion_is_plain():
    t, states, actions = swinging()
    stale = np.zeros(len(t), dtype=bool)
    for k, length in [(60, 1), (100, 3), (240, 2), (420, 1)]:
        states[k : k + length] = states[k - 1]
        stale[k : k + length] = True
    recording = logged(t, states, actions)
    (flags,) = flagged(recording)
    np.testing.assert_array_equal(flags[:, 0], stale)
    np.testing.assert_array_equal(flags[:, 1], stale)
    assert facts_of(recording, "repeated")["q"] == LogFact("repeated", "q", 7)


def test_a_stale_channel_leaves_the_others_alone():
    t, states, actions = swinging()
    states[100:102, 0] = states[99, 0]
    (flags,) = flagged(logged(t, states, actions))
    assert np.flatnonzero(flags[:, 0]).tolist() == [100, 101]
    assert not flags[:, 1].any()


def test_a_body_that_stands_still_for_a_while_repeats_nothing():
    t, states, actions = swinging(noise=0.0)
    states[200:203] = states[199]  # held, and then it goes on from there
    states[203:] -= states[203] - states[199]
    states[400:, 0] = states[400, 0]
    states[400:, 1] = 0.0
    assert not any(flags.any() for flags in flagged(logged(t, states, actions)))


def test_what_a_sensor_reads_in_its_zone_or_at_its_end_repeats_nothing():
    """A fast swing crosses a zone in two or three samples, which read 0."""
    t, states, actions = swinging(count=2000)
    states[:, 1] = np.where(np.abs(states[:, 1]) < 0.1, 0.0, np.minimum(states[:, 1], 1.99))
    assert facts_of(logged(t, states, actions), "repeated") == {}
    states[500] = states[499]  # a packet that is late says so still
    assert facts_of(logged(t, states, actions), "repeated").keys() == {"q", "q_dot"}


def test_marker_swaps_are_found_and_read_between_their_neighbours():
    t, states, actions = swinging()
    clean, wild = states.copy(), np.zeros(len(t), dtype=bool)
    for k, length in [(50, 1), (55, 1), (200, 3), (301, 5), (450, 2)]:
        states[k : k + length, 0] += 0.5
        wild[k : k + length] = True
    recording = logged(t, states, actions)
    look = look_at(recording, SETTINGS)
    np.testing.assert_array_equal(look.left_out[0][:, 0], wild)
    assert look.facts == (LogFact("outliers", "q", 12),)
    episode = mended(recording, look.left_out).episodes[0]
    np.testing.assert_allclose(episode.states, clean, atol=0.01)
    np.testing.assert_array_equal(episode.weights[:, 0] == 0, wild)
    assert (episode.weights[:, 1] == 1).all()
    np.testing.assert_array_equal(recording.episodes[0].states, states)  # the recording stays what it is


def test_an_angle_that_wraps_has_outliers_and_no_others():
    t, _, actions = swinging()
    angle = 3.0 * t + 0.001 * np.random.default_rng(1).normal(size=len(t))
    for k in (70, 300):
        angle[k] += 2.0
    recording = logged(t, wrap_angle(angle)[:, None], actions, ("rad",), ("q",))
    look = look_at(recording, SETTINGS)
    assert np.flatnonzero(look.left_out[0][:, 0]).tolist() == [70, 300]
    states = mended(recording, look.left_out).episodes[0].states[:, 0]
    assert abs(wrap_angle(states[70] - 3.0 * t[70])) < 0.01
    assert (np.abs(states) <= np.pi).all()


def test_an_impact_that_stays_is_no_outlier():
    t, states, actions = swinging()
    states[300:, 1] += 3.0
    assert not any(flags.any() for flags in flagged(logged(t, states, actions)))


def test_what_a_command_does_and_takes_back_is_no_outlier():
    """A push and a counter-push on a body at rest: its speed leaps away and comes back."""
    rng, t = np.random.default_rng(0), DT * np.arange(600)
    states, actions = 1e-3 * rng.normal(size=(600, 2)), np.zeros((599, 1))
    for k in (100, 250, 400):
        states[k, 1] += 0.5
    glitches = logged(t, states, actions)
    assert np.flatnonzero(flagged(glitches)[0][:, 1]).tolist() == [100, 250, 400]
    for k in (100, 250, 400):
        actions[k - 1], actions[k] = 1.0, -1.0
    assert not any(flags.any() for flags in flagged(logged(t, states, actions)))


def test_what_happens_often_is_no_accident():
    t, states, actions = swinging()
    states[::20, 0] += 0.5
    assert not any(flags.any() for flags in flagged(logged(t, states, actions)))


def test_a_grid_coarser_than_the_noise_is_found_and_is_noise():
    t, states, actions = swinging()
    states[:, 0] = 0.01 * np.round(states[:, 0] / 0.01)
    found = facts_of(logged(t, states, actions), "quantised")
    assert list(found) == ["q"]
    assert found["q"].value == pytest.approx(0.01, rel=1e-6)
    assert found["q"].unit == "m"
    recording = record(World("slider"), seed=1, episodes=5, steps=200, noise=0.05, known_noise=False)
    episodes = [np.array(e.states) for e in recording.episodes]
    for values in episodes:
        values[:, 0] = 0.005 * np.round(values[:, 0] / 0.005)
    coarse = replace(
        recording,
        episodes=tuple(replace(e, states=v) for e, v in zip(recording.episodes, episodes, strict=True)),
    )
    simulator = make_simulator("slider")
    floor = prepare(coarse, simulator, simulator.defaults(recording.parameters)).everything.floor
    assert floor[0] == pytest.approx(0.005 / np.sqrt(12), rel=0.01)


def test_a_grid_of_values_between_which_was_interpolated_is_found():
    t, states, actions = swinging(noise=0.0, count=4000)
    y = 0.02 * np.round(np.sin(0.3 * t) / 0.02)
    middle = np.flatnonzero(np.diff(y))
    y[middle] += 0.3 * (y[middle + 1] - y[middle])
    states[:, 0] = y
    assert facts_of(logged(t, states, actions), "quantised")["q"].value == pytest.approx(0.02)


@pytest.mark.parametrize("noise", [0.001, 0.0])
def test_fine_values_have_no_grid(noise):
    t, states, actions = swinging(noise)
    assert not facts_of(logged(t, np.round(states, 6), actions), "quantised")


def test_pushes_that_are_always_as_strong_are_no_grid():
    rng, t = np.random.default_rng(2), DT * np.arange(800)
    actions = rng.choice([-1.0, 0.0, 1.0], size=(799, 1))
    speed = np.concatenate([[0.0], np.cumsum(0.04 * actions[:, 0])])
    states = np.stack([np.concatenate([[0.0], np.cumsum(DT * speed[:-1])]), speed], axis=1)
    assert look_at(logged(t, states, actions), SETTINGS).facts == ()


def test_missing_rows_and_an_uneven_clock_are_counted():
    t, states, actions = swinging()
    kept = np.delete(np.arange(600), [100, 101, 102, 300])
    recording = logged(t[kept], states[kept], actions[kept[:-1]])
    (missing,) = look_at(recording, SETTINGS).facts
    assert (missing.kind, missing.count, missing.unit) == ("missing", 4, "s")
    assert missing.value == pytest.approx(0.08)
    uneven = t + 0.002 * np.random.default_rng(3).normal(size=len(t))
    states = np.stack([np.sin(2 * uneven), 2 * np.cos(2 * uneven)], axis=1)
    (jitter,) = look_at(logged(uneven, states, actions), SETTINGS).facts
    assert (jitter.kind, jitter.unit) == ("jitter", "s")
    assert jitter.value == pytest.approx(0.0028, rel=0.1)


def test_the_shortest_logs_are_looked_at():
    t, states, actions = swinging()
    for kept in (np.array([0]), np.array([0, 1]), np.array([0, 5, 10, 11]), np.arange(9)):
        look = look_at(logged(t[kept], states[kept], actions[kept[:-1]]), SETTINGS)
        assert not look.left_out[0].any()


def test_a_log_without_commands_is_looked_at():
    t, states, _ = swinging()
    states[300, 0] += 0.5
    episode = Episode("0", t, states, np.empty((599, 0)))
    recording = replace(logged(t, states, np.zeros((599, 1))), action=Channels.of({}), episodes=(episode,))
    assert np.argwhere(flagged(recording)[0]).tolist() == [[300, 0]]


def spoilt():
    """A slider's recording with outliers in its position, and which."""
    recording = record(World("slider"), seed=2, episodes=5, steps=200, noise=0.3)
    episodes, wild = [], []
    for e in recording.episodes:
        states, mask = np.array(e.states), np.zeros(len(e.t), dtype=bool)
        mask[[26, 52, 100, 101]] = True  # the first two begin windows
        states[mask, 0] += 1.0
        episodes.append(replace(e, states=states))
        wild.append(mask)
    return recording, replace(recording, episodes=tuple(episodes)), wild


def test_fits_and_comparisons_pass_over_what_is_left_out():
    clean, recording, wild = spoilt()
    simulator = make_simulator("slider")
    parameters = simulator.defaults(recording.parameters)
    question, other = (prepare(r, simulator, parameters) for r in (recording, clean))
    assert question.facts == (LogFact("outliers", "q", sum(int(m.sum()) for m in wild)),)
    assert other.facts == ()
    problem = question.everything
    out = problem.windows.weights == 0
    assert out[..., 0].any()
    assert not out[..., 1].any()  # a wild position leaves the speed alone
    starts = problem.windows.measured[:, 0]
    assert np.abs(starts - other.everything.windows.measured[:, 0]).max() < 0.1
    residual = problem.residuals(Hypothesis(), np.empty((1, 0)), starts[None])[0]
    assert (residual[out] == 0).all()
    assert (other.everything.counts - problem.counts).tolist() == [out[..., 0].sum(), 0.0]
    steps = cut(question.recording, WindowSettings(), 1)
    ends = steps.take(steps.sound_ends)
    assert len(ends) < len(steps)
    assert np.abs(np.diff(ends.measured[..., 0], axis=1)).max() < 0.2
    assert cut(clean, WindowSettings(), 1).sound_ends.all()


def test_weights_are_thinned_with_their_samples(monkeypatch):
    _, recording, wild = spoilt()
    marked = mended(recording, look_at(recording, SETTINGS).left_out)
    monkeypatch.setattr(clock, "KEPT_SHARE", 0.0)
    few, every = thinned(replace(marked, dt=0.001), 0.002)
    assert every == 2
    for episode, mask in zip(few.episodes, wild, strict=True):
        np.testing.assert_array_equal(episode.weights[:, 0] == 0, mask[::2])


def test_a_channel_that_nobody_measured_has_weights_of_one():
    t, states, actions = swinging()
    states[100, 0] += 0.5
    recording = logged(t, states[:, :1], actions, ("m",))
    marked = mended(recording, look_at(recording, SETTINGS).left_out)
    weights = look(marked, make_simulator("slider")).completed(marked).episodes[0].weights
    assert weights.shape == (600, 2)
    assert np.argwhere(weights == 0).tolist() == [[100, 0]]


@pytest.mark.slow
def test_a_spoilt_log_of_friction_gets_the_verdict_of_a_sound_one():
    """Stale packets, marker swaps, missing rows: facts of the log, no physics."""
    world = World("slider", grips={0: lambda q, v, n: 2.0 + 0 * q})
    sound, rng = record(world, seed=5, episodes=10, steps=250, noise=0.3), np.random.default_rng(6)
    episodes = []
    for e in sound.episodes:
        states, rows = np.array(e.states), np.arange(len(e.t))
        for k in rng.choice(np.arange(20, 230, 10), 6, replace=False):
            states[k : k + 2] = states[k - 1]
        for k in rng.choice(np.arange(25, 230, 10), 3, replace=False):
            states[k, 0] += 0.6
        kept = np.delete(rows, rng.choice(np.arange(20, 230, 10) + 8, 3, replace=False))
        episodes.append(Episode(e.name, e.t[kept], states[kept], e.actions[kept[:-1]]))
    spoilt = replace(sound, episodes=tuple(episodes))
    simulator = make_simulator("slider")
    found = diagnose(spoilt, simulator, simulator.defaults(sound.parameters), np.random.default_rng(0))
    diagnosis = found.diagnosis
    assert {f.kind for f in diagnosis.facts} == {"repeated", "outliers", "missing"}
    assert diagnosis.verdict == "named"
    (effect,) = diagnosis.effects
    assert effect.family == "coulomb_friction"
    force = effect.parameters["force"]
    assert force.low < 2.0 < force.high
    assert force.value == pytest.approx(2.0, rel=2e-3)
