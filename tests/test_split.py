"""One boundary between what is learned from and what is held out, for residuals and diagnosis alike."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsim.channels import Channels
from gpsim.diagnosis.data.windows import cut, held_out_mask
from gpsim.diagnosis.settings import WindowSettings
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.residuals.split import first_held_out, held_out_names, held_out_rows, holding_out

CHANNELS = Channels.of({"q": "m", "q_dot": "m/s"}), Channels.of({"force": "N"})


def recorded(sizes, held_out=None):
    episodes = tuple(
        Episode(str(i), 0.1 * np.arange(n), np.random.default_rng(i).normal(size=(n, 2)), np.ones((n - 1, 1)))
        for i, n in enumerate(sizes)
    )
    return Recording("slider", *CHANNELS, episodes, 0.1, {"mass": 1.0}, "euler", held_out=held_out)


def test_the_last_fifth_of_the_episodes_or_of_the_samples_where_a_recording_says_nothing():
    assert first_held_out(recorded([50] * 5)).tolist() == [50, 50, 50, 50, 0]
    assert first_held_out(recorded([50] * 9)).tolist() == [50] * 8 + [0]
    assert first_held_out(recorded([100])).tolist() == [80]
    assert first_held_out(recorded([50, 50])).tolist() == [50, 30]


def test_a_recording_says_it_itself():
    assert first_held_out(recorded([50] * 4, HeldOut(episodes_from=1))).tolist() == [50, 0, 0, 0]
    assert first_held_out(recorded([50], HeldOut(time_from=3.0))).tolist() == [30]
    assert first_held_out(recorded([50] * 10, HeldOut(share=0.3))).tolist() == [50] * 7 + [0] * 3
    assert first_held_out(recorded([50] * 4, HeldOut(share=0.0))).tolist() == [50] * 4


def test_a_share_is_taken_where_a_recording_says_nothing():
    assert holding_out(recorded([50] * 4), 0.5).held_out == HeldOut(share=0.5)
    said = recorded([50] * 4, HeldOut(episodes_from=3))
    assert holding_out(said, 0.5) is said
    silent = recorded([50] * 4)
    assert holding_out(silent, 0.2) is silent  # the same: one diagnosis, whoever asks


@given(
    sizes=st.lists(st.integers(40, 90), min_size=1, max_size=12),
    share=st.sampled_from([0.0, 0.1, 0.2, 0.25, 0.5, 0.9]),
)
def test_no_transition_or_window_that_is_learned_from_holds_a_held_out_sample(sizes, share):
    recording = holding_out(recorded(sizes), share)
    held = first_held_out(recording)
    transitions = recording.transitions()
    test = held_out_rows(recording, transitions)
    index = np.rint(transitions.t / 0.1).astype(int)
    assert (index[~test] + 1 < held[transitions.episode[~test]]).all()
    assert (index[test] + 1 >= held[transitions.episode[test]]).all()
    windows = cut(recording, WindowSettings())
    learned = windows.take(~held_out_mask(recording, windows))
    last = np.rint(learned.t[np.arange(len(learned)), learned.valid.sum(axis=1) - 1] / 0.1).astype(int)
    assert (last < held[learned.episode]).all()
    assert set(held_out_names(recording)) == {str(i) for i, k in enumerate(held) if k < sizes[i] - 1}


@given(count=st.integers(1, 60), share=st.sampled_from([0.05, 0.1, 0.15, 0.2, 0.3, 0.35, 0.7]))
def test_a_share_of_the_episodes_is_counted_without_rounding_errors(count, share):
    recording = replace(recorded([4] * count), held_out=HeldOut(share=share))
    exact = round(100 * share) * count // 100
    if exact:
        assert (first_held_out(recording) == 0).sum() == exact


def test_a_boundary_beyond_the_end_is_refused():
    late = recorded([50], HeldOut(time_from=100.0))
    with pytest.raises(Exception, match="nothing is held out"):
        held_out_rows(late, late.transitions())
