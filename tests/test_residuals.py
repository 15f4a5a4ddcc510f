"""Residuals: what a known target leaves, split by episode, and faults that are named."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.collecting import collect_episodes, dithered_actor, random_actor
from gpsim.errors import UsageError
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.residuals import build_residuals, from_table, to_table
from gpsim.simulators import make_simulator
from gpsim.targets import FrictionCartPole
from gpsim.targets.cartpole import cart_pole_accelerations
from gpsim.tasks import Balance

CARTPOLE = make_simulator("cartpole")
P = CARTPOLE.defaults()
TARGET = FrictionCartPole(P, 0.9, 0.02)


def record(count=10, plant=TARGET):
    rng, task = np.random.default_rng(0), Balance()
    episodes = collect_episodes(plant, task, random_actor(task, rng), count, rng)
    return Recording("cartpole", CARTPOLE.state, CARTPOLE.action, episodes, 0.02)


def residuals_of(recording, **keywords):
    settings = {"test_fraction": 0.2, "rng": np.random.default_rng(0)} | keywords
    return build_residuals(recording, CARTPOLE, P, "euler", **settings)


def test_the_residual_is_the_difference_of_the_accelerations():
    recording = record()
    found = residuals_of(recording)
    t = recording.transitions()
    true = cart_pole_accelerations(t.states, t.actions[:, 0], np.sign(t.states[:, 1]), P, 0.9)
    np.testing.assert_allclose(found.values, true - CARTPOLE.rates(t.states, t.actions, P), atol=1e-10)


def test_no_mismatch_leaves_nothing():
    assert np.abs(residuals_of(record(plant=replace(TARGET, friction=0.0))).values).max() < 1e-10


def test_whole_episodes_are_held_out_and_the_subsample_is_nested():
    found = residuals_of(record())
    assert set(found.episode[found.test]) == {8, 9}
    assert set(found.episode[~found.test]) == set(range(8))
    few, more = found.training_rows(20), found.training_rows(50)
    assert len(few) == 20
    assert set(few) < set(more)
    assert not found.test[more].any()
    other = residuals_of(record(), rng=np.random.default_rng(1))
    assert set(other.training_rows(20)) != set(few)


def test_the_recording_may_say_what_is_held_out():
    by_episode = residuals_of(replace(record(), held_out=HeldOut(episodes_from=3)))
    assert by_episode.episode[by_episode.test].min() == 3
    by_time = residuals_of(replace(record(), held_out=HeldOut(time_from=0.2)))
    assert by_time.t[by_time.test].min() == pytest.approx(0.2)
    assert by_time.t[~by_time.test].max() < 0.2


def test_round_trip():
    found = residuals_of(record())
    back = from_table(to_table(found), found.channels, found.rate)
    for name, value in vars(found).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(getattr(back, name), value)


def test_a_dead_channel_is_named():
    recording = record(3)
    dead = [replace(e, states=e.states * np.array([1, 1, 0, 1])) for e in recording.episodes]
    with pytest.raises(
        UsageError, match=r"channel theta is constant \(0\) from episode 0, row 0 to episode 2"
    ):
        residuals_of(replace(recording, episodes=tuple(dead)))


def test_another_systems_recording_is_refused():
    episode = Episode("0", np.arange(3.0), np.random.rand(3, 1), np.random.rand(2, 1))  # noqa: NPY002
    other = Recording("slider", Channels.of({"q": "m"}), Channels.of({"force": "N"}), (episode,), 1.0)
    with pytest.raises(UsageError, match=r"the recording's state is \(q \[m\]\), simulator cartpole needs"):
        residuals_of(other)


def test_dither_replaces_the_share_it_is_told():
    task, rng = Balance(), np.random.default_rng(0)

    def always(observations):
        return np.ones(len(observations), dtype=np.int64)

    drawn = dithered_actor(always, task, 0.3, rng)(np.zeros((20_000, 4), dtype=np.float32))
    assert np.mean(drawn == 0) == pytest.approx(0.15, abs=0.01)
