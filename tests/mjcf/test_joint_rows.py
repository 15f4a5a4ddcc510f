"""What most joints of a robot have costs next to nothing at the others."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mjcf_models import asked_of, linked, written

from gpsim.diagnosis.fitting import FREE_ROW, Hypothesis, child_of, expected, fit, is_row, price
from gpsim.diagnosis.selection import Rule, accepts
from gpsim.diagnosis.setup import candidates, offers_of, rises_of
from gpsim.effects import effect_of
from gpsim.mjcf import load_mjcf
from gpsim.recordings import Episode, Recording

JOINTS = ("one", "two", "three", "four")
DT, SAMPLES, VISCOUS = 0.02, 200, 0.2
MODEL = linked(JOINTS, "0 1 0", "0 0 -0.2", 'mass="0.5" pos="0 0 -0.1" diaginertia="0.01 0.01 0.01"')


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """A chain of four joints that rub alike; its question and offers."""
    folder, rng = tmp_path_factory.mktemp("chain"), np.random.default_rng(5)
    model = mujoco.MjModel.from_xml_string(MODEL)
    model.dof_damping[:] = VISCOUS
    data, rows = mujoco.MjData(model), []
    for k in range(SAMPLES):
        data.ctrl[:] = 0.8 * np.sin(np.array([3.0, 4.0, 5.0, 6.0]) * k * DT)
        seen = np.concatenate([data.qpos, data.qvel]) + 1e-4 * rng.normal(size=8)
        rows.append([*seen, *data.ctrl])
        mujoco.mj_step(model, data, round(DT / model.opt.timestep))
    question = asked_of(folder, MODEL, JOINTS, DT, 1e-4, rows)
    return question.searched, offers_of(question)


def _with(offers, family, joints, size):
    account = Hypothesis()
    for on in joints:
        (candidate,) = [c for c in offers if (c.family, c.place.on, c.variant) == (family, on, "")]
        account = child_of(account, candidate, (size,))
    return account


@pytest.mark.parametrize(("count", "alike"), [(1, 0), (2, 0), (3, 3), (4, 4)])
def test_friction_is_expected_where_more_than_half_of_the_joints_have_it(chain, count, alike):
    problem, offers = chain
    assert len(expected(problem, _with(offers, "viscous_friction", JOINTS[:count], 0.1))) == alike
    assert not expected(problem, _with(offers, "constant_force", JOINTS[:count], 0.1))
    grown = Hypothesis()
    for rise in rises_of(problem.simulator, offers)[:count]:
        grown = grown.plus(rise.term((0.1, 0.2)), rise.declared[:1])
    assert len(expected(problem, grown)) == alike


def test_the_last_joints_friction_costs_little_and_stays_where_it_gains_anything(chain):
    problem, offers = chain
    fits = []
    for count in (1, 2, 3, 4):
        account = _with(offers, "viscous_friction", JOINTS[:count], VISCOUS)
        fits.append(fit(problem, account, problem.windows.measured[:, 0], iterations=4))
    assert price(problem, fits[3], fits[2]) == pytest.approx(FREE_ROW)
    assert price(problem, fits[1], fits[0]) > 2 * FREE_ROW
    found = accepts(problem, fits[3], fits[2])
    assert (found.ok, found.rule) == (True, Rule.EVERY_JOINT)
    assert accepts(problem, fits[1], fits[0]).rule is not Rule.EVERY_JOINT


FLOATING = """<mujoco><worldbody><body name="trunk"><joint name="x" type="slide" axis="1 0 0"/>
<joint name="z" type="slide" axis="0 0 1"/><joint name="pitch" axis="0 1 0"/><geom size="0.1" mass="1"/>
<body name="leg"><joint name="hip" axis="0 1 0"/><geom size="0.05" pos="0 0 -0.3" mass="0.2"/></body></body></worldbody>
<actuator><motor joint="hip"/></actuator></mujoco>"""


def test_nothing_rubs_where_a_body_floats(tmp_path):
    simulator = load_mjcf(written(tmp_path, FLOATING))
    assert simulator.floating == {"x", "z", "pitch"}
    states = np.random.default_rng(1).normal(size=(50, 8))
    episode = Episode("one", 0.02 * np.arange(50), states, np.zeros((49, 1)))
    recording = Recording(simulator.name, simulator.state, simulator.action, (episode,), 0.02)
    offers = candidates(recording, simulator, simulator.defaults())
    assert {c.place.on for c in offers if is_row(effect_of(c.family))} == {"hip"}
