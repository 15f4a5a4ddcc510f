"""The exported ROS node, run with a rospy that is none: it watches as gpsim does, stops, and plays plans."""

import json
import sys
import types
from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.channels import wrap_angle
from gpsim.corrected import CommandFilter, CorrectedPlant, Features, GpCorrection
from gpsim.errors import UsageError
from gpsim.evaluation import Monitor, MonitorSettings, Usual
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.policies import Policy
from gpsim.policies.ros_node import ros_node
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.stages.export import facts_of

UNICYCLE = make_simulator("unicycle")
POLICY = Policy({}, np.ones(2, np.float32), np.array([[0.0, -1.0], [0.5, 1.0]], np.float32))
NODE = ros_node(POLICY, 10.0, 0.05, (0.5, -0.5), 50, 4.0)


def corrected_plant(late=True):
    """What a drive has taught: the car is slower than it is told, more so in curves, and late."""
    rng = np.random.default_rng(0)
    inputs = rng.uniform([0.0, -1.0, -1.0, -1.0], [0.5, 1.0, 1.0, 1.0], (60, 4))
    targets = np.stack([-0.2 * inputs[:, 0], 0.02 * inputs[:, 1], 0.1 * np.sin(inputs[:, 2])], axis=1)
    gps = fit_outputs(
        inputs, targets + 1e-3 * rng.standard_normal(targets.shape), FitSettings(restarts=1), rng
    )
    features = Features.of(["v_cmd", "w_cmd", "sin(yaw)", "cos(yaw)"], UNICYCLE.state + UNICYCLE.action)
    correction = GpCorrection(Predictor(gps), features, "mean", sample_noise=False)
    filter_ = CommandFilter((0.13, 0.02), (0.05, 0.2), 0.1) if late else None
    return CorrectedPlant(UNICYCLE, {}, "euler", 0.1, correction, filter_)


def monitor_of(plant):
    usual = Usual(np.array([0.003, 0.003, 0.01]), 1.5, 100)
    return Monitor(plant, usual, MonitorSettings(), plant.state, np.random.default_rng(0))


@pytest.fixture
def node(monkeypatch):
    """The node's names; parameters, what it published and why it ended are attributes of its rospy."""
    rospy = types.ModuleType("rospy")
    rospy.parameters, rospy.sent, rospy.ended = {}, [], []
    rospy.get_param = lambda name, default: rospy.parameters.get(name, default)
    rospy.Publisher = lambda *a, **k: SimpleNamespace(publish=rospy.sent.append)
    rospy.Subscriber = rospy.on_shutdown = lambda *a, **k: None
    rospy.signal_shutdown = rospy.ended.append
    rospy.Time = SimpleNamespace(now=lambda: 0.0)
    messages = types.ModuleType("geometry_msgs.msg")
    messages.PoseStamped = object
    messages.Twist = lambda: SimpleNamespace(linear=SimpleNamespace(x=0.0), angular=SimpleNamespace(z=0.0))
    monkeypatch.setitem(sys.modules, "rospy", rospy)
    monkeypatch.setitem(sys.modules, "geometry_msgs", types.ModuleType("geometry_msgs"))
    monkeypatch.setitem(sys.modules, "geometry_msgs.msg", messages)
    names = {"__file__": "/nowhere/drive_to_goal.py", "__name__": "drive_to_goal"}
    exec(compile(NODE, "drive_to_goal.py", "exec"), names)
    return names


def pose(x, y, yaw, age=0.0):
    """A message that is so many seconds old."""
    header = SimpleNamespace(stamp=Stamp(age))
    at = SimpleNamespace(
        position=SimpleNamespace(x=x, y=y),
        orientation=SimpleNamespace(x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2)),
    )
    return SimpleNamespace(header=header, pose=at)


class Stamp:
    """now - stamp is how old a message is."""

    def __init__(self, age):
        self.age = age

    def __rsub__(self, now):
        return SimpleNamespace(to_sec=lambda: self.age)


@pytest.mark.parametrize("late", [True, False])
def test_the_node_watches_as_the_monitor_does_and_stops_where_it_does(node, tmp_path, late):
    plant, rng = corrected_plant(late), np.random.default_rng(1)
    monitor = monitor_of(plant)
    (tmp_path / "monitor.json").write_text(json.dumps(facts_of(monitor)))
    own = node["Monitor"](str(tmp_path / "monitor.json"))
    commands = np.column_stack([rng.uniform(0.1, 0.5, 60), np.repeat(rng.uniform(-1, 1, 6), 10)])
    state, memory = np.array([[0.1, -0.2, 3.0]]), plant.begin(1, rng)
    slower = SimulatorPlant(UNICYCLE, {}, "euler", 0.1)
    measured = state.copy()
    monitor.begin(measured)
    assert not own.stops(list(measured[0]), commands[0])
    stopped = []
    for k, command in enumerate(commands[:-1]):
        if k < 40:
            state = plant.step(state, command[None], memory, rng)
        else:  # somebody holds it
            state = slower.step(state, 0.2 * command[None], {}, rng)
        measured = state + rng.normal(0, 0.001, (1, 3))
        measured[:, 2] = wrap_angle(measured[:, 2])
        stopped.append(
            (bool(monitor.observe(command[None], measured)[0]), own.stops(list(measured[0]), commands[k + 1]))
        )
        np.testing.assert_allclose(own.capital, monitor.capital[0], rtol=1e-6)
    assert [a for a, _ in stopped] == [b for _, b in stopped]
    assert not any(a for a, _ in stopped[:40])
    assert stopped[-1][0]


def test_what_a_node_cannot_predict_with_is_one_line():
    base = SimulatorPlant(UNICYCLE, {}, "euler", 0.1)
    with pytest.raises(UsageError, match="one Gaussian process a rate"):
        facts_of(monitor_of(base))


def test_the_node_plays_a_plan_within_its_limit(node, tmp_path):
    rospy = sys.modules["rospy"]
    path = tmp_path / "plan.csv"
    path.write_text("t,v_cmd,w_cmd\n0.0,0.1,0.5\n0.1,0.2,-0.5\n0.2,0.3,0\n")
    rospy.parameters["~plan"] = str(path)
    driver = node["Driver"]()
    driver.remember(pose(0.0, 0.0, 0.3))
    for _ in range(4):
        driver.step(None)
    assert [(m.linear.x, m.angular.z) for m in rospy.sent] == [
        (0.1, 0.5),
        (0.2, -0.5),
        (0.3, 0.0),
        (0.0, 0.0),
    ]
    assert rospy.ended == ["plan played"]
    driver = node["Driver"]()
    driver.remember(pose(2.5, 0.0, 0.0))
    driver.step(None)
    assert rospy.ended[-1] == "limit passed"
    driver = node["Driver"]()
    driver.remember(pose(0.0, 0.0, 0.0, age=1.0))
    driver.step(None)
    assert (rospy.sent[-1].linear.x, driver.left) == (0.0, 3)  # it waits
    path.write_text("t,v_cmd,w_cmd\n0.0,0.1,0.5\n0.02,0.2,-0.5\n")
    with pytest.raises(ValueError, match="not 0.1 s apart"):
        node["Driver"]()


def test_the_node_refuses_a_plan_that_is_played_around_a_policy(node, tmp_path, capsys):
    path = tmp_path / "plan.csv"
    path.write_text("t,v_cmd_dither,w_cmd_dither\n0.0,0.1,0.5\n0.1,0.2,-0.5\n")
    sys.modules["rospy"].parameters["~plan"] = str(path)
    with pytest.raises(SystemExit) as ended:
        node["Driver"]()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert "gpsim collect --plan" in said
    assert said.count("\n") == 1
