"""Messages that name joints (sensor_msgs/JointState): listed, read and mapped by name, wherever the name stands."""

import numpy as np
import pytest
from bags import EPOCH, Messages, header, write_bag
from mjcf_models import DOUBLE, SERVO, written

from gpsim.errors import UsageError
from gpsim.recordings import open_log
from gpsim.stages.diagnose import Task, open_recording
from gpsim.stages.import_log import import_log
from gpsim.stages.raw_logs import RawLog, decide

JOINTS = "sensor_msgs/msg/JointState"
COUNT = 60


def row(k, late=0, **lists):
    receive = EPOCH + 20_000_000 * k + late
    return receive, {"header": header(receive), **lists}


def states(speeds=True, gripper=True):
    """Positions k, 10 + k; the names stand in another order in every second message."""
    rows = []
    for k in range(COUNT):
        said = {"shoulder": (0.001 * k, 0.05), "elbow": (1.0 - 0.002 * k, -0.1)}
        names = ["shoulder", "elbow"] if k % 2 else ["elbow", "shoulder"]
        names = ["gripper", *names] if gripper and k % 3 else names
        position = [said.get(name, (7.0, 7.0))[0] for name in names]
        velocity = [said.get(name, (7.0, 7.0))[1] for name in names] if speeds else []
        rows.append(row(k, name=names, position=position, velocity=velocity))
    return Messages(JOINTS, rows)


def asked(names=("m1", "m2"), key="effort"):
    rows = [
        row(k, 1_000_000, name=list(names), **{key: [0.1 * k, -0.1 * k][: len(names)]}) for k in range(COUNT)
    ]
    return Messages(JOINTS, rows)


def test_numbers_are_listed_and_read_by_the_names_beside_them(tmp_path):
    log = open_log(write_bag(tmp_path / "a.mcap", "mcap", {"/joint_states": states(speeds=False)}))
    (topic,) = log.topics()
    listed = [f for f in topic.fields if not f.startswith("header")]
    assert listed == [f"position[name={n}]" for n in ("elbow", "shoulder", "gripper")]
    wanted = ["position[name=elbow]", "position[name=gripper]", "position.0", "velocity[name=elbow]"]
    read = log.series({"/joint_states": wanted})["/joint_states"]
    assert read.fields["position[name=elbow]"] == pytest.approx(1.0 - 0.002 * np.arange(COUNT))
    assert (
        np.isnan(read.fields["position[name=gripper]"]).sum() == read.absent["position[name=gripper]"] == 20
    )
    assert read.fields["position.0"][0] == 1.0
    assert read.absent["velocity[name=elbow]"] == COUNT
    with pytest.raises(UsageError, match="name"):
        log.series({"/joint_states": ["position[nme=elbow]"]})


@pytest.mark.parametrize(("kind", "name"), [("ros1-bz2", "a.bag"), ("sqlite3", "a"), ("mcap-zstd", "a.mcap")])
def test_joints_and_actuators_map_by_name_at_once(kind, name, tmp_path):
    robot = written(tmp_path, DOUBLE)
    bag = write_bag(tmp_path / name, kind, {"/joint_states": states(), "/joint_commands": asked()})
    read = decide(RawLog(bag, "gpsim import", robot))
    assert read.raw["system"] == "mjcf"
    assert read.raw["state"]["elbow_dot"]["field"] == "velocity[name=elbow]"
    import_log([bag], tmp_path / "rec", raw=read.raw)
    recording, simulator = open_recording(Task(tmp_path / "rec", None))
    assert simulator.name == robot
    assert recording.state.names == ("shoulder", "shoulder_dot", "elbow", "elbow_dot")
    states_read = recording.episodes[0].states
    steps = np.diff(states_read[:, [0, 2]], axis=0)
    assert steps == pytest.approx(np.tile([0.001, -0.002], (len(steps), 1)), abs=1e-9)
    assert states_read[:, 1] == pytest.approx(0.05)
    actions = recording.episodes[0].actions
    assert actions[:, 1] == pytest.approx(-actions[:, 0])
    assert np.ptp(actions[:, 0]) > 4.0


def test_a_servo_is_commanded_by_its_joints_name_and_position(tmp_path):
    robot = written(tmp_path, SERVO)
    rows = [row(k, name=["hinge"], position=[0.01 * k]) for k in range(COUNT)]
    both = {"/joint_states": Messages(JOINTS, rows), "/arm/command": asked(["hinge"], "position")}
    read = decide(RawLog(write_bag(tmp_path / "a.mcap", "mcap", both), "gpsim import", robot))
    assert read.raw["state"]["hinge"]["topic"] == "/joint_states"
    assert read.raw["action"]["servo"] == {
        "topic": "/arm/command",
        "field": "position[name=hinge]",
        "unit": "rad",
    }


def test_motors_that_nobody_commands_take_the_efforts_that_were_measured(tmp_path):
    robot = written(tmp_path, DOUBLE)
    rows = [
        row(k, name=["shoulder", "elbow"], position=[0.01 * k, 0.0], effort=[0.1 * k, 0.2])
        for k in range(COUNT)
    ]
    read = decide(
        RawLog(
            write_bag(tmp_path / "a.mcap", "mcap", {"/joint_states": Messages(JOINTS, rows)}), "gpsim", robot
        )
    )
    assert read.raw["action"]["m1"] == {"field": "effort[name=shoulder]", "unit": "N m"}


def test_what_no_message_names_is_asked_for(tmp_path):
    robot = written(tmp_path, DOUBLE)
    bag = write_bag(tmp_path / "a.mcap", "mcap", {"/joint_states": states()})
    with pytest.raises(UsageError, match="assign the columns") as caught:
        decide(RawLog(bag, "gpsim import", robot))
    assert "\n" not in str(caught.value)
    assert "m1=COLUMN m2=COLUMN" in " ".join(caught.value.table)
    words = ("m1=velocity[name=shoulder]", "m2=none")
    read = decide(RawLog(bag, "gpsim import", robot, words=words))
    assert read.raw["action"]["m1"]["field"] == "velocity[name=shoulder]"
