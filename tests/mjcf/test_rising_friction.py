"""Dry friction that grows as joints slow, or under load, of an arm that is driven slowly: through the whole diagnosis."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mjcf_models import asked_of, linked

from gpsim.diagnosis import diagnose

pytestmark = pytest.mark.slow

JOINTS, DT, SAMPLES = ("one", "two", "three"), 0.01, 3500
DRY, RISE, SLOW, VISCOUS = 0.3, 0.2, 0.12, 0.25  # N m, N m, rad/s, N m s/rad: at every joint
SHARE = 0.15  # of what a motor gives
MODEL = linked(JOINTS, "0 0 1", "0.2 0 0", 'mass="0.4" pos="0.1 0 0" diaginertia="0.004 0.004 0.004"')


def _sizes(folder, rise, share=0.0):
    """What is said of an arm that is driven slowly, by friction that a force of its own makes: sizes by family."""
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
    simulator = question.whole
    report = diagnose(question.recording, simulator, simulator.defaults(), np.random.default_rng(0)).diagnosis
    out = {}
    for e in report.effects:
        out.setdefault(e.family, []).append({name: p.value for name, p in e.parameters.items()})
    return out


def test_it_is_found_where_friction_grows_as_joints_slow(tmp_path):
    said = _sizes(tmp_path, RISE)
    assert [e["damping"] for e in said["viscous_friction"]] == pytest.approx([VISCOUS] * 3, rel=0.35)
    grown = said["stribeck_friction"]
    assert len(grown) > len(JOINTS) / 2
    for values in grown:
        assert values["rise"] == pytest.approx(RISE, rel=0.6)


def test_no_growth_is_found_of_friction_that_does_not_grow(tmp_path):
    said = _sizes(tmp_path, 0.0)
    assert {"stribeck_friction", "load_friction"}.isdisjoint(said)
    assert [e["force"] for e in said["coulomb_friction"]] == pytest.approx([DRY] * 3, rel=0.1)


def test_friction_under_load_is_a_share_of_what_motors_give(tmp_path):
    said = _sizes(tmp_path, 0.0, SHARE)
    assert said["load_friction"][0]["share"] == pytest.approx(SHARE, rel=0.2)
    assert [e["damping"] for e in said["viscous_friction"]] == pytest.approx([VISCOUS] * 3, rel=0.25)
