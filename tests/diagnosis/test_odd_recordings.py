"""Recordings as they come: positions only, the time of day for a clock, gaps, gears, episodes of one sample."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.data import cut, held_out_mask, rebased, thinned
from gpsim.diagnosis.fitting import Hypothesis, predicted, simulate
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known, WindowSettings
from gpsim.diagnosis.setup import prepare
from gpsim.effects import Term
from gpsim.errors import UsageError
from gpsim.recordings import Episode, HeldOut
from gpsim.reports.account import account_of
from gpsim.reports.diagnosis_figures import figures
from gpsim.reports.diagnosis_page import page
from gpsim.simulators import make_simulator
from gpsim.traces import course, traces

from .own_systems import SLIDER
from .truths import mechanical
from .worlds import World, record

pytestmark = pytest.mark.usefixtures("own_files")

FRICTION = next(t for t in mechanical("slider") if t.family == "coulomb_friction")


def question_of(recording, simulator=None):
    simulator = simulator or make_simulator(recording.system)
    return prepare(recording, simulator, simulator.defaults(recording.parameters))


def test_positions_alone_are_diagnosed_to_the_end(tmp_path: Path):
    (tmp_path / "mine.py").write_text(SLIDER)
    simulator = make_simulator(f"{tmp_path / 'mine.py'}:Slider")
    full = record(FRICTION.world, seed=2, episodes=5, steps=150)
    recording = replace(
        full,
        state=Channels.of({"q": "m"}),
        episodes=tuple(replace(e, states=e.states[:, :1]) for e in full.episodes),
        noise={"q": full.noise["q"]},
    )
    run = Run(known=Known(only=("coulomb_friction", "viscous_friction", "constant_force")))
    found = diagnose(recording, simulator, simulator.defaults(), np.random.default_rng(0), run=run)
    (effect,) = found.diagnosis.effects
    assert (effect.family, effect.on) == ("coulomb_friction", "q")
    assert effect.parameters["force"].value == pytest.approx(FRICTION.values["force"], rel=0.05)
    assert found.diagnosis.fit.one_step == {}
    assert "no rate follows" in account_of(found.diagnosis).fit[0].missing
    leader = found.judgement.leader.hypothesis
    shown = traces(found.question, leader, found.comparison.rollout.horizon_s)
    pictures = figures(found, shown, course(found.question, leader))
    assert set(pictures) == {"residual_time", "traces"}
    assert "coulomb_friction" in page(found.diagnosis, pictures, "log")


def test_the_time_of_day_is_no_age():
    recording = record(World("slider"), episodes=5, steps=60, session=True)
    assert rebased(recording) == (recording, 0.0)
    noon = replace(
        recording,
        episodes=tuple(replace(e, t=e.t + 1.7e9) for e in recording.episodes),
        held_out=HeldOut(time_from=1.7e9 + 5.0),
    )
    again, origin = rebased(noon)
    assert origin == 1.7e9
    assert again.held_out == HeldOut(time_from=5.0)
    np.testing.assert_allclose(again.episodes[2].t, recording.episodes[2].t, atol=1e-6)
    assert question_of(noon).origin == origin


def test_an_onset_is_told_on_the_recordings_own_clock():
    world = World("slider", forces={0: lambda q, v, t: np.where(t >= 6.0, 4.0, 0.0)})
    recording = record(world, seed=1, episodes=5, steps=120, session=True)
    noon = replace(recording, episodes=tuple(replace(e, t=e.t + 1e5) for e in recording.episodes))
    simulator = make_simulator("slider")
    run = Run(known=Known(only=("constant_force", "viscous_friction", "coulomb_friction")))
    known = simulator.defaults(noon.parameters)
    report = diagnose(noon, simulator, known, np.random.default_rng(0), run=run).diagnosis
    (effect,) = report.effects
    assert effect.since == pytest.approx(1e5 + 6.0, abs=0.05)
    assert report.location.since == effect.since


def test_a_late_sensor_is_late_after_a_gap_too():
    """With the true law and the true starts nothing is left, whatever was lost before the window."""
    recording = record(World("slider"), episodes=1, steps=100, noise=0.0, euler_truth=True)
    (whole,) = recording.episodes
    for lost in (1, 250):
        t = np.concatenate([whole.t[:51], whole.t[51:] + lost * recording.dt])
        gapped = replace(recording, episodes=(Episode("0", t, whole.states, whole.actions),))
        windows = cut(gapped, WindowSettings(), 20)
        after = windows.take((windows.t[:, 0] > t[50]) & windows.valid[:, -1])
        assert len(after)
        hypothesis = Hypothesis(
            scheme="euler", terms=(Term("sensor_delay", "q", {"delay": 0.03}),), declared=((),)
        )
        question = question_of(replace(record(World("slider"), episodes=6, steps=100), noise={}))
        problem = replace(question.everything, windows=after, substeps=1)
        chain = hypothesis.chain(problem.simulator, problem.parameters, recording.dt)
        said = simulate(
            Run(), chain, after, after.measured[None, :, 0], hypothesis.spread, np.zeros((1, 0)), 1
        )[0]
        position, speed = after.measured[:, 0].T
        assert np.abs(said[:, 0, 0] - (position - 0.03 * speed)).max() < 0.005
        late = after.measured[:, 2:, 0] - 1.5 * np.diff(after.measured[..., 0], axis=1)[:, 1:]
        assert np.abs(said[:, 2:, 0] - late).max() < 0.005


@pytest.mark.parametrize("scale", [0.1, 1.9, 2.5, 4.0])
def test_starts_behind_a_gear_are_found(scale):
    question = question_of(record(World("slider"), episodes=6, steps=100))
    hypothesis = Hypothesis(terms=(Term("sensor_scale", "q", {"scale": scale}),), declared=((),))
    said = predicted(question.everything, question.everything.windows, hypothesis)
    measured = question.everything.windows.measured
    np.testing.assert_allclose(said[:, 0], measured[:, 0], atol=1e-7)


def test_a_delay_of_many_steps_is_kept_by_the_corrected_simulator():
    """A delay found on a thinned clock may last longer than the memory of the clock that drives."""
    term = Term("actuator_delay", "force", {"delay": 0.05})
    plant = EffectsPlant(make_simulator("slider"), {"mass": 1.0}, (term,), "fine", 2, 0.001)
    rng = np.random.default_rng(0)
    state, memory = np.zeros((1, 2)), plant.begin(1, rng)
    speeds = []
    for _ in range(80):
        state = plant.step(state, np.ones((1, 1)), memory, rng)
        speeds.append(state[0, 1])
    assert np.flatnonzero(np.array(speeds) > 1e-12)[0] == 50
    assert speeds[-1] == pytest.approx(0.03, rel=1e-6)


def test_an_episode_of_a_few_samples_does_not_keep_a_fast_clock_fast():
    recording = record(World("slider"), episodes=3, steps=400, dt=0.001, hold=50)
    first = recording.episodes[0]
    short = Episode("short", first.t[:4], first.states[:4], first.actions[:3])
    mixed = replace(recording, episodes=(*recording.episodes[:2], short, recording.episodes[2]))
    slow, every = thinned(mixed, WindowSettings().pace)
    assert every == 10
    assert [len(e) for e in slow.episodes] == [40, 40, 0, 40]  # the numbers of held-out episodes stay right


def test_something_is_held_out_of_few_windows_or_the_rule_is_refused():
    recording = replace(record(World("slider"), episodes=1, steps=130), held_out=None)
    windows = cut(recording, WindowSettings(), 25)
    assert held_out_mask(recording, windows).tolist() == [False] * 4 + [True]
    late = replace(record(World("slider"), episodes=6, steps=100), held_out=HeldOut(episodes_from=6))
    with pytest.raises(UsageError, match="nothing is held out"):
        question_of(late)
