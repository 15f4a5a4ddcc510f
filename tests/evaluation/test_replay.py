"""Recorded actions played again: windows that know their gaps, and angles that run on as simulated ones do."""

import numpy as np
import pytest

from gpsim.channels import Channels, wrap_angle
from gpsim.errors import UsageError
from gpsim.evaluation import WARM_UP, compare, replay, windows_of
from gpsim.recordings import Episode
from gpsim.residuals import either_wraps
from gpsim.simulators import SimulatorPlant, make_simulator

PENDULUM = make_simulator("pendulum")
PLANT = SimulatorPlant(PENDULUM, PENDULUM.defaults(), "rk4", 0.05)


def driven(count: int = 120, speed: float = 9.0) -> Episode:
    """A pendulum that goes over the top again and again, under changing torques."""
    rng = np.random.default_rng(0)
    torques, states = rng.uniform(-1.0, 1.0, (count, 1, 1)), [np.array([[0.3, speed]])]
    for torque in torques:
        states.append(PLANT.step(states[-1], torque, {}, rng))
    return Episode("0", 0.05 * np.arange(count + 1), np.concatenate(states), torques[:, 0])


def without_rows(episode: Episode, rows: list[int]) -> Episode:
    """The episode as a logger writes it that has lost these rows: the command before them seems to stand."""
    kept = np.setdiff1d(np.arange(len(episode.t)), rows)
    return Episode(episode.name, episode.t[kept], episode.states[kept], episode.actions[kept[:-1]])


def windows(episode: Episode, steps: int = 20, state: Channels = PENDULUM.state):
    return windows_of([episode], steps, 100, dt=0.05, state=state)


def test_a_replay_of_the_same_simulator_follows_the_recording_over_every_lost_row():
    episode = driven(speed=1.0)
    lossy = windows(without_rows(episode, [35, 36, 70]))
    paths = replay(PLANT, lossy, np.random.default_rng(0))
    np.testing.assert_allclose(paths, lossy.recorded, atol=1e-9)
    whole = windows(episode)
    assert len(whole.states) == 5
    np.testing.assert_array_equal(whole.states[0], episode.states[: WARM_UP + 21])


def test_windows_are_as_long_as_the_longest_stretch_and_too_short_ones_are_refused():
    episode = without_rows(driven(), list(range(14, 120, 14)))
    assert windows(episode).recorded.shape[1] - 1 == 13 - WARM_UP
    with pytest.raises(UsageError, match="11 steps without a lost row are needed"):
        windows(without_rows(driven(), list(range(8, 120, 8))))


@pytest.mark.parametrize("wraps", [("theta",), ()])
def test_a_recorded_angle_that_leaps_by_a_turn_runs_on(wraps):
    """Whether the recording says that it wraps, or only that it is an angle."""
    episode = driven()
    assert np.ptp(episode.states[:, 0]) > 4.0 * np.pi
    wrapped = episode.states.copy()
    wrapped[:, 0] = wrap_angle(wrapped[:, 0])
    state = Channels.of(PENDULUM.state.units, wraps=wraps)
    found = windows(Episode("0", episode.t, wrapped, episode.actions), state=state)
    np.testing.assert_array_equal(found.recorded[:, 0, 0], wrap_angle(found.recorded[:, 0, 0]))
    paths = replay(PLANT, found, np.random.default_rng(0))
    rms = compare(paths, found.recorded, either_wraps(PENDULUM.state, state))["rms"]
    assert max(rms.values()) < 1e-6
