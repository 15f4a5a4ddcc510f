"""Recordings at 1 kHz are read every 10 ms, unless that would hide what was commanded."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.data import thinned
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known, WindowSettings
from gpsim.reports.diagnosis_text import where
from gpsim.simulators import make_simulator

from .truths import mechanical
from .worlds import World, record

FEW = ("coulomb_friction", "stribeck_friction", "viscous_friction", "quadratic_drag")
PACE = WindowSettings().pace
FRICTION = next(t for t in mechanical("slider") if t.family == "coulomb_friction")


def test_blocks_are_samples_and_mean_commands():
    recording = record(World("slider"), episodes=2, steps=205, dt=0.001, hold=50)
    slow, every = thinned(recording, PACE)
    assert every == 10
    assert slow.dt == pytest.approx(0.01)
    for before, after in zip(recording.episodes, slow.episodes, strict=True):
        assert len(after) == 20
        np.testing.assert_array_equal(after.t, before.t[:201:10])
        np.testing.assert_array_equal(after.states, before.states[:201:10])
        np.testing.assert_allclose(after.actions, before.actions[:200].reshape(20, 10, 1).mean(axis=1))


def test_an_uneven_clock_weighs_commands_by_time():
    recording = record(World("slider"), episodes=1, steps=100, dt=0.001, hold=50)
    (episode,) = recording.episodes
    episode.t[1:] += 0.004  # the first command stands for 5 ms
    (slow,) = thinned(recording, PACE)[0].episodes
    u = episode.actions[:10, 0]
    assert slow.actions[0, 0] == pytest.approx((5 * u[0] + u[1:].sum()) / 14)


def test_a_free_swing_is_thinned_too():
    """A recording without commands at 1 kHz: nothing can be hidden."""
    recording = record(World("slider"), episodes=2, steps=205, dt=0.001, hold=50)
    bare = tuple(replace(episode, actions=episode.actions[:, :0]) for episode in recording.episodes)
    slow, every = thinned(replace(recording, action=Channels(()), episodes=bare), PACE)
    assert every == 10
    assert [episode.actions.shape for episode in slow.episodes] == [(20, 0), (20, 0)]


@pytest.mark.parametrize(("dt", "hold"), [(0.001, 1), (0.02, 8), (0.01, 50)])
def test_nothing_is_thinned_where_commands_switch_at_every_sample_or_the_clock_is_slow(dt, hold):
    recording = record(World("slider"), episodes=2, steps=400, dt=dt, hold=hold)
    same, every = thinned(recording, PACE)
    assert every == 1
    assert same is recording


def test_friction_is_named_from_a_recording_at_1_khz():
    recording = record(FRICTION.world, seed=4, episodes=6, steps=1500, dt=0.001, hold=120)
    simulator = make_simulator("slider")
    known, run = simulator.defaults(recording.parameters), Run(known=Known(only=FEW))
    found = diagnose(recording, simulator, known, np.random.default_rng(0), run=run)
    report = found.diagnosis
    assert report.thinned == 10
    assert "every 10th sample" in where(report)
    assert found.plant.dt == pytest.approx(0.001)  # the corrected simulator keeps the command's pace
    assert (
        found.plant.substeps == 1
    )  # and steps no finer than it was found with: 2 substeps of 10 ms, 1 of 1 ms
    assert report.verdict == "named"
    (effect,) = report.effects
    assert (effect.family, effect.on) == ("coulomb_friction", "q")
    got = effect.parameters["force"]
    assert not got.at_bound
    assert abs(got.value - FRICTION.values["force"]) < 0.03 * FRICTION.values["force"]
    held_out = report.fit.rollout.channels["q"]
    assert held_out.after < 0.2 * held_out.before
