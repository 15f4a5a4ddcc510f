"""What a model may be opened from, what a recording must hold, and what is refused: each in one line."""

import re

import numpy as np
import pandas as pd
import pytest
import yaml
from mjcf_models import DOUBLE, FLOATING, PENDULUM, SERVO, logged, written

from gpsim.errors import UsageError
from gpsim.mjcf import checked, declared, files_digest, is_mujoco, load_mjcf, open_simulator, source_of
from gpsim.recordings import read_recording
from gpsim.stages.diagnose import Task, open_recording

pytestmark = pytest.mark.usefixtures("own_files")

URDF = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/><origin xyz="0 0 -.3"/>
<inertia ixx=".02" iyy=".02" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="elbow" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="10" velocity="5"/></joint></robot>"""
FUNCTION = """import mujoco
XML = '''{}'''
def robot():
    return mujoco.MjModel.from_xml_string(XML)
def spec():
    return mujoco.MjSpec.from_string(XML)
def nothing():
    return 3
def unfinished():
    return mujoco.MjSpec.from_string(XML.replace("1.3", "-1"))
class System:
    pass
"""


def recorded(folder, columns, meta):
    """A recording of a swing of these columns, 40 rows."""
    rows = [",".join(["episode", "t", *columns])]
    for k in range(40):
        values = [columns[c] * np.sin(0.1 * k + i) for i, c in enumerate(columns)]
        rows.append(f"0,{0.02 * k:.3f}," + ",".join(f"{v:.6f}" for v in values))
    (folder / "recording.csv").write_text("\n".join(rows) + "\n")
    (folder / "recording.yaml").write_text(yaml.safe_dump({"system": "mjcf", "dt": 0.02, **meta}))
    return folder


PENDULUM_META = {"model": "robot.xml", "state": {"theta": "rad"}, "action": {"torque": "N m"}}


def test_a_urdf_gets_a_motor_a_joint(tmp_path):
    simulator = open_simulator(written(tmp_path, URDF, "robot.urdf"))
    assert simulator.state.names == ("elbow", "elbow_dot")
    assert simulator.action.names == ("elbow_motor",)


def test_a_function_gives_a_model_or_its_spec_and_a_class_is_no_model(tmp_path):
    file = written(tmp_path, FUNCTION.format(PENDULUM), "mine.py")
    for name in ("robot", "spec"):
        assert open_simulator(f"{file}:{name}").state.names == ("theta", "theta_dot")
    assert not is_mujoco(f"{file}:System")
    with pytest.raises(UsageError, match=r"nothing\(\) returned int; it must return a mujoco.MjModel"):
        open_simulator(f"{file}:nothing")
    with pytest.raises(UsageError, match=r"unfinished\(\) does not compile: Error: mass and inertia"):
        open_simulator(f"{file}:unfinished")


def test_a_gymnasium_environment_gives_its_model_and_control_step():
    simulator = open_simulator("gym:InvertedDoublePendulum-v5")
    assert simulator.state.names[::2] == ("slider", "hinge", "hinge2")
    assert simulator.control_step == pytest.approx(0.05)
    with pytest.raises(UsageError, match="CartPoleEnv is not based on MuJoCo; give its robot as robot.xml"):
        open_simulator("gym:CartPole-v1")
    with pytest.raises(UsageError, match="gymnasium cannot make it"):
        open_simulator("gym:Nowhere-v9")


def test_all_that_a_model_includes_is_hashed(tmp_path):
    (tmp_path / "parts").mkdir()
    inner = written(
        tmp_path / "parts", '<mujocoinclude><geom size=".1" mass="1"/></mujocoinclude>', "inner.xml"
    )
    outer = DOUBLE.replace(
        '<body name="lower" pos="0 0 -.5">',
        '<body name="lower" pos="0 0 -.5"><include file="parts/inner.xml"/>',
    )
    name = written(tmp_path, outer)
    before = files_digest(name)
    assert sorted(before) == ["parts/inner.xml", "robot.xml"]
    written(tmp_path / "parts", '<mujocoinclude><geom size=".1" mass="2"/></mujocoinclude>', "inner.xml")
    assert files_digest(name) != before
    assert load_mjcf(name).parameters["lower.mass"].default == pytest.approx(2.6)
    assert inner


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "<mujoco>\n<worldbody>\n</mujoco>",
            "robot.xml, line 2: does not compile: <worldbody> is not closed",
        ),
        (
            PENDULUM.replace('mass="1.3"', 'mass="-1"'),
            "robot.xml, line 2: does not compile: mass and inertia of moving bodies must be larger than mjMINVAL "
            "(in 'rod')",
        ),
        (
            PENDULUM.replace("<motor", "<mtor"),
            "robot.xml, line 4: does not compile: unrecognized element (in <mtor>)",
        ),
        (
            PENDULUM.replace("<worldbody>", '<asset><mesh name="m" file="no.stl"/></asset><worldbody>'),
            "robot.xml, line 1: does not compile: Error opening file 'no.stl'",
        ),
        (
            PENDULUM.replace("</worldbody>", '</worldbody>\n<keyframe>\n<key qpos="1 2 3"/></keyframe>'),
            "robot.xml, line 5: does not compile: keyframe '': invalid qpos size, expected 1, got 3",
        ),
        (
            PENDULUM.replace('type="hinge"', 'type="ball"').replace('axis="0 1 0"', ""),
            "theta is a ball joint",
        ),
        (
            PENDULUM.replace("<motor name", '<muscle lengthrange="0 1" name'),
            "has an activation that the commands do not determine",
        ),
        ("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", "it has no joint"),
    ],
)
def test_models_that_are_refused(text, said, tmp_path):
    with pytest.raises(UsageError) as caught:
        load_mjcf(written(tmp_path, text))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "robot.xml" in str(caught.value)


def test_a_recording_names_its_model_beside_it(tmp_path):
    written(tmp_path, PENDULUM)
    folder = recorded(tmp_path, {"torque": 1.0, "extra": 2.0, "theta": 0.5}, PENDULUM_META)
    recording, simulator = open_recording(Task(folder, None))
    assert recording.state.names == ("theta",)
    assert simulator.state.names == ("theta", "theta_dot")
    assert recording.state.wraps.tolist() == [True]
    assert read_recording(folder).model == "robot.xml"


def test_commands_beyond_their_range_never_reached_the_actuator(tmp_path):
    written(tmp_path, SERVO)
    meta = {"model": "robot.xml", "state": {"hinge": "rad"}, "action": {"servo": "rad"}}
    recording, _ = open_recording(Task(recorded(tmp_path, {"hinge": 0.5, "servo": 3.0}, meta), None))
    assert np.abs(recording.episodes[0].actions).max() == 1.0


def test_columns_may_stand_in_any_order(tmp_path):
    written(tmp_path, DOUBLE)
    columns = {"m2": 1.0, "elbow_dot": 0.3, "elbow": 0.2, "m1": 2.0, "shoulder": 0.1, "shoulder_dot": 0.4}
    state = {"elbow_dot": "rad/s", "elbow": "rad", "shoulder": "rad", "shoulder_dot": "rad/s"}
    meta = {"model": "robot.xml", "state": state, "action": {"m2": "N m", "m1": "N m"}}
    recording, simulator = open_recording(Task(recorded(tmp_path, columns, meta), None))
    assert recording.state.names == simulator.state.names
    assert recording.action.names == ("m1", "m2")
    assert np.abs(recording.episodes[0].states).max(axis=0) == pytest.approx([0.1, 0.4, 0.2, 0.3], rel=0.1)


@pytest.mark.parametrize(
    ("meta", "columns", "said"),
    [
        ({"state": {"elbow": "rad"}, "action": {"m1": "N m", "m2": "N m"}}, {"elbow": 1, "m1": 1, "m2": 1},
         "no column for the joint shoulder"),
        ({"state": {"x": "rad"}, "action": {"m1": "N m", "m2": "N m"}}, {"x": 1, "m1": 1, "m2": 1},
         "no column for the joints shoulder, elbow"),
        ({"state": {"elbow": "rad", "shoulder": "rad"}, "action": {"m1": "N m"}}, {"elbow": 1, "shoulder": 1, "m1": 1},
         "no column for the actuator m2"),
        ({"state": {"elbow": "rad"}, "model": 3}, {"elbow": 1}, "model: expected the file of a MuJoCo model"),
        ({"state": {"elbow": "rad"}, "model": "other.xml"}, {"elbow": 1}, "no file other.xml"),
        ({"state": {"elbow": "rad"}, "model": None}, {"elbow": 1}, "name it with --simulator robot.xml"),
    ],
)  # fmt: skip
def test_recordings_that_are_refused(meta, columns, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, DOUBLE)
    with pytest.raises(UsageError) as caught:
        open_recording(Task(recorded(tmp_path, columns, {"model": "robot.xml", **meta}), None))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_episode_that_begins_inside_something_is_refused(tmp_path):
    inside = PENDULUM.replace("<body name", '<geom name="wall" size=".2" pos="0 0 -.9"/><body name').replace(
        "</body></worldbody>", '<geom size=".2" pos="0 0 -.8" mass="0"/></body></worldbody>'
    )
    written(tmp_path, inside)
    with pytest.raises(UsageError, match=r"episode 0 starts with world and rod overlapping by 0"):
        open_recording(Task(recorded(tmp_path, {"theta": 0.01, "torque": 1.0}, PENDULUM_META), None))


def test_facts_of_a_model_and_of_equations(tmp_path):
    double = load_mjcf(written(tmp_path, DOUBLE))
    facts = declared(double)
    assert facts.coordinates == {"shoulder": "N m", "elbow": "N m"}
    assert facts.families["payload"] == ("upper", "lower")
    assert facts.parameters["lower.mass"] == (0.6, "kg")
    tried = checked(double, np.random.default_rng(0))
    assert tried.step == 0.002
    assert 0.0 < tried.energy_drift < 0.05
    coarse = load_mjcf(written(tmp_path, DOUBLE.replace('"0.002"', '"0.01"'), "coarse.xml"))
    assert checked(coarse, np.random.default_rng(0)).energy_drift > 2 * tried.energy_drift
    pairs = [{a, b} for a, b, _ in tried.confusable]
    assert {"lower.mass", "gravity"} not in pairs
    equations = declared(open_simulator("pendulum"))
    assert "payload" not in equations.families


def test_a_servos_gains_and_its_damping_are_told_to_be_alike(tmp_path):
    tried = checked(load_mjcf(written(tmp_path, SERVO)), np.random.default_rng(0))
    assert {"servo.kv", "viscous friction on hinge"} in [{a, b} for a, b, _ in tried.confusable]


def test_a_free_joint_is_named_in_full(tmp_path):
    floating = load_mjcf(written(tmp_path, FLOATING))
    assert floating.state.names[:7] == tuple(f"root.{c}" for c in ("x", "y", "z", "qw", "qx", "qy", "qz"))
    assert floating.state.names[7:13] == tuple(f"root.{c}" for c in ("vx", "vy", "vz", "wx", "wy", "wz"))
    assert [c.name for c in floating.coordinates] == ["hip"]
    assert source_of(floating.name).files


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('kp="40" kv="3"', 'kp="4e7" kv="3"'), "at the joint hinge; servo.kp = 4e+07 is too stiff for a step of 0.002 s"),
        (('kp="40" kv="3"', 'kp="40" kv="9e3"'), "at the joint hinge; servo.kv = 9000 is too stiff"),
        (('damping="0.1"', 'damping="0.1" stiffness="1e7"'), "the stiffness of hinge = 1e+07 is too stiff"),
    ],
)  # fmt: skip
def test_a_model_that_runs_away_is_told_with_its_parameter_and_step(change, said, tmp_path):
    unstable = SERVO.replace(*change).replace('integrator="implicitfast"', 'integrator="Euler"')
    written(tmp_path, unstable)
    meta = {"model": "robot.xml", "state": {"hinge": "rad"}, "action": {"servo": "rad"}}
    with pytest.raises(UsageError) as caught:
        open_recording(Task(recorded(tmp_path, {"hinge": 0.5, "servo": 0.3}, meta), None))
    assert said in str(caught.value)
    assert re.search(r"runs away: no number at step \d+ from t = 0 s of episode 0", str(caught.value))
    assert "\n" not in str(caught.value)


PARTS = ("x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz")
UNITS = ("m", "m", "m", "1", "1", "1", "1", "m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s")


def floating(folder, quaternion, leave_out=()):
    """A recording whose base turns; the quaternion's sign changes half way."""
    units = {f"root.{p}": u for p, u in zip(PARTS, UNITS, strict=True) if p not in leave_out}
    rows = []
    for k in range(40):
        q = np.array(quaternion(0.05 * k)) * (-1.0 if k >= 20 else 1.0)
        pose = dict(zip(PARTS, [0.01 * k, 0.0, 1.0, *q, 0.5, 0.0, 0.0, 0.0, 2.5, 0.0], strict=True))
        rows.append((0, 0.02 * k, 0.1, *(pose[n.partition(".")[2]] for n in units), 0.0))
    return logged(folder, FLOATING, rows, 0.02, {"hip": "rad"} | units, {"motor": "N m"})


def test_an_orientation_goes_the_shorter_way_round(tmp_path):
    folder = floating(tmp_path, lambda angle: (1.01 * np.cos(angle / 2), 0.0, 1.01 * np.sin(angle / 2), 0.0))
    recording, _ = open_recording(Task(folder, None))
    columns = [recording.state.index(f"root.{p}") for p in ("qw", "qx", "qy", "qz")]
    q = recording.episodes[0].states[:, columns]
    assert np.linalg.norm(q, axis=1) == pytest.approx(1.0)
    assert np.abs(np.diff(q, axis=0)).max() < 0.03


@pytest.mark.parametrize(
    ("quaternion", "leave_out", "said"),
    [
        (lambda angle: (0.0, 0.0, 0.0, 0.2), (), "root.qw, root.qx, root.qy, root.qz are not a quaternion"),
        (lambda angle: (1.0, 0.0, 0.0, 0.0), ("x", "qz"), "no column for the joints root.x, root.qz"),
    ],
)
def test_a_free_joint_needs_its_pose(quaternion, leave_out, said, tmp_path):
    with pytest.raises(UsageError) as caught:
        open_recording(Task(floating(tmp_path, quaternion, leave_out), None))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1))
FACES = "f 1 2 3\nf 2 4 3\nf 5 7 6\nf 6 7 8\nf 1 5 2\nf 2 5 6\nf 3 4 7\nf 4 8 7\nf 1 3 5\nf 3 7 5\nf 2 6 4\nf 4 6 8\n"


def test_meshes_beside_the_model_are_hashed(tmp_path):
    (tmp_path / "parts").mkdir()
    written(tmp_path / "parts", CUBE + FACES, "cube.obj")
    mesh = '<compiler meshdir="parts"/><asset><mesh name="cube" file="cube.obj"/></asset><worldbody>'
    own = '<geom type="mesh" mesh="cube" mass="0.1"/><inertial pos'
    name = written(tmp_path, PENDULUM.replace("<worldbody>", mesh).replace("<inertial pos", own))
    before = files_digest(name)
    assert sorted(before) == ["parts/cube.obj", "robot.xml"]
    assert load_mjcf(name).state.names == ("theta", "theta_dot")
    written(tmp_path / "parts", CUBE.replace("0.1", "0.2") + FACES, "cube.obj")
    assert files_digest(name) != before


def test_a_measured_torque_drives_the_motor_where_no_command_was_recorded(tmp_path):
    path = written(tmp_path, PENDULUM)
    meta = {**PENDULUM_META, "action": {"theta_tau": "N m"}}
    recording, simulator = open_recording(
        Task(recorded(tmp_path, {"theta": 1.0, "theta_tau": 0.5}, meta), path)
    )
    assert recording.action.names == simulator.action.names == ("torque",)
    assert recording.episodes[0].actions[5, 0] == pytest.approx(0.5 * np.sin(0.5 + 1), abs=1e-5)


def test_a_bare_table_may_hold_the_measured_torque_instead_of_the_command(tmp_path):
    path, t = written(tmp_path, PENDULUM), 0.01 * np.arange(50)
    table = pd.DataFrame({"t": t, "theta": 0.1 * np.sin(t), "theta_tau": np.cos(t)})
    table.to_csv(tmp_path / "log.csv", index=False)
    recording, _ = open_recording(Task(tmp_path / "log.csv", path))
    assert recording.action.names == ("torque",)
    assert recording.episodes[0].actions[5, 0] == pytest.approx(np.cos(0.05))


def test_a_measured_torque_is_no_target_of_a_servo(tmp_path):
    path = written(tmp_path, SERVO)
    simulator = open_simulator(path)
    joint, servo = simulator.coordinates[0].name, simulator.action.names[0]
    state = {c.name: simulator.state.units[c.name] for c in simulator.coordinates}
    columns = {**dict.fromkeys(state, 0.1), f"{joint}_tau": 0.5}
    meta = {"model": "robot.xml", "state": state, "action": {f"{joint}_tau": "N m"}}
    with pytest.raises(UsageError, match=f"no column for the actuator.* {servo}"):
        open_recording(Task(recorded(tmp_path, columns, meta), path))
