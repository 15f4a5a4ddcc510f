"""What is exported replays as gpsim's corrected simulator does: attributes alone, and with the wrapper."""

import importlib.util
import json
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from mjcf_models import DOUBLE, FLOATING, SERVO, SLIDER, written

from gpsim.corrected import EffectsPlant
from gpsim.effects import Gate, Term
from gpsim.errors import UsageError
from gpsim.mjcf import Correction, export_model, load_mjcf

DT = 0.01
NATIVE = {
    "coulomb": [Term("coulomb_friction", "elbow", {"force": 0.05})],
    "viscous": [Term("viscous_friction", "elbow", {"damping": 0.03})],
    "less damping": [Term("viscous_friction", "shoulder", {"damping": -0.02})],
    "drag": [Term("quadratic_drag", "shoulder", {"drag": 0.04})],
    "spring": [Term("spring", "elbow", {"stiffness": 0.4, "rest_position": 0.3})],
    "armature": [Term("armature", "elbow", {"inertia": 0.01})],
    "mass": [Term("parameter_offset", "lower.mass", {"ratio": 1.237})],
    "centre": [Term("parameter_offset", "lower.com_x", {"offset": 0.021})],
    "inertia": [Term("parameter_offset", "upper.inertia", {"ratio": 1.31})],
    "gravity": [Term("parameter_offset", "gravity", {"ratio": 0.973})],
    "tilt": [Term("gravity_tilt", "gravity", {"roll": 0.03, "pitch": 0.05})],
    "payload": [Term("payload", "lower", {"mass": 0.2, "x": 0.03, "y": 0.01, "z": -0.3})],
    "gain": [Term("actuator_gain", "m1", {"gain": 0.83})],
    "gain and bias": [Term("actuator_bias", "m2", {"bias": 0.07}), Term("actuator_gain", "m2", {"gain": 0.9})],
    "limit and gain": [
        Term("actuator_saturation", "m1", {"limit": 0.7}), Term("actuator_gain", "m1", {"gain": 1.2}),
    ],
    "delay": [Term("actuator_delay", "m1", {"delay": 0.0137})],
    "two": [Term("coulomb_friction", "elbow", {"force": 0.05}), Term("parameter_offset", "lower.mass", {"ratio": 1.1})],
}  # fmt: skip
REGION = Gate(region={"elbow": (-0.4, 0.4)})
WRAPPED = {
    "backlash": [Term("actuator_backlash", "m1", {"half_width": 0.1})],
    "dead zone": [Term("actuator_dead_zone", "m1", {"width": 0.3})],
    "asymmetry": [Term("actuator_asymmetry", "m1", {"gain_positive": 0.8, "gain_negative": 1.1})],
    "rate limit": [Term("actuator_rate_limit", "m1", {"rate": 9.0})],
    "lag": [Term("actuator_lag", "m1", {"time_constant": 0.03})],
    "sag": [Term("battery_sag", "m1", {"loss_per_second": 0.01})],
    "short delay": [Term("actuator_delay", "m1", {"delay": 0.0013})],
    "way": [
        Term("actuator_lag", "m1", {"time_constant": 0.02}), Term("actuator_delay", "m1", {"delay": 0.0137}),
        Term("actuator_bias", "m1", {"bias": 0.1}), Term("actuator_dead_zone", "m1", {"width": 0.2}),
    ],
    "dead zone and gain": [
        Term("actuator_gain", "m1", {"gain": 0.8}), Term("actuator_dead_zone", "m1", {"width": 0.2}),
    ],
    "gated gain": [Term("actuator_gain", "m1", {"gain": 0.7}, Gate(region={"shoulder": (0.0, 1.0)}))],
    "stribeck": [
        Term("stribeck_friction", "elbow", {"force": 0.03, "static_force": 0.06, "stribeck_velocity": 0.2})
    ],
    "patch": [Term("local_friction_patch", "elbow", {"force": 0.08}, REGION)],
    "gated damping": [Term("viscous_friction", "elbow", {"damping": 0.1}, REGION)],
    "gated mass": [Term("parameter_offset", "lower.mass", {"ratio": 1.2}, REGION)],
    "constant": [Term("constant_force", "elbow", {"force": 0.11})],
    "sensor bias": [Term("sensor_bias", "elbow", {"offset": 0.01})],
    "sensor scale": [Term("sensor_scale", "elbow", {"scale": 1.02})],
    "sensor delay": [Term("sensor_delay", "elbow", {"delay": 0.0123})],
    "all": [
        Term("sensor_delay", "elbow", {"delay": 0.005}), Term("sensor_scale", "elbow", {"scale": 1.02}),
        Term("stribeck_friction", "shoulder", {"force": 0.1, "static_force": 0.2, "stribeck_velocity": 0.2}),
        Term("coulomb_friction", "elbow", {"force": 0.02}), Term("actuator_backlash", "m2", {"half_width": 0.05}),
        Term("actuator_gain", "m1", {"gain": 0.9}), Term("payload", "lower", {"mass": 0.1, "x": 0.0, "y": 0.0, "z": -0.2}),
    ],
}  # fmt: skip


def corrected(reference, terms, dt=DT, parameters=None, age=0.0):
    simulator = load_mjcf(reference)
    believed = simulator.defaults(parameters or {})
    substeps = simulator.steps_of(dt)
    plant = EffectsPlant(simulator, believed, tuple(terms), "fine", substeps, dt, ages=(age, age))
    return plant, Correction(simulator, believed, tuple(terms), dt, substeps, age)


def exported(folder, text, terms, **more):
    plant, correction = corrected(written(folder, text), terms, **more)
    out = folder / "out"
    out.mkdir()
    made = export_model(correction, {}, {"diagnosis": "DIR"}, out / "robot_corrected.xml")
    return plant, made


def robot_of(made):
    spec = importlib.util.spec_from_file_location("robot_corrected", made.files["wrapper"])
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Robot


def commands(actions, seconds, dt, size=1.5):
    rng = np.random.default_rng(3)
    return np.repeat(size * rng.uniform(-1.0, 1.0, (round(seconds / dt / 5), actions)), 5, axis=0)


def replayed(plant, start, sent):
    """(K, S) the measured states of gpsim's corrected simulator."""
    rng, memory = np.random.default_rng(0), plant.begin(1, np.random.default_rng(0))
    state, out = np.array(start)[None], []
    plant.measure(state, memory, rng)
    for command in sent:
        state = plant.step(state, command[None], memory, rng)
        out.append(plant.measure(state, memory, rng)[0])
    return np.array(out)


def native(made, start, sent, substeps):
    model = mujoco.MjModel.from_xml_path(str(made.files["model"]))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = start[0::2], start[1::2]
    out = []
    for command in sent:
        data.ctrl[:] = command
        mujoco.mj_step(model, data, nstep=substeps)
        out.append(np.stack([data.qpos, data.qvel], axis=1).ravel())
    return np.array(out)


def wrapped(made, start, sent, **more):
    robot, out = robot_of(made)(**more), []
    robot.reset(start[0::2], start[1::2])
    for command in sent:
        robot.step(command)
        out.append(np.stack(robot.measured(), axis=1).ravel())
    return np.array(out)


def apart(one, other):
    return float(np.abs(one - other).max() / np.abs(one).max())


START = np.array([0.3, 0.1, -0.2, 0.4])


@pytest.mark.parametrize("which", NATIVE)
def test_attributes_alone_replay_to_1e5(which, tmp_path):
    plant, made = exported(tmp_path, DOUBLE, NATIVE[which])
    assert all(e["where"] == "attribute" and e["attributes"] for e in made.effects) and not made.wrapped
    sent = commands(2, 1.0, DT)
    want = replayed(plant, START, sent)
    base = replayed(corrected(str(tmp_path / "robot.xml"), [])[0], START, sent)
    assert apart(want, base) > 1e-3  # it does something
    assert apart(want, native(made, START, sent, plant.substeps)) < 1e-5
    assert apart(want, wrapped(made, START, sent)) < 1e-5


@pytest.mark.parametrize("which", WRAPPED)
def test_with_the_wrapper_it_replays_to_1e4(which, tmp_path):
    plant, made = exported(tmp_path, DOUBLE, WRAPPED[which], age=20.0)
    assert made.wrapped and all(e["why"] for e in made.effects if "wrapper" in e["where"])
    sent = commands(2, 1.0, DT)
    want = replayed(plant, START, sent)
    assert apart(want, native(made, START, sent, plant.substeps)) > 1e-3  # the model alone does not say it
    assert apart(want, wrapped(made, START, sent)) < 1e-4
