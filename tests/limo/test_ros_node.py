"""The exported nodes, run with a rospy and an rclpy that are none: they watch as gpsim does, stop, and play plans."""

import json
import sys
import types
from contextlib import suppress
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


def module(monkeypatch, name, **content):
    """A module that is none."""
    made = types.ModuleType(name)
    vars(made).update(content)
    monkeypatch.setitem(sys.modules, name, made)


def twist():
    return SimpleNamespace(linear=SimpleNamespace(x=0.0), angular=SimpleNamespace(z=0.0))


@pytest.fixture(params=[1, 2], ids=["ROS 1", "ROS 2"])
def ros(request, monkeypatch):
    """The node's names, the parameters that it is given, what it published, and step(), which says why it ended."""
    parameters, sent, ended = {}, [], []
    module(monkeypatch, "geometry_msgs")
    module(monkeypatch, "geometry_msgs.msg", PoseStamped=object, Twist=twist)
    publisher = SimpleNamespace(publish=sent.append)
    if request.param == 1:
        module(
            monkeypatch, "rospy", get_param=lambda name, usual: parameters.get(name.removeprefix("~"), usual),
            Publisher=lambda *a, **k: publisher, Subscriber=lambda *a, **k: None, on_shutdown=lambda stop: None,
            signal_shutdown=ended.append, Time=SimpleNamespace(now=lambda: 0.0),
        )  # fmt: skip
    else:

        class Node:
            def __init__(self, name):
                self.name = name

            def declare_parameter(self, name, usual, descriptor):
                assert descriptor["dynamic_typing"]
                return SimpleNamespace(value=parameters.get(name, usual))

            def create_publisher(self, kind, topic, depth):
                return publisher

            def create_subscription(self, kind, topic, heard, qos):
                assert qos == "best effort"

            def create_timer(self, seconds, step):
                assert seconds == 0.1

            def get_clock(self):
                return SimpleNamespace(now=lambda: 0.0)

            def get_logger(self):
                return SimpleNamespace(info=ended.append)

            def destroy_node(self):
                sent.append("destroyed")

        def spin(driver):
            driver.remember(pose(0.0, 0.0, 0.3))
            while True:
                driver.step()

        module(
            monkeypatch, "rclpy", spin=spin, init=lambda **k: None, shutdown=lambda: sent.append("shut down")
        )
        module(monkeypatch, "rclpy.node", Node=Node)
        module(monkeypatch, "rclpy.qos", qos_profile_sensor_data="best effort")
        module(monkeypatch, "rclpy.signals", SignalHandlerOptions=SimpleNamespace(NO=0))
        module(monkeypatch, "rclpy.time", Time=SimpleNamespace(from_msg=lambda stamp: stamp))
        module(monkeypatch, "rcl_interfaces")
        module(monkeypatch, "rcl_interfaces.msg", ParameterDescriptor=dict)
    text = ros_node(POLICY, 10.0, 0.05, (0.5, -0.5), 50, 4.0, request.param)
    names = {"__file__": "/nowhere/node.py", "__name__": "node"}
    exec(compile(text, "node.py", "exec"), names)

    def step(driver):
        if request.param == 1:
            driver.step(None)
        else:
            with suppress(SystemExit):
                driver.step()

    return SimpleNamespace(
        names=names, driver=names["Driver"], parameters=parameters, sent=sent, ended=ended, step=step
    )


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
        return SimpleNamespace(to_sec=lambda: self.age, nanoseconds=1e9 * self.age)


@pytest.mark.parametrize("late", [True, False])
def test_the_node_watches_as_the_monitor_does_and_stops_where_it_does(ros, tmp_path, late):
    plant, rng = corrected_plant(late), np.random.default_rng(1)
    monitor = monitor_of(plant)
    (tmp_path / "monitor.json").write_text(json.dumps(facts_of(monitor)))
    own = ros.names["Monitor"](str(tmp_path / "monitor.json"))
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
    with pytest.raises(UsageError, match="one Gaussian process per rate"):
        facts_of(monitor_of(base))


PLAN = "t,v_cmd,w_cmd\n0.0,0.1,0.5\n0.1,0.2,-0.5\n0.2,0.3,0\n"


def test_the_node_plays_a_plan_within_its_limit(ros, tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text(PLAN)
    ros.parameters["plan"] = str(path)
    driver = ros.driver()
    driver.remember(pose(0.0, 0.0, 0.3))
    for _ in range(4):
        ros.step(driver)
    assert [(m.linear.x, m.angular.z) for m in ros.sent] == [(0.1, 0.5), (0.2, -0.5), (0.3, 0.0), (0.0, 0.0)]
    assert ros.ended == ["plan played"]
    driver = ros.driver()
    driver.remember(pose(2.5, 0.0, 0.0))
    ros.step(driver)
    assert ros.ended[-1] == "limit passed"
    driver = ros.driver()
    driver.remember(pose(0.0, 0.0, 0.0, age=1.0))
    ros.step(driver)
    assert (ros.sent[-1].linear.x, driver.trip.left) == (0.0, 3)  # it waits
    path.write_text("t,v_cmd,w_cmd\n0.0,0.1,0.5\n0.02,0.2,-0.5\n")
    with pytest.raises(ValueError, match="not 0.1 s apart"):
        ros.driver()


def test_the_node_drives_by_its_network_to_the_goal(ros, monkeypatch):
    """Straight ahead, to the left of it, and there."""
    seen = []

    class Session:
        def __init__(self, path, providers):
            assert path.endswith("policy.onnx")

        def run(self, names, inputs):
            seen.append(inputs["observation"][0])
            return [np.array([[0.25, -0.5]], np.float32)]

    module(monkeypatch, "onnxruntime", InferenceSession=Session)
    ros.parameters |= {"goal_x": 1, "goal_y": 0.0, "goal_radius": 0.2}
    driver = ros.driver()
    for x, y, yaw in ((0.0, 0.0, 0.0), (0.0, 0.0, -np.pi / 2), (0.9, 0.0, 0.0)):
        driver.remember(pose(x, y, yaw))
        ros.step(driver)
    np.testing.assert_allclose(seen, [[1.0, 0.0], [0.0, 1.0]], atol=1e-6)
    assert [(m.linear.x, m.angular.z) for m in ros.sent] == [(0.25, -0.5), (0.25, -0.5), (0.0, 0.0)]
    assert all(type(m.linear.x) is float for m in ros.sent)  # messages of ROS 2 take nothing else
    assert ros.ended == ["goal reached"]


def test_the_node_of_ros_2_stops_the_robot_and_shuts_down_at_its_end(ros, tmp_path, monkeypatch):
    if "main" not in ros.names:
        pytest.skip("ROS 1 ends by itself")
    path = tmp_path / "plan.csv"
    path.write_text(PLAN)
    ros.parameters["plan"] = str(path)
    monkeypatch.setattr("signal.signal", lambda number, handler: None)
    ros.names["main"]()
    *commands, last, destroyed, ended = ros.sent
    assert len(commands) == 4
    assert (last.linear.x, destroyed, ended) == (0.0, "destroyed", "shut down")


def test_the_node_refuses_a_plan_that_is_played_around_a_policy(ros, tmp_path, capsys):
    path = tmp_path / "plan.csv"
    path.write_text("t,v_cmd_dither,w_cmd_dither\n0.0,0.1,0.5\n0.1,0.2,-0.5\n")
    ros.parameters["plan"] = str(path)
    with pytest.raises(SystemExit) as ended:
        ros.driver()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert "gpsim collect --plan" in said
    assert said.count("\n") == 1
