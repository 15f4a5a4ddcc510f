"""Where something touches accelerations are left out, as long as enough else is left; the report says how often."""

import pickle

import mujoco
import numpy as np
import pytest
from mjcf_models import LENGTH, PENDULUM, written

from gpsim.diagnosis.setup import apart, prepare
from gpsim.diagnosis.setup.log_facts import contacts
from gpsim.diagnosis.setup.offers import candidates
from gpsim.mjcf import load_mjcf
from gpsim.recordings import Episode, Recording
from gpsim.reports.diagnosis_text import log_fact_text
from gpsim.simulators import make_simulator

BALL = f'<geom name="ball" size=".1" pos="0 0 -{LENGTH}" mass="0"/></body></worldbody>'
WALL = f'<geom name="wall" size=".1" pos="-{LENGTH} 0 0"/><body name'  # where theta = pi / 2
STRUCK = PENDULUM.replace("</body></worldbody>", BALL).replace("<body name", WALL)


@pytest.fixture
def struck(tmp_path):
    return load_mjcf(written(tmp_path, STRUCK))


def swings(angles):
    """A recording of these angles (N,), at rest."""
    states = np.stack([angles, np.zeros_like(angles)], axis=1)
    t = 0.02 * np.arange(len(angles))
    episode = Episode("0", t, states, np.zeros((len(angles) - 1, 1)))
    return states, episode


def recording_of(simulator, angles):
    _, episode = swings(angles)
    return Recording("mjcf", simulator.state, simulator.action, (episode,), 0.02, {}, "euler")


def test_what_touches_is_left_out_where_others_are_left(struck):
    states, _ = swings(np.array([0.0, 0.5, 1.55, 1.57, -0.3]))
    assert apart(struck, 3, states).tolist() == [True, True, False, False, True]
    assert apart(struck, 3, states, np.roll(states, -1, axis=0)).all()  # two are too few
    assert apart(struck, 2, states, np.roll(states, -1, axis=0)).tolist() == [True, False, False, False, True]
    assert apart(make_simulator("pendulum"), 1, states).all()


def test_the_report_says_how_many_samples_touch(struck):
    (fact,) = contacts(struck, recording_of(struck, np.array([0.0, 1.55, 1.57, 0.2])))
    assert log_fact_text(fact) == (
        "2 samples have contact: accelerations are not compared there, but rollouts are"
    )
    assert contacts(struck, recording_of(struck, np.linspace(-0.5, 0.5, 9))) == ()


def test_a_blow_is_no_size_of_a_force(struck):
    free = np.linspace(-1.0, 1.0, 300)
    beside = np.concatenate([free, np.full(299, 1.62)])  # 4 cm inside the wall

    def sizes(angles):
        made = candidates(recording_of(struck, angles), struck, struck.defaults())
        return {c.identity: c.place.span for c in made if c.family == "constant_force"}

    assert list(sizes(beside).values()) == pytest.approx(list(sizes(free).values()), rel=0.1)


def rolled(simulator, states):
    commands, count = np.full((len(states), 50, 1), 0.1), len(states)
    step = np.full(count, simulator.own_step)
    return simulator.rolled((), simulator.defaults(), (), states, commands, step, np.zeros(count))


def off(simulator):
    return bool(simulator.body.model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT)


def test_contacts_are_not_looked_for_where_nothing_comes_near_anything(struck):
    far, _ = swings(np.linspace(-1.0, 0.9, 7))
    free = struck.around(far)
    assert off(free)
    assert not off(struck)
    assert np.array_equal(rolled(free, far), rolled(struck, far))
    assert off(pickle.loads(pickle.dumps(free)))
    assert off(free.exact().as_modelled().with_state(free.state))
    near, _ = swings(np.array([0.0, 1.36]))  # the balls are 1 cm apart
    assert struck.around(near) is struck


def test_the_corrected_simulator_touches_again(struck):
    recording = recording_of(struck, 0.6 * np.sin(0.3 * np.arange(800)))
    states = recording.episodes[0].states
    states[:, 1] = np.gradient(states[:, 0], recording.dt)
    asked = prepare(recording, struck, struck.defaults())
    assert off(asked.everything.simulator)
    assert not off(asked.whole)
