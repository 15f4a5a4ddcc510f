"""What a double pendulum left out is found again: the truth is MuJoCo's at a quarter of the step, by another integrator."""

import mujoco
import numpy as np
import pytest
from mjcf_models import DOUBLE, logged

from gpsim.diagnosis import diagnose
from gpsim.stages.diagnose import Task, open_recording

NOISE, DT = 5e-4, 0.01


def dry(model):
    step = model.opt.timestep
    model.dof_frictionloss[1] = 0.05
    model.dof_solref[1], model.dof_solimp[1] = (-1.0, -2.0 / step), (0.9999, 0.9999, 0.001, 0.5, 2.0)


def heavy(model):
    model.body_mass[2] *= 1.15


def commands(rng, count):
    """Sums of sines, so that both joints go to and fro."""
    t = DT * np.arange(count)
    tones = rng.uniform(0.15, 2.5, (2, 5, 1)), rng.uniform(0.0, 6.3, (2, 5, 1)), rng.normal(size=(2, 5, 1))
    made = (tones[2] * np.sin(2 * np.pi * tones[0] * t + tones[1])).sum(axis=1).T
    return made / made.std(axis=0) * [1.2, 0.4]


def recorded(folder, change, late=0.0, samples=1500, episodes=3):
    rng, model = np.random.default_rng(7), mujoco.MjModel.from_xml_string(DOUBLE)
    model.opt.timestep /= 4
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    change(model)
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    steps, rows = round(DT / model.opt.timestep), []
    for e in range(episodes):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = 0.3 * rng.normal(size=2)
        given = commands(rng, samples // episodes)
        sent = np.vstack([np.zeros((round(late / model.opt.timestep), 2)), np.repeat(given, steps, axis=0)])
        for k, command in enumerate(given):
            q = data.qpos + NOISE * rng.normal(size=2)
            rows.append((e, DT * k, *q, *command))
            for i in range(steps):
                data.ctrl[:] = sent[k * steps + i]
                mujoco.mj_step(model, data)
    state, noise = (dict.fromkeys(("shoulder", "elbow"), value) for value in ("rad", NOISE))
    return logged(folder, DOUBLE, rows, DT, state, {"m1": "N m", "m2": "N m"}, noise=noise)


def found(folder):
    recording, simulator = open_recording(Task(folder, None))
    return diagnose(recording, simulator, simulator.defaults(), np.random.default_rng(0)).diagnosis


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "late", "family", "on", "value"),
    [
        (dry, 0.0, "coulomb_friction", "elbow", 0.05),
        (heavy, 0.0, "parameter_offset", "lower.mass", 1.15),
    ],
)
def test_a_single_effect_is_named_with_its_size(change, late, family, on, value, tmp_path):
    diagnosis = found(recorded(tmp_path, change, late))
    assert diagnosis.verdict == "named"
    ((name, place, estimate),) = [
        (e.family, e.on, next(iter(e.parameters.values()))) for e in diagnosis.effects if e.role == "headline"
    ]
    assert (name, place) == (family, on)
    assert estimate.value == pytest.approx(value, rel=0.05)


@pytest.mark.slow
def test_where_nothing_is_missing_nothing_is_named(tmp_path):
    diagnosis = found(recorded(tmp_path, lambda model: None))
    assert (diagnosis.verdict, diagnosis.effects) == ("none", ())
