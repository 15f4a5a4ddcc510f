"""Residuals: what a known target leaves, split by episode, and faults that are named."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim import load_simulator
from gpsim.channels import Channels, wrap_angle
from gpsim.environments import collect_episodes, dithered_actor, random_actor
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
    # What is learned from ends before that moment: the step that crosses it begins before and is judged.
    assert (by_time.t[by_time.test] + 0.02).min() == pytest.approx(0.2)
    assert (by_time.t[~by_time.test] + 0.02).max() < 0.2


@pytest.mark.parametrize("held_out", [HeldOut(episodes_from=17), HeldOut(time_from=1e6)])
def test_what_is_held_out_from_beyond_the_end_on_is_refused(held_out):
    with pytest.raises(
        UsageError, match="nothing is held out: .* begins after the recording's end"
    ) as caught:
        residuals_of(replace(record(), held_out=held_out))
    assert "\n" not in str(caught.value)


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


def lossy(recording, row):
    """The recording without this row of its first episode, as a logger that has lost it writes it."""
    first, *rest = recording.episodes
    t, states = np.delete(first.t, row), np.delete(first.states, row, axis=0)
    episode = replace(first, t=t, states=states, actions=np.delete(first.actions, row, axis=0))
    return replace(recording, episodes=(episode, *rest))


def test_a_step_over_a_lost_row_is_left_out_and_the_others_are_what_they_were():
    whole, found = residuals_of(record()), residuals_of(lossy(record(), 5))
    kept = ~((whole.episode == 0) & np.isin(whole.t, 0.02 * np.arange(60)[[4, 5]]))
    assert len(found.t) == len(whole.t) - 2  # the step over the gap, and the one that began in the lost row
    np.testing.assert_array_equal(found.values, whole.values[kept])
    np.testing.assert_array_equal(found.test, whole.test[kept])
    assert sorted(found.order[~found.test]) == list(range((~found.test).sum()))


def test_a_dt_that_is_not_the_clocks_is_refused():
    recording = record(3)
    residuals_of(replace(recording, dt=0.0205))
    with pytest.raises(UsageError, match=r"says dt 0.04 s, but the median step of its t is 0.02 s: write dt"):
        residuals_of(replace(recording, dt=0.04))
    with pytest.raises(UsageError, match="median step"):
        residuals_of(replace(recording, dt=0.01))


TURNTABLE = """
import numpy as np

class Turntable:
    state = {"angle": "rad"}
    action = {"speed": "rad/s"}
    parameters = {}

    def rates(self, state, action, p):
        return {"angle": LAW}
"""


def turntable(tmp_path, law, angles, speeds, wraps=()):
    """Residuals of two episodes of a turntable whose file says this law, recorded at these angles (2, K + 1)."""
    path = tmp_path / "table.py"
    path.write_text(TURNTABLE.replace("LAW", law))
    simulator = load_simulator(f"{path}:Turntable")
    episodes = tuple(
        Episode(str(i), 0.1 * np.arange(angles.shape[1]), angles[i, :, None], speeds[i, :, None])
        for i in range(2)
    )
    state = Channels.of({"angle": "rad"}, wraps=wraps)
    recording = Recording(simulator.name, state, simulator.action, episodes, 0.1)
    return build_residuals(recording, simulator, {}, "rk4", test_fraction=0.5, rng=np.random.default_rng(0))


def test_an_angle_that_wraps_in_the_recording_alone_leaves_no_spikes(tmp_path):
    speeds = np.random.default_rng(0).uniform(1.0, 3.0, (2, 200))
    angles = np.pad(np.cumsum(0.1 * speeds, axis=1), ((0, 0), (1, 0)))
    found = turntable(tmp_path, 'action["speed"]', wrap_angle(angles), speeds, wraps=("angle",))
    assert np.abs(found.values).max() < 1e-9
    assert found.channels.wraps.tolist() == [True, False]


def test_a_step_that_is_no_number_is_refused_wherever_it_is(tmp_path):
    """At none of the rows that are looked at beforehand: the rates are finite there, and extreme nowhere near."""
    rng = np.random.default_rng(0)
    angles, speeds = rng.uniform(-1.0, 1.0, (2, 2001)), rng.uniform(-1.0, 1.0, (2, 2000))
    angles[1, 1234] = 0.123456
    law = '0.0 * action["speed"] / (state["angle"] - 0.123456)'
    with pytest.raises(UsageError) as caught, np.errstate(all="ignore"):
        turntable(tmp_path, law, angles, speeds)
    said = str(caught.value)
    assert "angle after a step is not finite (nan) at episode 1, row 1234 (angle=" in said
    assert "angle=0.123456" in said
    assert "table.py" in said
    assert "\n" not in said


def test_dither_replaces_the_share_it_is_told():
    task, rng = Balance(), np.random.default_rng(0)

    def always(observations):
        return np.ones(len(observations), dtype=np.int64)

    drawn = dithered_actor(always, task, 0.3, rng)(np.zeros((20_000, 4), dtype=np.float32))
    assert np.mean(drawn == 0) == pytest.approx(0.15, abs=0.01)
