"""Windows: what they hold, and how long ago commands and velocities turned round."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gpsim.channels import wrap_angle
from gpsim.diagnosis.data import Windows, cut, held_out_mask, since_reversal
from gpsim.diagnosis.settings import WindowSettings
from gpsim.recordings import HeldOut, Recording
from gpsim.simulators import make_simulator

from .worlds import World, record


def turned(recording: Recording, angle: float) -> Recording:
    """The same pendulum, its angle counted from elsewhere and wrapped."""
    episodes = []
    for episode in recording.episodes:
        states = np.array(episode.states)
        states[:, 0] = wrap_angle(states[:, 0] + angle)
        episodes.append(replace(episode, states=states))
    return replace(recording, episodes=tuple(episodes))


def test_angles_run_on_inside_a_window_and_before_it():
    recording = turned(record(World("pendulum"), episodes=3, steps=150), np.pi)
    jumps = np.concatenate([np.abs(np.diff(e.states[:, 0])) for e in recording.episodes])
    assert (jumps > np.pi).any()
    windows = cut(recording, WindowSettings())
    assert np.abs(np.diff(windows.measured[..., 0], axis=1)).max() < 0.5
    together = np.concatenate([windows.before_states[..., 0], windows.measured[..., :1, 0]], axis=1)
    assert np.abs(np.diff(together, axis=1)).max() < 0.5
    assert np.abs(windows.measured[:, 0, 0]).max() <= np.pi  # each begins where it was recorded


def test_most_windows_are_evenly_spread():
    recording = record(World("slider"), episodes=4, steps=100)
    every, some = cut(recording, WindowSettings(), 1), cut(recording, WindowSettings(), 1, most=20)
    assert len(some) == 20 < len(every)
    assert set(some.t[:, 0]) <= set(every.t[:, 0])
    assert set(some.episode) == {0, 1, 2, 3}


def test_an_episode_of_which_something_was_left_out_stands_beside_whole_ones():
    recording = record(World("slider"), episodes=2, steps=100)
    first, second = recording.episodes
    left_out = np.ones(second.states.shape)
    left_out[50:60, 0] = 0.0
    windows = cut(replace(recording, episodes=(first, replace(second, weights=left_out))), WindowSettings())
    assert (windows.weights[windows.episode == 0] == 1).all()
    assert set(np.unique(windows.weights[windows.episode == 1])) == {0.0, 1.0}


def samples(windows: Windows) -> set[tuple[int, float]]:
    return {
        (int(e), float(t))
        for e, row, valid in zip(windows.episode, windows.t, windows.valid, strict=True)
        for t in row[valid]
    }


@pytest.mark.parametrize(
    ("episodes", "steps", "rule", "session"),
    [
        (1, 200, None, False),
        (2, 60, None, False),
        (2, 100, None, True),
        (4, 75, None, False),
        (7, 40, None, False),
        (1, 300, HeldOut(time_from=3.1), False),
        (3, 100, HeldOut(time_from=3.1), True),
        (3, 100, HeldOut(time_from=1.3), False),
        (4, 60, HeldOut(episodes_from=2), False),
    ],
)
def test_no_sample_is_both_learned_from_and_held_out(episodes, steps, rule, session):
    """However long the windows are: a judgement on samples that a parameter was fitted to proves nothing."""
    recording = record(World("slider"), episodes=episodes, steps=steps, session=session)
    recording = replace(recording, held_out=rule)
    parts = [cut(recording, WindowSettings(), length) for length in (25, 1, 50)]
    learned = set().union(*(samples(w.take(~held_out_mask(recording, w))) for w in parts))
    judged = set().union(*(samples(w.take(held_out_mask(recording, w))) for w in parts))
    assert learned
    assert judged
    assert not learned & judged
    total = sum(len(e.t) for e in recording.episodes)
    assert len(learned | judged) >= total - len(recording.episodes) - 1  # one sample alone says nothing


def test_samples_that_were_not_recorded_keep_the_clocks_own_step():
    """A nominal dt that is off a little would make an even clock uneven, whose delays are looked up the slow way."""
    recording = record(World("slider"), episodes=2, steps=40)
    episodes = tuple(replace(e, t=1.03 * e.t) for e in recording.episodes)
    windows = cut(replace(recording, episodes=episodes), WindowSettings(), 25)
    for t in (windows.t, windows.before_t):
        np.testing.assert_allclose(np.diff(t, axis=1), 1.03 * recording.dt, rtol=1e-9)


@pytest.mark.parametrize("lost", [1, 7, 4000])
def test_what_lies_before_a_gap_is_of_another_time(lost):
    """A window looks back in seconds: over lost rows, in which the last known command is held."""
    recording = record(World("slider"), episodes=1, steps=100)
    (whole,) = recording.episodes
    late = np.concatenate([whole.t[:51], whole.t[51:] + lost * recording.dt])
    windows = cut(replace(recording, episodes=(replace(whole, t=late),)), WindowSettings(), 20)
    assert windows.lost is not None
    for index in np.flatnonzero(windows.t[:, 0] > late[50]):
        begun = (windows.before_t[index, :-1] + windows.before_t[index, 1:]) / 2
        held = np.searchsorted(late, begun, side="right") - 1
        expected = np.where(held >= 0, whole.actions[np.maximum(held, 0), 0], 0.0)
        np.testing.assert_array_equal(windows.before_actions[index, :, 0], expected)
        np.testing.assert_allclose(np.diff(windows.before_t[index]), recording.dt, rtol=1e-6)
    after = np.isclose(windows.t[:, 0], late[51])
    assert after.sum() == 1
    np.testing.assert_array_equal(windows.lost, after)
    np.testing.assert_array_equal(windows.rested, windows.t[:, 0] == 0.0)
    np.testing.assert_array_equal(windows.fresh, windows.lost | windows.rested)


@given(seed=st.integers(0, 10_000))
def test_how_far_back_a_time_lies_is_what_a_look_at_every_sample_says(seed):
    rng = np.random.default_rng(seed)
    count, before, length = rng.integers(1, 6), rng.integers(0, 9), rng.integers(1, 9)
    clock = np.cumsum(rng.uniform(0.01, 0.05, (count, before + 1 + length)), axis=1)
    nothing = np.zeros((count, before, 1))
    windows = Windows(
        np.zeros((count, length + 1, 1)), np.zeros((count, length, 1)), clock[:, before:],
        np.ones((count, length + 1), dtype=bool), nothing, nothing, clock[:, : before + 1],
        np.zeros(count, dtype=int), np.zeros(count, dtype=bool),
    )  # fmt: skip
    time = rng.uniform(0.0, 0.4)
    furthest = 0
    for row in clock:
        for sample in range(before, len(row)):
            met = [place for place in range(sample + 1) if row[place] <= row[sample] - time]
            furthest = max(furthest, sample - (met[-1] if met else 0))
    assert windows.samples_within(time) == furthest


BACK, DT = 12, 0.02
LEVELS = arrays(np.float64, BACK + 1, elements=st.sampled_from([-2.0, -1.0, 0.0, 1.0, 2.0]))


def two_courses(commands, velocities):
    """One window at the end of both courses (BACK + 1,)."""
    t = DT * np.arange(BACK + 2)
    states = np.stack([np.zeros(BACK + 1), velocities], axis=1)
    return SimpleNamespace(
        before_t=t[None, : BACK + 1],
        t=t[None, BACK:],
        before_actions=commands[None, :BACK, None],
        actions=commands[None, BACK:, None],
        before_states=states[None, :BACK],
        measured=np.repeat(states[None, BACK:], 2, axis=1),
    )


def last_turn(signs):
    """The index at which a sign differs from the one before it that was not 0; 0 where none does."""
    known, turned = 0.0, 0
    for k, sign in enumerate(signs):
        if sign and known and sign != known:
            turned = k
        known = sign or known
    return turned


@given(LEVELS, LEVELS)
@settings(max_examples=200, deadline=None)
def test_it_is_the_time_since_the_last_turn(commands, velocities):
    found = since_reversal(two_courses(commands, velocities), make_simulator("slider"))
    changes = np.concatenate([[0.0], np.sign(np.diff(commands))])
    np.testing.assert_allclose(found["force"], [DT * (BACK - last_turn(changes))], atol=1e-6)
    np.testing.assert_allclose(found["q_dot"], [DT * (BACK - last_turn(np.sign(velocities)))], atol=1e-6)
