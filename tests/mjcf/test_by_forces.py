"""A robot whose measured torques are noisy: forces say how large its rotors are, a fit of simulations does not."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mjcf_models import asked_of, linked

from gpsim.diagnosis.attribution import explained_by, forces_lead, with_values_of_forces
from gpsim.diagnosis.fitting import Hypothesis, child_of, fit
from gpsim.diagnosis.selection import null_of
from gpsim.diagnosis.setup import by_forces, offers_of

JOINTS, DT, SAMPLES = ("one", "two"), 0.01, 3000
ROTORS, VISCOUS, NOISE = (0.05, 0.03), (0.3, 0.2), (1.2, 0.8)
"""kg m^2, N m s/rad, and of the torques N m: half of what moves the arm."""
MODEL = linked(JOINTS, "0 0 1", "0.2 0 0", 'mass="0.4" pos="0.1 0 0" diaginertia="0.004 0.004 0.004"')


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """The question, and the account of what is missing at half of its sizes."""
    folder, rng = tmp_path_factory.mktemp("arm"), np.random.default_rng(8)
    model = mujoco.MjModel.from_xml_string(MODEL)
    model.dof_damping[:], model.dof_armature[:] = VISCOUS, ROTORS
    data, rows = mujoco.MjData(model), []
    tones, phases = rng.uniform(1.0, 7.0, (2, 4)), rng.uniform(0.0, 6.3, (2, 4))
    for k in range(SAMPLES):
        data.ctrl[:] = 0.6 * np.sin(tones * k * DT + phases).sum(axis=1)
        seen = np.concatenate([data.qpos, data.qvel]) + 1e-3 * rng.normal(size=4)
        rows.append([*seen, *(data.ctrl + np.array(NOISE) * rng.normal(size=2))])
        mujoco.mj_step(model, data, round(DT / model.opt.timestep))
    question = asked_of(folder, MODEL, JOINTS, DT, 1e-3, rows)
    offers, account = offers_of(question), Hypothesis()
    for family, sizes in (("viscous_friction", VISCOUS), ("armature", ROTORS)):
        for on, size in zip(JOINTS, sizes, strict=True):
            (candidate,) = [c for c in offers if (c.family, c.place.on, c.variant) == (family, on, "")]
            account = child_of(account, candidate, (size / 2.0,))
    return question, offers, account


def test_forces_say_the_sizes_within_what_they_call_uncertain(arm):
    question, offers, account = arm
    found = by_forces(question.everything, question.recording, account, offers)
    assert found
    for sizes in found:
        off = (sizes.account.theta - np.array([*VISCOUS, *ROTORS])) / np.sqrt(np.diag(sizes.covariance))
        assert np.abs(off).max() < 4.0


def test_they_are_taken_where_simulations_with_them_go_further(arm):
    question, offers, account = arm
    problem = question.everything
    leader = fit(problem, account, problem.windows.measured[:, 0], iterations=8)
    null = null_of(problem, account.scheme)
    found = with_values_of_forces(question, leader, null, offers)
    truth = np.array([*VISCOUS, *ROTORS])
    assert np.abs(found.hypothesis.theta / truth - 1.0).max() < 0.1
    assert np.abs(leader.hypothesis.theta / truth - 1.0).max() > 0.3


def test_an_account_of_which_nothing_was_learnt_is_judged_as_it_is(arm):
    """As the true model is, where a proof compares rollouts."""
    question, _, account = arm
    problem = question.everything
    leader = fit(problem, account.frozen(), problem.windows.measured[:, 0], iterations=3)
    explained = explained_by(question, leader, null_of(problem, account.scheme))
    assert 0.0 < explained.rollout.share < 1.0


def _with(account, offers, family, on, *values):
    (candidate,) = [c for c in offers if (c.family, c.place.on, c.variant) == (family, on, "")]
    return child_of(account, candidate, values)


def test_a_body_of_which_they_are_not_sure_goes_with_that(arm):
    question, offers, account = arm
    problem = question.everything
    for on in JOINTS:
        account = _with(account, offers, "constant_force", on, 0.01)
    leader = fit(
        problem,
        _with(account, offers, "parameter_offset", "link_two.mass", 1.3),
        problem.windows.measured[:, 0],
        iterations=8,
    )
    found = with_values_of_forces(question, leader, null_of(problem, account.scheme), offers)
    assert leader.hypothesis.claims - found.hypothesis.claims == {("parameter_offset", "link_two.mass")}
    assert len(found.covariance) == len(found.hypothesis.theta)
    assert forces_lead(question, leader, offers)
    assert not forces_lead(question, replace(leader, hypothesis=found.hypothesis), offers)


def test_a_law_that_windows_alone_ask_for_goes(arm):
    question, offers, account = arm
    problem = question.everything
    for on in JOINTS:
        account = _with(account, offers, "constant_force", on, 0.01)
    dragged = _with(account, offers, "quadratic_drag", "two", 0.1)
    leader = fit(problem, dragged, problem.windows.measured[:, 0], iterations=8)
    found = with_values_of_forces(question, leader, null_of(problem, account.scheme), offers)
    assert leader.hypothesis.claims - found.hypothesis.claims == {("quadratic_drag", "two")}


def test_what_forces_do_not_say_stays(arm):
    question, offers, account = arm
    lagging = _with(account, offers, "actuator_lag", "motor_one", 0.02)
    assert by_forces(question.everything, question.recording, lagging, offers) == []


def test_another_law_acts_with_the_value_that_it_has(arm):
    question, offers, account = arm
    pushed = _with(account, offers, "quadratic_drag", "one", 0.1)
    found = by_forces(question.everything, question.recording, pushed, offers)
    plain = by_forces(question.everything, question.recording, account, offers)
    names = question.everything.simulator.state.names
    speed = np.abs(question.recording.episodes[0].states[:, names.index("one_dot")])
    alike = 0.1 * np.mean(speed**3) / np.mean(speed**2)  # viscous friction that is nearest to the drag
    for sizes, without in zip(found, plain, strict=True):
        assert sizes.account.theta[-1] == 0.1
        assert sizes.covariance[-1, -1] == 0.0
        less = without.account.theta[0] - sizes.account.theta[0]
        assert less == pytest.approx(alike, rel=0.2)
