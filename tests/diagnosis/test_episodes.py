"""What began with an episode of a recording whose episodes each have a clock of their own."""

from dataclasses import replace

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known
from gpsim.diagnosis.setup import prepare
from gpsim.effects import EPISODE, IN_EPISODE, Gate, Term, from_json, to_json
from gpsim.reports.diagnosis_text import where
from gpsim.simulators import make_simulator

from .worlds import World, record

SLIDER = make_simulator("slider")
FIRST = 5
DRAGGED = World("slider", grips={0: lambda q, v, normal: 1.0 + 0 * q})
DEAF = World("slider", filters=[lambda u, t, h, m: np.where(np.abs(u) < 1.0, 0.0, u)])


def changed(world, *, session=False):
    """Twelve episodes of a slider, which from one on is another one."""
    before, after = (
        record(w, seed=seed, episodes=12, steps=155, session=session)
        for w, seed in ((World("slider"), 7), (world, 8))
    )
    return replace(before, episodes=(*before.episodes[:FIRST], *after.episodes[FIRST:]))


@pytest.mark.parametrize(
    ("world", "family", "value"),
    [
        (DRAGGED, "coulomb_friction", ("force", 1.0)),
        pytest.param(DEAF, "actuator_dead_zone", ("width", 1.0), marks=pytest.mark.slow),
    ],
)
def test_it_is_named_since_the_episode(world, family, value):
    recording, few = changed(world), ("coulomb_friction", "viscous_friction", "actuator_dead_zone")
    known = SLIDER.defaults(recording.parameters)
    run = Run(known=Known(only=few))
    report = diagnose(recording, SLIDER, known, np.random.default_rng(0), run=run).diagnosis
    assert report.verdict == "named"
    (effect,) = report.effects
    assert (effect.family, effect.since, effect.since_episode) == (family, None, str(FIRST))
    assert effect.parameters[value[0]].value == pytest.approx(value[1], rel=0.01)
    assert report.location.since_episode == str(FIRST)
    assert f"; since episode {FIRST}." in where(report)


@pytest.mark.slow  # test_odd_recordings.py has an onset on a session's clock
def test_a_session_says_when_and_not_which_episode():
    recording = changed(DRAGGED, session=True)
    report = diagnose(
        recording, SLIDER, SLIDER.defaults(recording.parameters), np.random.default_rng(0)
    ).diagnosis
    (effect,) = report.effects
    began = recording.episodes[FIRST].t[0]
    assert effect.since_episode is None
    assert effect.since == pytest.approx(began, abs=1.0)


def test_clocks_of_their_own_are_seen():
    windows, session = (
        prepare(r, SLIDER, SLIDER.defaults(r.parameters)).everything.windows
        for r in (changed(DRAGGED), changed(DRAGGED, session=True))
    )
    assert windows.own_clocks
    assert not windows.take(windows.episode == 3).own_clocks
    assert not session.own_clocks


def test_a_gate_in_episodes_opens_once_and_stays_open():
    gate, three = Gate(since_episode=2), np.zeros(3)
    path = (np.zeros((3, 2)), np.zeros((3, 2)))
    values = {IN_EPISODE: np.array([1.0, 2.0, 3.0])}
    share = gate.share(path, np.zeros((3, 1)), three, three, SLIDER.state, values)
    np.testing.assert_array_equal(share, [0.0, 1.0, 1.0])
    afterwards = gate.share(path, np.zeros((3, 1)), three, three, SLIDER.state, {})
    np.testing.assert_array_equal(afterwards, 1.0)  # what no recording holds comes after it
    assert gate
    assert gate.looks_at is EPISODE
    assert not gate.opened


def test_it_is_written_and_read():
    term = Term("constant_force", "q", {"force": 1.0}, Gate(since_episode=4))
    assert from_json(to_json(term)) == term
    earlier = to_json(term)
    del earlier["since_episode"]
    assert from_json(earlier).gate == Gate()
