"""The robot in the report: what is told at which joint, and that it is drawn with OpenGL and without."""

from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest
from made_diagnoses import made_diagnosis, made_effect, made_location
from mjcf_models import DOUBLE, FLOATING, LINK, PENDULUM, SKID, written

from gpsim.findings import Share
from gpsim.mjcf import open_simulator
from gpsim.reports.robot_figure import NOWHERE, SCALE, robot_figure, told_at

pytest.importorskip("mujoco")
pytestmark = pytest.mark.pictures
RED = np.array(SCALE(1.0)[:3])


def effect(family, on, share, **changes):
    return made_effect(family=family, on=on, importance=Share(share), **changes)


def diagnosed(*effects):
    return made_diagnosis(verdict="named", effects=effects)


FRICTION = diagnosed(effect("coulomb_friction", "elbow", 0.9))


@pytest.fixture
def double(tmp_path):
    return open_simulator(written(tmp_path, DOUBLE))


def pixels(picture, tmp_path):
    """(H, W, 3) in [0, 1]."""
    path = tmp_path / "picture.png"
    path.write_bytes(picture.png)
    return matplotlib.image.imread(path)[..., :3]


def near(image, colour):
    """Where a picture has a colour, whatever the light."""
    hue = image / np.maximum(image.max(axis=2, keepdims=True), 1e-9)
    return (np.abs(hue - colour / colour.max()).max(axis=2) < 0.12) & (image.max(axis=2) > 0.2)


def test_what_is_told_of_actuators_bodies_and_speeds_is_told_at_their_joints(double):
    found = diagnosed(
        effect("coulomb_friction", "elbow", 0.5),
        effect("actuator_gain", "m1", 0.1, site="actuator"),
        effect("payload", "lower", 0.2),
        effect("parameter_offset", "lower.mass", 0.04),
        effect("sensor_bias", "shoulder_dot", 0.05, site="sensor"),
        effect("gravity_tilt", "gravity", 0.02),
        effect("actuator_delay", ("m1", "m2"), 0.08, site="actuator", role="slight"),
    )
    shares = {joint: sum(laws.values()) for joint, laws in told_at(found, double).items()}
    assert shares == pytest.approx({"elbow": 0.78, "shoulder": 0.19, NOWHERE: 0.02})


def test_contacts_are_told_at_the_joint_that_moves_the_geom_and_ground_at_none(tmp_path):
    skid = open_simulator(written(tmp_path, SKID.format(floor=1, sole=1)))
    found = diagnosed(
        effect("parameter_offset", "sole.friction", 0.6), effect("parameter_offset", "floor.solref", 0.2)
    )
    assert {joint: sum(laws.values()) for joint, laws in told_at(found, skid).items()} == {
        "z": 0.6,
        NOWHERE: 0.2,
    }


def test_where_no_effect_is_told_rates_say_how_much_of_their_error_is_no_noise(double):
    found = made_diagnosis(verdict="unknown", location=made_location(channels={"elbow_acc": 0.7}))
    assert told_at(found, double) == {"elbow": {"beyond the noise": 0.7}}
    picture = robot_figure(found, double, np.zeros((3, 4)))
    assert "joint's error is no noise" in picture.caption


def test_of_a_robot_of_which_nothing_is_told_there_is_no_picture(double):
    assert robot_figure(made_diagnosis(), double, np.zeros((3, 4))) is None


@pytest.mark.parametrize("way", ["", "off"])
def test_the_forearm_alone_has_the_colour_of_its_joint(double, tmp_path, monkeypatch, way):
    """Bent at a right angle, the upper arm down and the forearm level: seen along the joints' axes."""
    if way:
        monkeypatch.setenv("MUJOCO_GL", way)
    states = np.tile([0.0, 0.0, np.pi / 2, 0.0], (5, 1))
    picture = robot_figure(FRICTION, double, states)
    assert picture.shows == ["shoulder", "elbow"]
    image = pixels(picture, tmp_path)
    robot = near(image, RED)[: int(0.8 * len(image)), : int(0.45 * image.shape[1])]  # not scale nor list
    rows, columns = np.nonzero(robot)
    assert len(rows) > 200
    assert np.ptp(columns) > 3 * np.ptp(rows)


def test_equal_diagnoses_give_equal_bytes_and_nothing_on_stderr(double, capfd):
    states = np.random.default_rng(0).normal(size=(50, 4))
    assert robot_figure(FRICTION, double, states).png == robot_figure(FRICTION, double, states).png
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("way", ["", "off"])
@pytest.mark.parametrize(
    "text",
    [PENDULUM, FLOATING, DOUBLE.replace("<worldbody>", '<worldbody><geom type="plane" size="1 1 1"/>')],
)
def test_models_without_shapes_afloat_and_on_the_ground_are_drawn(tmp_path, monkeypatch, text, way):
    if way:
        monkeypatch.setenv("MUJOCO_GL", way)
    simulator = open_simulator(written(tmp_path, text))
    joint = simulator.coordinates[0].name
    states = np.tile(simulator.rest_state, (4, 1))
    image = pixels(robot_figure(diagnosed(effect("spring", joint, 0.5)), simulator, states), tmp_path)
    assert near(image, RED)[: int(0.8 * len(image)), : int(0.45 * image.shape[1])].sum() > 200


def test_more_joints_than_have_room_and_none_with_a_share(tmp_path):
    joints = [f"joint_with_a_long_name_{k}" for k in range(15)]
    body = ""
    for name in reversed(joints):
        body = f'<body pos="0 0 -.1"><joint name="{name}" axis="0 1 0"/>{LINK.format(0.1, 0.1)}{body}</body>'
    simulator = open_simulator(written(tmp_path, f"<mujoco><worldbody>{body}</worldbody></mujoco>"))
    effects = [replace(effect("spring", name, 0.0), importance=None) for name in joints]
    assert robot_figure(diagnosed(*effects), simulator, np.zeros((2, 30))).shows == joints
