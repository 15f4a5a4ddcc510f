"""Dry friction that grows as joints slow, or under load: a start that knows it says friction where others cannot."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mjcf_models import asked_of, linked

from gpsim.diagnosis.fitting import Hypothesis, child_of
from gpsim.diagnosis.selection import usual_machine
from gpsim.diagnosis.setup import by_forces, by_inverse_dynamics, offers_of, rises_of

JOINTS, DT, SAMPLES = ("one", "two", "three"), 0.01, 3500
DRY, RISE, SLOW, VISCOUS = 0.3, 0.2, 0.12, 0.25  # N m, N m, rad/s, N m s/rad: at every joint
SHARE = 0.15  # of what a motor gives
ROWS = ("coulomb_friction", "viscous_friction", "armature")
MODEL = linked(JOINTS, "0 0 1", "0.2 0 0", 'mass="0.4" pos="0.1 0 0" diaginertia="0.004 0.004 0.004"')


def _asked(folder, rise, share=0.0):
    """The question of an arm that is driven slowly, by friction that a force of its own makes, and rows of no size."""
    rng, model = np.random.default_rng(5), mujoco.MjModel.from_xml_string(MODEL)
    model.opt.timestep, model.dof_armature[:] = DT / 20, 0.05
    data, rows = mujoco.MjData(model), []
    tones, phases = rng.uniform(0.3, 2.0, (3, 4)), rng.uniform(0.0, 6.3, (3, 4))
    for k in range(SAMPLES):
        wanted = 0.2 * np.sin(tones * k * DT + phases).sum(axis=1)
        seen = np.concatenate([data.qpos, data.qvel]) + 2e-4 * rng.normal(size=6)
        command = 20.0 * (wanted - data.qpos) - 2.0 * data.qvel
        rows.append([*seen, *command])
        for _ in range(20):
            v = data.qvel
            dry = DRY + rise * np.exp(-((v / SLOW) ** 2)) + share * np.abs(command)
            dry *= np.tanh(v / 2e-3)
            data.qfrc_applied[:] = command - dry - VISCOUS * v
            mujoco.mj_step(model, data)
    question = asked_of(folder, MODEL, JOINTS, DT, 2e-4, rows)
    offers, account = offers_of(question), Hypothesis()
    for candidate in offers:
        if candidate.family in ROWS and not candidate.variant:
            account = child_of(account, candidate, tuple(p.none for p in candidate.declared))
    return question, offers, account


def _sizes(account, family):
    return np.array([next(iter(t.values.values())) for t in account.terms if t.family == family])


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    """Friction that grows to two thirds more as joints slow: the question, and where a search begins that asks it."""
    question, offers, rows = _asked(tmp_path_factory.mktemp("slow"), RISE)
    return question, offers, rows, _begun(question, offers, rows)


def _begun(question, offers, rows):
    rises = rises_of(question.searched.simulator, offers)
    return by_inverse_dynamics(question.searched, question.recording, rows, rises=rises)


def test_friction_is_right_where_its_growth_is_asked_and_far_off_where_not(slow):
    question, _, rows, found = slow
    without = by_inverse_dynamics(question.searched, question.recording, rows)
    assert (_sizes(without, "viscous_friction") < 0.25 * VISCOUS).any()
    assert _sizes(found, "viscous_friction") == pytest.approx(VISCOUS, rel=0.35)
    assert _sizes(found, "coulomb_friction") == pytest.approx(DRY, rel=0.15)
    grown = [t for t in found.terms if t.family == "stribeck_friction"]
    assert len(grown) > len(JOINTS) / 2
    for term in grown:
        assert term.values["rise"] == pytest.approx(RISE, rel=0.6)
        assert term.values["stribeck_velocity"] == pytest.approx(SLOW, rel=0.35)


def test_forces_size_what_grows_with_everything_else(slow):
    question, offers, _, found = slow
    said = by_forces(question.everything, question.recording, found, offers)
    assert said
    place = [p.name for p in found.parameters].index("rise")
    for sizes in said:
        assert sizes.covariance[place, place] > 0.0
        assert sizes.account.theta[place] == pytest.approx(RISE, rel=0.6)


def test_no_growth_is_found_of_friction_that_does_not_grow(tmp_path):
    question, offers, rows = _asked(tmp_path, 0.0)
    found = _begun(question, offers, rows)
    assert not _sizes(found, "stribeck_friction").size
    assert not _sizes(found, "load_friction").size
    assert _sizes(found, "coulomb_friction") == pytest.approx(DRY, rel=0.1)


def test_friction_under_load_is_a_share_of_what_motors_give(tmp_path):
    question, offers, rows = _asked(tmp_path, 0.0, SHARE)
    found = _begun(question, offers, rows)
    (term,) = (t for t in found.terms if t.family == "load_friction")
    assert term.places == JOINTS
    assert term.values["share"] == pytest.approx(SHARE, rel=0.2)
    assert _sizes(found, "viscous_friction") == pytest.approx(VISCOUS, rel=0.25)
    said = by_forces(question.everything, question.recording, found, offers)
    place = [p.name for p in found.parameters].index("share")
    assert said
    for sizes in said:
        deviation = np.sqrt(sizes.covariance[place, place])
        assert sizes.account.theta[place] == pytest.approx(SHARE, abs=3.0 * deviation)


@pytest.mark.slow
def test_the_search_begins_with_it(slow):
    question, offers, *_ = slow
    full, *_ = usual_machine(question, offers)
    assert _sizes(full.hypothesis, "stribeck_friction").size
