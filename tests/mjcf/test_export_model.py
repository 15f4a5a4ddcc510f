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
from gpsim.effects import Gate, Shape, Term
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
    "a drive of two joints": [
        Term("coupled_friction", "shoulder-elbow", {"force": 0.04}),
        Term("coupled_damping", "shoulder+elbow", {"damping": 0.03}),
        Term("coupled_armature", "shoulder+elbow", {"inertia": 0.01}),
    ],
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
SLOPE = Shape(((-2.0, -0.5, 0.1, 2.0),), (0.15, 0.06, -0.01, -0.2)).values(4.0)
GRIP = Shape(((-2.0, 0.0, 0.0, 2.0),), (0.08, 0.02, 0.03, 0.05)).values(4.0)
REGION = Gate(region={"elbow": (-0.4, 0.4)})
WRAPPED = {
    "backlash": [Term("actuator_backlash", "m1", {"half_width": 0.1})],
    "dead zone": [Term("actuator_dead_zone", "m1", {"width": 0.3})],
    "dead band": [Term("actuator_dead_band", "m1", {"width": 0.3})],
    "asymmetry": [Term("actuator_asymmetry", "m1", {"gain_positive": 0.8, "gain_negative": 1.1})],
    "rate limit": [Term("actuator_rate_limit", "m1", {"rate": 9.0})],
    "lag": [Term("actuator_lag", "m1", {"time_constant": 0.03})],
    "sag": [Term("battery_sag", "m1", {"loss_per_second": 0.01})],
    "drift": [Term("clock_drift", "m1", {"drift": 2000.0})],
    "drift and gain": [Term("clock_drift", "m1", {"drift": 2000.0}), Term("actuator_dead_zone", "m1", {"width": 0.3})],
    "short delay": [Term("actuator_delay", "m1", {"delay": 0.0013})],
    "way": [
        Term("actuator_lag", "m1", {"time_constant": 0.02}), Term("actuator_delay", "m1", {"delay": 0.0137}),
        Term("actuator_bias", "m1", {"bias": 0.1}), Term("actuator_dead_zone", "m1", {"width": 0.2}),
    ],
    "dead zone and gain": [
        Term("actuator_gain", "m1", {"gain": 0.8}), Term("actuator_dead_zone", "m1", {"width": 0.2}),
    ],
    "gated gain": [Term("actuator_gain", "m1", {"gain": 0.7}, Gate(region={"shoulder": (0.0, 1.0)}))],
    "friction that grows": [
        Term("coulomb_friction", "elbow", {"force": 0.03}),
        Term("stribeck_friction", "elbow", {"rise": 0.03, "stribeck_velocity": 0.2}, variant="rise"),
    ],
    "friction under load": [
        Term("load_friction", "elbow", {"share": 0.2}, variant="rise"),
        Term("actuator_delay", "m2", {"delay": 0.0137}), Term("actuator_saturation", "m1", {"limit": 0.5}),
    ],
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
    "sensor lag": [Term("sensor_lag", "elbow_dot", {"time_constant": 0.02})],
    "sensor lag, late": [
        Term("sensor_delay", "elbow", {"delay": 0.005}), Term("sensor_lag", "elbow", {"time_constant": 0.02}),
    ],
    "a drive that gives": [
        Term("flexible_coupling", "m2", {"stiffness": 6.0, "damping": 0.02, "inertia": 0.02}),
        Term("actuator_gain", "m2", {"gain": 0.9}), Term("coulomb_friction", "elbow", {"force": 0.02}),
    ],
    "bristles": [
        Term("lugre_friction", "elbow", {"force": 0.05, "stiffness": 3.0}),
        Term("lugre_friction", "shoulder", {"force": 0.1, "static_force": 0.2, "stribeck_velocity": 0.2, "stiffness": 9.0}, variant="stribeck"),
    ],
    "force by speed": [Term("force_curve", "elbow", SLOPE, variant="speed")],
    "force by place": [Term("force_curve", "elbow", SLOPE, variant="position")],
    "measured friction": [Term("force_curve", "elbow", GRIP, variant="friction")],
    "motor curve": [Term("actuator_curve", "m1", SLOPE), Term("actuator_gain", "m1", {"gain": 0.8})],
    "sensor curve": [Term("sensor_curve", "elbow", SLOPE)],
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


SERVED = SERVO.replace('kv="3"', 'kv="3" forcerange="-4 4"')
SCALED = DOUBLE.replace("<worldbody>", '<compiler settotalmass="3"/><worldbody>')
CLASSES = DOUBLE.replace(
    "<worldbody>",
    '<compiler angle="degree" inertiafromgeom="true"/><default><joint damping="0.3"/></default><worldbody>',
)
HEAVY = Term("parameter_offset", "lower.mass", {"ratio": 1.2})
FIRM = [
    Term("spring", "elbow", {"stiffness": 0.4, "rest_position": 0.3}),
    Term("viscous_friction", "elbow", {"damping": 0.28}),
    HEAVY,
]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("text", "terms", "parameters", "attribute"),
    [
        (SERVED, [Term("parameter_offset", "servo.forcerange", {"ratio": 1.5})], {}, 'forcerange="-6 6"'),
        (CLASSES, FIRM, {}, 'springref="0.3"'),
        (DOUBLE, [Term("coulomb_friction", "elbow", {"force": 0.05})], {"upper.mass": 1.4}, 'mass="1.4"'),
        (SCALED, [HEAVY], {}, "mass="),
    ],
)
def test_limits_degrees_classes_masses_and_what_is_believed_are_written(
    tmp_path, text, terms, parameters, attribute
):
    plant, made = exported(tmp_path, text, terms, parameters=parameters)
    joints = 1 if text == SERVED else 2
    sent, start = commands(joints, 1.0, DT, size=0.8 if joints == 1 else 1.5), START[: 2 * joints]
    assert apart(replayed(plant, start, sent), native(made, start, sent, plant.substeps)) < 1e-5
    assert attribute in made.files["model"].read_text()


@pytest.mark.parametrize("which", NATIVE)
def test_attributes_alone_replay_to_1e5(which, tmp_path):
    plant, made = exported(tmp_path, DOUBLE, NATIVE[which])
    assert all(e["where"] == "attribute" and e["attributes"] for e in made.effects)
    assert not made.wrapped
    sent = commands(2, 1.0, DT)
    want = replayed(plant, START, sent)
    base = replayed(corrected(str(tmp_path / "robot.xml"), [])[0], START, sent)
    assert apart(want, base) > 1e-3  # it does something
    assert apart(want, native(made, START, sent, plant.substeps)) < 1e-5
    assert apart(want, wrapped(made, START, sent)) < 1e-5


@pytest.mark.parametrize("which", WRAPPED)
def test_with_the_wrapper_it_replays_to_1e4(which, tmp_path):
    plant, made = exported(tmp_path, DOUBLE, WRAPPED[which], age=20.0)
    assert made.wrapped
    assert all(e["why"] for e in made.effects if "wrapper" in e["where"])
    sent = commands(2, 1.0, DT)
    want = replayed(plant, START, sent)
    assert apart(want, native(made, START, sent, plant.substeps)) > 1e-3  # the model alone does not say it
    assert apart(want, wrapped(made, START, sent)) < 1e-4


def test_what_is_written_says_what_it_is(tmp_path):
    text = DOUBLE.replace("<worldbody>", "<!-- mine --><worldbody>")
    terms = [
        Term("coulomb_friction", "elbow", {"force": 0.05}),
        Term("actuator_dead_zone", "m1", {"width": 0.3}),
    ]
    _, correction = corrected(written(tmp_path, text), terms)
    said = {("coulomb_friction", "elbow"): "Coulomb friction on elbow: force 0.05 N m (0.049 to 0.051)"}
    out = tmp_path / "new"
    out.mkdir()
    made = export_model(correction, said, {"diagnosis": "DIR"}, out / "robot_corrected.xml")
    model = made.files["model"].read_text()
    assert f"<!-- {said['coulomb_friction', 'elbow']} -->" in model
    assert 'frictionloss="0.05"' in model
    diff = made.files["diff"].read_text().splitlines()
    assert sum(line.startswith("-") for line in diff) == 2  # the file's name, and the one joint
    patch = json.loads(made.files["patch"].read_text())
    assert [(e["family"], e["where"]) for e in patch["effects"]] == [
        ("coulomb_friction", "attribute"),
        ("actuator_dead_zone", "wrapper"),
    ]
    assert patch["effects"][0]["attributes"] == ["joint elbow: frictionloss, solreffriction, solimpfriction"]
    assert (patch["diagnosis"], patch["largest_difference"]) == ("DIR", made.difference)
    assert made.difference < 1e-5


def test_the_wrapper_needs_mujoco_and_numpy_alone(tmp_path):
    _, made = exported(tmp_path, DOUBLE, WRAPPED["way"])
    code = (
        "import sys, robot_corrected as r; robot = r.Robot(); robot.step([1.0, 0.0]); robot.measured(); "
        "assert not [m for m in sys.modules if m.split('.')[0] in ('gpsim', 'scipy', 'pandas', 'gymnasium')]"
    )
    subprocess.run([sys.executable, "-c", code], cwd=made.files["model"].parent, check=True)


def test_what_does_nothing_leaves_the_model_as_it_is(tmp_path):
    plant, made = exported(tmp_path, DOUBLE, [])
    assert made.files["diff"].read_text() == ""
    assert not made.wrapped
    sent = commands(2, 1.0, DT)
    assert apart(replayed(plant, START, sent), native(made, START, sent, plant.substeps)) < 1e-5


def test_an_encoder_that_is_off_misleads_its_servo_and_whoever_reads_it(tmp_path):
    plant, made = exported(tmp_path, SERVO, [Term("joint_offset", "hinge", {"offset": 0.05})])
    assert made.effects[0]["where"] == "attribute and wrapper"
    start, sent = np.array([0.2, 0.0]), commands(1, 1.0, DT, size=0.8)
    assert apart(replayed(plant, start, sent), wrapped(made, start, sent)) < 1e-5


def test_commands_beyond_the_range_are_clamped_before_what_happens_to_them(tmp_path):
    plant, made = exported(
        tmp_path, SERVO, [Term("actuator_asymmetry", "servo", {"gain_positive": 1.3, "gain_negative": 0.9})]
    )
    start, sent = np.array([0.2, 0.0]), commands(1, 1.0, DT, size=3.0)
    want = replayed(plant, start, np.clip(sent, -1.0, 1.0))
    assert apart(want, wrapped(made, start, sent)) < 1e-5


def test_what_has_no_name_gets_the_one_that_gpsim_calls_it_by(tmp_path):
    text = DOUBLE.replace('<motor name="m2" joint="elbow"/>', "")
    for name in ("elbow", "lower", "m1"):
        text = text.replace(f'name="{name}" ', "")
    terms = [
        Term("viscous_friction", "joint1", {"damping": 0.04}),
        Term("stribeck_friction", "joint1", {"force": 0.03, "static_force": 0.06, "stribeck_velocity": 0.2}),
        Term("actuator_lag", "actuator0", {"time_constant": 0.03}),
        Term("parameter_offset", "body2.mass", {"ratio": 1.3}),
    ]
    plant, made = exported(tmp_path, text, terms)
    sent = commands(1, 1.0, DT)
    assert apart(replayed(plant, START, sent), wrapped(made, START, sent)) < 1e-4
    assert made.effects[0]["attributes"] == ["joint joint1: damping"]


def test_another_control_step_takes_the_models_step_with_it(tmp_path):
    terms = [
        Term("stribeck_friction", "elbow", {"force": 0.03, "static_force": 0.06, "stribeck_velocity": 0.2})
    ]
    plant, made = exported(tmp_path, DOUBLE, terms, dt=0.0085)  # five steps of 1.7 ms
    assert 'timestep="0.0017"' in made.files["model"].read_text()
    sent = commands(2, 1.0, 0.0085)
    assert apart(replayed(plant, START, sent), wrapped(made, START, sent)) < 1e-4


def test_a_free_body_with_includes_and_a_mesh_elsewhere(tmp_path):
    parts = tmp_path / "parts"
    parts.mkdir()
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.2]])
    (parts / "hull.obj").write_text(
        "".join("v {} {} {}\n".format(*p) for p in points) + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "leg.xml").write_text('<mujoco><asset><mesh name="hull" file="hull.obj"/></asset></mujoco>')
    text = FLOATING.replace("<mujoco>", '<mujoco><compiler meshdir="parts"/><include file="leg.xml"/>', 1)
    text = text.replace('<geom size=".1" mass="2"', '<geom type="mesh" mesh="hull" mass="2"')
    _, made = exported(tmp_path, text, [Term("coulomb_friction", "hip", {"force": 0.1})])
    model = mujoco.MjModel.from_xml_path(str(made.files["model"]))
    assert (model.nmesh, model.nq) == (1, 8)
    assert made.difference < 1e-5


def test_a_urdf_becomes_mjcf_with_the_motors_that_were_diagnosed(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(
        '<robot name="arm"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.4"/><mass value="1.2"/>'
        '<inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>'
    )
    terms = [
        Term("viscous_friction", "pivot", {"damping": 0.1}),
        Term("actuator_gain", "pivot_motor", {"gain": 0.8}),
    ]
    plant, correction = corrected(str(path), terms)
    made = export_model(correction, {}, {}, tmp_path / "arm_corrected.xml")
    start, sent = np.array([0.5, 0.0]), commands(1, 1.0, DT)
    assert apart(replayed(plant, start, sent), native(made, start, sent, plant.substeps)) < 1e-5


FUNCTION = '''import mujoco
TEXT = """{text}"""
def spec():
    return mujoco.MjSpec.from_string(TEXT)
def model():
    return mujoco.MjModel.from_xml_string(TEXT)
def bare():
    return mujoco.MjSpec.from_string(TEXT).compile()
'''


@pytest.mark.usefixtures("own_files")
@pytest.mark.parametrize("name", ["spec", "model"])
def test_a_function_that_returns_a_spec_or_reads_xml(name, tmp_path):
    (tmp_path / "mine.py").write_text(FUNCTION.format(text=DOUBLE.replace('"', "'")))
    plant, correction = corrected(f"{tmp_path / 'mine.py'}:{name}", NATIVE["viscous"])
    made = export_model(correction, {}, {}, tmp_path / "robot_corrected.xml")
    sent = commands(2, 1.0, DT)
    assert apart(replayed(plant, START, sent), native(made, START, sent, plant.substeps)) < 1e-5


def test_gymnasiums_own_model(tmp_path):
    terms = [
        Term("coulomb_friction", "hinge", {"force": 0.3}),
        Term("parameter_offset", "pole2.mass", {"ratio": 1.2}),
    ]
    plant, correction = corrected("gym:InvertedDoublePendulum-v5", terms, dt=0.05)
    made = export_model(correction, {}, {}, tmp_path / "robot_corrected.xml")
    start, sent = np.array([0.0, 0.0, 0.05, 0.0, -0.05, 0.0]), commands(1, 1.0, 0.05, size=0.1)
    assert apart(replayed(plant, start, sent), native(made, start, sent, plant.substeps)) < 1e-5


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("robot.urdf", "name it robot_corrected.xml"),
        ("my-robot.xml", "letters, digits and _"),
        ("no/robot_corrected.xml", "no such folder"),
        ("there.xml", "exists already"),
    ],
)
def test_where_it_cannot_go_nothing_is_written(name, said, tmp_path):
    _, correction = corrected(written(tmp_path, DOUBLE), NATIVE["coulomb"])
    (tmp_path / "there.py").write_text("mine")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(UsageError, match=said):
        export_model(correction, {}, {}, tmp_path / name)
    assert sorted(tmp_path.iterdir()) == before


def test_a_model_that_mujoco_has_forgotten_is_refused(tmp_path):
    (tmp_path / "mine.py").write_text(FUNCTION.format(text=DOUBLE.replace('"', "'")))
    _, correction = corrected(f"{tmp_path / 'mine.py'}:bare", NATIVE["coulomb"])
    mujoco.MjModel.from_xml_string(SLIDER)  # the last XML that MuJoCo read
    with pytest.raises(UsageError, match="return the mujoco.MjSpec instead"):
        export_model(correction, {}, {}, tmp_path / "robot_corrected.xml")
