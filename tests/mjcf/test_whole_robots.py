"""Robots whose every joint rubs: speeds from positions, and an account of all rows, through the whole diagnosis."""

import mujoco
import numpy as np
import pytest
from mjcf_models import DOUBLE, logged

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.setup import prepare
from gpsim.diagnosis.setup.sight import speed_of
from gpsim.stages.diagnose import Task, open_recording

NOISE, DT, SAMPLES = 5e-4, 0.02, 300
DRY, VISCOUS, ROTOR = (0.3, 0.15), (0.2, 0.1), (0.03, 0.01)


LOAD, AT = 0.3, (0.04, 0.0, -0.35)  # kg, m in the lower link's frame


def _logged(folder, *, load=0.0, late=0, lost=(), held=0.0):
    """A double pendulum with friction and rotors at both joints, positions only; recording, simulator and true speeds.

    load: kg at AT of the lower link; late: samples by which commands come late; lost: rows of every episode; held: the
    share of gravity that a controller makes up for.
    """
    spec = mujoco.MjSpec.from_string(DOUBLE)
    if load:
        spec.body("lower").add_geom(pos=AT, size=[1e-4, 0, 0], mass=load, contype=0, conaffinity=0)
    for body in spec.bodies[1:]:
        body.gravcomp = held
    rng, model = np.random.default_rng(3), spec.compile()
    model.opt.timestep /= 4
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for i in range(2):
        model.dof_frictionloss[i] = DRY[i]
        model.dof_solref[i] = (-1.0, -2.0 / model.opt.timestep)
        model.dof_solimp[i] = (0.9999, 0.9999, 0.001, 0.5, 2.0)
        model.dof_damping[i] += VISCOUS[i]
        model.dof_armature[i] += ROTOR[i]
    data, rows, speeds = mujoco.MjData(model), [], []
    mujoco.mj_setConst(model, data)
    for e in range(3):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = 0.3 * rng.normal(size=2)
        tones, phases = rng.uniform(0.2, 1.5, (2, 5)), rng.uniform(0, 6.3, (2, 5))
        waves = [np.sin(2 * np.pi * tones * DT * k + phases).sum(axis=1) for k in range(SAMPLES)]
        commands = np.array([3.0, 1.0]) * waves
        for k in range(SAMPLES):
            data.ctrl[:] = commands[max(k - late, 0)]
            q = data.qpos + NOISE * rng.normal(size=2)
            if k not in lost:
                rows.append((e, DT * k, *q, *commands[k]))
            speeds.append(np.array(data.qvel))
            mujoco.mj_step(model, data, round(DT / model.opt.timestep))
    state, noise = (dict.fromkeys(("shoulder", "elbow"), value) for value in ("rad", NOISE))
    logged(folder, DOUBLE, rows, DT, state, {"m1": "N m", "m2": "N m"}, noise=noise)
    recording, simulator = open_recording(Task(folder, None))
    return recording, simulator, np.array(speeds).reshape(3, SAMPLES, 2)


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory):
    """Friction and rotors alone."""
    return _logged(tmp_path_factory.mktemp("rubbing"))


def test_a_speed_is_taken_over_as_many_samples_as_noise_asks_for():
    t = DT * np.arange(400)
    path, true = np.sin(3 * t), 3 * np.cos(3 * t)
    clean = speed_of(path, t, 1e-9)
    noisy = path + 2e-3 * np.random.default_rng(0).normal(size=len(t))
    told, guessed = speed_of(noisy, t, 2e-3), speed_of(noisy, t)
    naive = np.gradient(noisy, t)
    assert np.abs(clean - true)[1:-1].max() < 0.01
    for found in (told, guessed):
        assert np.sqrt(np.mean((found - true) ** 2)) < 0.4 * np.sqrt(np.mean((naive - true) ** 2))


def test_speeds_that_nobody_measured_are_near_the_truth_though_the_base_lacks_much(rubbing):
    recording, simulator, speeds = rubbing
    question = prepare(recording, simulator, simulator.defaults(), Run())
    names = question.everything.simulator.state.names
    columns = [names.index(n) for n in ("shoulder_dot", "elbow_dot")]
    for episode, true in zip(question.recording.episodes, speeds, strict=True):
        off = episode.states[2:-2, columns] - true[2:-2]
        assert (np.sqrt(np.mean(off**2, axis=0)) < 0.05 * true.std(axis=0)).all()


def found(recording, simulator, **wrong):
    """Verdict and sizes by family and place, of an account of a simulator with some parameters that many times off."""
    parameters = dict(simulator.defaults())
    parameters |= {name: times * parameters[name] for name, times in wrong.items()}
    report = diagnose(recording, simulator, parameters, np.random.default_rng(0)).diagnosis
    values = {(e.family, e.on): {n: p.value for n, p in e.parameters.items()} for e in report.effects}
    return report.verdict, values


def check_rows(values, rel=0.15):
    for i, on in enumerate(("shoulder", "elbow")):
        assert values["coulomb_friction", on]["force"] == pytest.approx(DRY[i], rel=rel)
        assert values["viscous_friction", on]["damping"] == pytest.approx(VISCOUS[i], rel=rel)
        assert values["armature", on]["inertia"] == pytest.approx(ROTOR[i], rel=rel)


@pytest.mark.slow
def test_friction_and_rotor_of_both_joints_are_named_with_their_sizes(rubbing):
    recording, simulator, _ = rubbing
    verdict, values = found(recording, simulator)
    assert verdict == "named"
    check_rows(values)
    assert len(values) == 6


@pytest.mark.slow
def test_a_mass_is_found_beside_friction_of_both_joints(rubbing):
    recording, simulator, _ = rubbing
    _, values = found(recording, simulator, **{"lower.mass": 1.4})
    assert values["parameter_offset", "lower.mass"]["ratio"] == pytest.approx(1 / 1.4, rel=0.03)
    check_rows(values)


@pytest.mark.slow
def test_a_load_and_late_commands_are_found_though_rows_are_lost(tmp_path):
    """Of a log whose samples are not all there; a load at its place, the links' own masses left as they are."""
    recording, simulator, _ = _logged(tmp_path, load=LOAD, late=1, lost=range(40, SAMPLES, 37))
    _, values = found(recording, simulator)
    load = values["payload", "lower"]
    assert load["mass"] == pytest.approx(LOAD, rel=0.1)
    assert (load["x"], load["z"]) == pytest.approx((AT[0], AT[2]), abs=0.02)
    assert all(values["actuator_delay", m]["delay"] == pytest.approx(DT, rel=0.15) for m in ("m1", "m2"))
    check_rows(values, rel=0.2)


@pytest.mark.slow
def test_a_controller_makes_up_for_gravity(tmp_path):
    """By MuJoCo's own gravity compensation; no mass, gain or load stands for it."""
    recording, simulator, _ = _logged(tmp_path, held=0.95)
    _, values = found(recording, simulator)
    assert values["gravity_compensation", "gravity"]["share"] == pytest.approx(0.95, abs=0.03)
    assert {family for family, _ in values}.isdisjoint({"parameter_offset", "actuator_gain", "payload"})
