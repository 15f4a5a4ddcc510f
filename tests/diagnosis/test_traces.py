"""What the pictures show: rollouts from measured states, the base with its own step, the worst and the median."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.setup import prepare
from gpsim.effects import Term
from gpsim.recordings import HeldOut
from gpsim.simulators import make_simulator
from gpsim.traces import BASE, EFFECTS, course, traces

from .truths import channel_filter, delayed
from .worlds import World, record

NOTHING = Hypothesis(terms=(Term("constant_force", "q", {"force": 0.0}),), declared=((),))


def question_of(recording):
    simulator = make_simulator(recording.system)
    return prepare(recording, simulator, simulator.defaults(recording.parameters))


@pytest.fixture(scope="module")
def euler():
    """Ten episodes of an Euler truth without noise; in held-out ones the log shows a share of the force that acted."""
    whole = record(World("slider"), episodes=10, steps=103, noise=0.0, euler_truth=True)
    shares = {7: 1.2, 8: 1.0, 9: 1.05}
    episodes = tuple(replace(e, actions=shares.get(i, 1.0) * e.actions) for i, e in enumerate(whole.episodes))
    return question_of(replace(whole, episodes=episodes, held_out=HeldOut(episodes_from=7)))


def test_the_base_takes_its_own_step_and_each_rollout_starts_as_measured(euler):
    found = traces(euler, NOTHING, 1.0)
    assert sorted(found.shown) == [0, 1]
    assert found.held_out
    assert found.horizon == pytest.approx(1.0)
    for trace in found.traces:
        ends = np.flatnonzero(np.isnan(trace.t))
        begins = np.r_[0, ends[:-1] + 1]
        assert np.diff(trace.t[begins]) == pytest.approx(1.02)  # windows share no sample
        for said in trace.said.values():
            np.testing.assert_allclose(said[begins], trace.measured[begins], atol=1e-12)
            assert np.isnan(said[ends]).all()
    exact = traces(
        replace(euler, recording=replace(euler.recording, held_out=HeldOut(episodes_from=8))), NOTHING, 1.0
    )
    best = {t.name: t for t in exact.traces}["8"]
    assert best.errors[BASE].max() < 1e-10
    assert best.errors[EFFECTS].max() > 1e-4  # a finely integrated base would be off by that much


def test_the_worst_and_the_median_episode_are_shown_whole(euler):
    worst, median = traces(euler, NOTHING, 1.0).traces
    assert (worst.name, worst.place, worst.whole) == ("7", "worst of 3", True)
    assert (median.name, median.place, median.whole) == ("9", "median of 3", True)
    assert (worst.errors[EFFECTS] > median.errors[EFFECTS]).all()
    assert {BASE, EFFECTS} == set(worst.said)
    alone = traces(euler, Hypothesis(), 1.0).traces[0]  # nothing is named: the base alone
    assert set(alone.said) == {BASE}


@pytest.mark.parametrize(("scale", "shown"), [((1e-3, 1.0), (0, 1)), ((1.0, 1e-3), (1, 0))])
def test_the_channels_that_make_most_of_the_mismatch_come_first(euler, scale, shown):
    problem = replace(euler.everything, scale=np.array(scale))
    assert traces(replace(euler, everything=problem), NOTHING, 1.0).shown == shown


def test_what_is_noise_makes_no_mismatch(euler):
    problem = replace(euler.everything, floor=np.array([1e3, 0.0]), scale=np.ones(2))
    assert traces(replace(euler, everything=problem), NOTHING, 1.0).shown == (1, 0)


def test_the_parts_of_a_long_episode_remember_what_was_before_them():
    """A late actuator: the first rollout of a part needs commands from before it."""
    world = World(
        "slider", filters=[channel_filter(0, lambda u, t, h, memory: late(u[:, None], t, h, memory)[:, 0])]
    )
    late = delayed(0.06)
    whole = record(world, episodes=1, steps=2500, noise=0.0, known_noise=False)
    question = question_of(replace(whole, held_out=HeldOut(time_from=20.0)))
    leader = Hypothesis(terms=(Term("actuator_delay", "force", {"delay": 0.06}),), declared=((),))
    found = traces(question, leader, 1.0)
    assert [t.place for t in found.traces] == ["worst of 3", "median of 3"]
    for trace in found.traces:
        assert not trace.whole
        assert np.nanmin(trace.t) >= 20.0
        assert np.isnan(trace.t).sum() <= 12
        assert (trace.errors[EFFECTS] < 0.02 * trace.errors[BASE]).all()


def test_what_nobody_measured_is_not_drawn_and_the_course_has_every_window(euler):
    shown = traces(replace(euler, hidden=("q_dot",)), Hypothesis(), 1.0)
    assert shown.shown == (0,)
    drawn = course(euler, NOTHING)
    assert drawn.seconds == pytest.approx(0.5)
    assert not drawn.session
    assert len(drawn.t) == len(drawn.sizes[BASE]) == len(euler.everything.windows)
    assert drawn.sizes[BASE].max() < 1e-10
