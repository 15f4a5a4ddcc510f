"""Nodes of ROS 1 and 2 that drive a vehicle to a goal by an exported policy, under a monitor, or play a plan."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Mapping
from string import Template
from textwrap import dedent
from typing import Literal

from gpsim.effects import ActuatorLag, Law
from gpsim.errors import UsageError
from gpsim.policies.policy import Policy


def ros_node(
    policy: Policy,
    rate: float,
    goal_radius: float,
    goal: tuple[float, float],
    max_steps: int,
    floor: float,
    ros: Literal[1, 2] = 1,
) -> str:
    """A node (Python) of ROS 1 or 2 that drives to a goal with policy.onnx beside it, `rate` times a second.

    goal (x, y) [m], goal_radius [m], max_steps (commands) and floor [m], the edge of the square about the origin that
    it does not leave, are the defaults of its parameters: the policy's task.
    Raises UsageError for a policy that does not take a goal in the plane and give a velocity command.
    """
    if policy.bounds is None or policy.bounds.shape != (2, 2) or len(policy.scale) != 2:
        raise UsageError(
            "only policies that drive a vehicle to a goal have a ROS node; this one has no goal in the plane"
        )
    return Template(_NODES[ros]).substitute(
        rate=f"{rate:g}",
        goal_radius=f"{goal_radius:g}",
        goal_x=f"{goal[0]:g}",
        goal_y=f"{goal[1]:g}",
        max_steps=max_steps,
        limit=f"{floor / 2.0:g}",
        law=_source(ActuatorLag.law, "lagged"),
    )


def _source(law: Law, name: str) -> str:
    """The text of a law under another name: a node has the catalogue's own."""
    (function,) = ast.parse(dedent(inspect.getsource(law))).body
    assert isinstance(function, ast.FunctionDef)
    function.name, function.decorator_list, function.returns = name, [], None
    for argument in function.args.args:
        argument.annotation = None
    return ast.unparse(function)


_COMMON = '''
HERE = os.path.dirname(os.path.abspath(__file__))
DT = 1.0 / $rate


def observe(x, y, yaw, goal_x, goal_y):
    """The goal in the robot's frame: ahead and to the left [m]."""
    dx, dy = goal_x - x, goal_y - y
    sin, cos = math.sin(yaw), math.cos(yaw)
    return np.array([[dx * cos + dy * sin, dy * cos - dx * sin]], dtype=np.float32)


def yaw_of(q):
    """Yaw [rad] of a quaternion message."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def turned(angle):
    """Between -pi and pi."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


$law


class Monitor:
    """A sequential test of predicted against observed poses, one a command (an e-detector)."""

    def __init__(self, path):
        with open(path) as file:
            self.facts = json.load(file)
        gp = self.facts["gp"]
        self.shift, self.linear, self.weights = (np.array(gp[key]) for key in ("shift", "linear", "weights"))
        self.bets, self.scale = np.array(self.facts["bets"]), np.array(self.facts["scale"])
        self.capital = np.zeros(len(self.bets))
        self.rejoin()

    def rejoin(self):
        """After a gap: nothing is known of the pose or the commands before."""
        self.at, self.sent, self.level = None, None, [0.0, 0.0]

    def stops(self, pose, command):
        """Whether to stop at this pose [x, y, yaw]; command: the one to be sent now."""
        alarm = False
        if self.at is not None:
            error = np.subtract(pose, self.predicted())
            error[2] = turned(error[2])
            score = np.minimum((error / self.scale) ** 2, self.facts["cap"]).mean()
            growth = 1.0 + self.bets * (score / self.facts["usual"] - 1.0)
            self.capital = np.minimum(np.maximum(self.capital, 1.0) * growth, 1e300)
            alarm = not self.capital.mean() < self.facts["threshold"]
        self.at = pose
        if self.sent is None:
            held = int(max(self.facts["delay"]) // DT) + 2 if self.facts["delay"] else 1
            self.sent = [[0.0, 0.0]] * held
        self.sent = [list(command)] + self.sent[:-1]
        return alarm

    def predicted(self):
        """The pose a control step later: the commanded twist and what the Gaussian processes add, held."""
        arrived = self.arrived()
        values = np.array(list(self.at) + arrived)
        inputs = []
        for column, function, wraps in self.facts["gp"]["inputs"]:
            value = turned(values[column]) if wraps else values[column]
            inputs.append({"": lambda v: v, "sign": np.sign, "sin": np.sin, "cos": np.cos}[function](value))
        u = np.array(inputs) - self.shift
        forms = self.linear @ np.concatenate([u, u * u, [1.0]])
        count = self.weights.shape[1]
        extra = self.weights @ np.exp(np.maximum(forms[:count], -300.0)) + forms[count:]
        v, lateral, w = extra + [arrived[0], 0.0, arrived[1]]
        x, y, yaw = self.at
        if self.facts["integrator"] == "euler":
            along, across, middle = DT, 0.0, yaw
        else:  # the arc, which the finer schemes come to
            half = 0.5 * w * DT
            along, across, middle = DT * np.sinc(half / math.pi), 0.0, yaw + half
        sin, cos = math.sin(middle), math.cos(middle)
        return np.array([x + along * (v * cos - lateral * sin), y + along * (v * sin + lateral * cos), yaw + w * DT])

    def arrived(self):
        """What reaches the wheels of the commands: each late, and through a lag."""
        out = list(self.sent[0])
        for i, (delay, lag) in enumerate(zip(self.facts["delay"], self.facts["lag"])):
            whole = int(delay // DT)
            late, total = delay - whole * DT, 0.0
            for command, time in ((self.sent[whole + 1][i], late), (self.sent[whole][i], DT - late)):
                if time > 0.0:
                    mean, self.level[i] = lagged(command, time, self.level[i], lag)
                    total += mean * time
            out[i] = total / DT
        return out


def rows_of(path):
    """Speed and turn rate of every row of a plan; it has to be made for this rate."""
    with open(path) as file:
        rows = list(csv.DictReader(file))
    if len(rows) > 1 and abs(float(rows[1]["t"]) - float(rows[0]["t"]) - DT) > 1e-6:
        raise ValueError("%s: its commands are not %g s apart" % (path, DT))
    if rows and "v_cmd" not in rows[0]:
        print("%s: has no v_cmd; a plan around a policy is played by gpsim collect --plan" % path, file=sys.stderr)
        sys.exit(2)
    return [(float(row["v_cmd"]), float(row["w_cmd"])) for row in rows]


class Trip:
    """What to command at each pose: of the policy, which a monitor may watch, or of a plan."""

    def __init__(self, plan, goal, radius, max_steps, limit):
        self.rows = rows_of(plan) if plan else None
        if not plan:
            import onnxruntime

            network = os.path.join(HERE, "policy.onnx")
            self.session = onnxruntime.InferenceSession(network, providers=["CPUExecutionProvider"])
        watched = os.path.join(HERE, "monitor.json")
        self.monitor = Monitor(watched) if os.path.exists(watched) and not plan else None
        self.goal, self.radius, self.limit = goal, radius, limit
        self.left = len(self.rows) if plan else max_steps

    def waits(self):
        """No pose is new."""
        if self.monitor is not None:
            self.monitor.rejoin()

    def command(self, pose):
        """(speed, turn rate) and no word, or None and why the trip ends; pose: of a message."""
        x, y, yaw = pose.position.x, pose.position.y, yaw_of(pose.orientation)
        if not max(abs(x), abs(y)) <= self.limit:
            return None, "limit passed"
        if self.rows is None and math.hypot(self.goal[0] - x, self.goal[1] - y) <= self.radius:
            return None, "goal reached"
        if self.left == 0:
            return None, "out of steps" if self.rows is None else "plan played"
        speed, turn = self.commanded(x, y, yaw)
        if self.monitor is not None and self.monitor.stops([x, y, yaw], [speed, turn]):
            return None, "the simulator no longer predicts what the robot does"
        self.left -= 1
        return (speed, turn), ""

    def commanded(self, x, y, yaw):
        if self.rows is not None:
            return self.rows[-self.left]
        action = self.session.run(["action"], {"observation": observe(x, y, yaw, *self.goal)})[0][0]
        return float(action[0]), float(action[1])
'''
_SAYS = """
With monitor.json beside it (gpsim export policy --monitor), it also stops when the observations no longer match the
simulator. A plan leaves the range of the recording, so it is played without the monitor.
"""
_ROS_1 = '''#!/usr/bin/env python3
"""Drive to a goal with the policy in policy.onnx beside this file, $rate times a second; or play a plan. For ROS 1.

    rosrun YOUR_PACKAGE drive_to_goal.py _goal_x:=$goal_x _goal_y:=$goal_y
    rosrun YOUR_PACKAGE drive_to_goal.py _plan:=/home/me/plan/plan.csv

Reads a pose (geometry_msgs/PoseStamped) and writes velocity commands (geometry_msgs/Twist); ~pose_topic,
~command_topic, ~goal_x, ~goal_y [m] and ~goal_radius [m] are parameters. It stops at the goal or the plan's end, after
~max_steps commands of the policy, where x or y is beyond ~limit [m], and while no pose is newer than 0.3 s. Record both
topics to score the trip: gpsim evaluate experiment=limo deployed=BAG.
$says
Needs rospy and numpy, and onnxruntime for the policy.
"""

import csv
import json
import math
import os
import sys

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, Twist

$common

class Driver:
    def __init__(self):
        goal = rospy.get_param("~goal_x", $goal_x), rospy.get_param("~goal_y", $goal_y)
        radius, limit = rospy.get_param("~goal_radius", $goal_radius), rospy.get_param("~limit", $limit)
        most = rospy.get_param("~max_steps", $max_steps)
        self.trip = Trip(rospy.get_param("~plan", ""), goal, radius, most, limit)
        self.pose = None
        command = rospy.get_param("~command_topic", "/cmd_vel")
        self.publisher = rospy.Publisher(command, Twist, queue_size=1)
        topic = rospy.get_param("~pose_topic", "/vrpn_client_node/limo/pose")
        rospy.Subscriber(topic, PoseStamped, self.remember, queue_size=1)
        rospy.on_shutdown(self.stop)

    def remember(self, message):
        self.pose = message

    def stop(self):
        self.publisher.publish(Twist())

    def step(self, _event):
        if self.pose is None or (rospy.Time.now() - self.pose.header.stamp).to_sec() > 0.3:
            self.stop()
            return self.trip.waits()
        sent, why = self.trip.command(self.pose.pose)
        if sent is None:
            self.stop()
            return rospy.signal_shutdown(why)
        command = Twist()
        command.linear.x, command.angular.z = sent
        self.publisher.publish(command)


if __name__ == "__main__":
    rospy.init_node("drive_to_goal")
    driver = Driver()
    rospy.Timer(rospy.Duration(DT), driver.step)
    rospy.spin()
'''
_ROS_2 = '''#!/usr/bin/env python3
"""Drive to a goal with the policy in policy.onnx beside this file, $rate times a second; or play a plan. For ROS 2.

    python3 drive_to_goal_ros2.py --ros-args -p goal_x:=$goal_x -p goal_y:=$goal_y
    python3 drive_to_goal_ros2.py --ros-args -p plan:=/home/me/plan/plan.csv

Reads a pose (geometry_msgs/msg/PoseStamped) and writes velocity commands (geometry_msgs/msg/Twist); pose_topic,
command_topic, goal_x, goal_y [m] and goal_radius [m] are parameters. It stops at the goal or the plan's end, after
max_steps commands of the policy, where x or y is beyond limit [m], and while no pose is newer than 0.3 s. Record both
topics to score the trip: gpsim evaluate experiment=limo deployed=BAG.
$says
Needs rclpy (Humble or newer) and numpy, and onnxruntime for the policy.
"""

import csv
import json
import math
import os
import signal
import sys

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time

$common

class Driver(Node):
    def __init__(self):
        super().__init__("drive_to_goal")
        goal = self.given("goal_x", $goal_x), self.given("goal_y", $goal_y)
        radius, limit = self.given("goal_radius", $goal_radius), self.given("limit", $limit)
        self.trip = Trip(self.given("plan", ""), goal, radius, self.given("max_steps", $max_steps), limit)
        self.pose = None
        self.publisher = self.create_publisher(Twist, self.given("command_topic", "/cmd_vel"), 1)
        topic = self.given("pose_topic", "/vrpn_mocap/limo/pose")
        self.create_subscription(PoseStamped, topic, self.remember, qos_profile_sensor_data)
        self.create_timer(DT, self.step)

    def given(self, name, usual):
        # A number is one with and without its decimal point.
        return self.declare_parameter(name, usual, ParameterDescriptor(dynamic_typing=True)).value

    def remember(self, message):
        self.pose = message

    def stop(self):
        self.publisher.publish(Twist())

    def step(self):
        late = None if self.pose is None else self.get_clock().now() - Time.from_msg(self.pose.header.stamp)
        if late is None or late.nanoseconds > 0.3e9:
            self.stop()
            return self.trip.waits()
        sent, why = self.trip.command(self.pose.pose)
        if sent is None:
            self.stop()
            self.get_logger().info(why)
            raise SystemExit(0)
        command = Twist()
        command.linear.x, command.angular.z = map(float, sent)
        self.publisher.publish(command)


def main():
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # whatever ends it, the last command is to stop
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    driver = Driver()
    try:
        rclpy.spin(driver)
    except (KeyboardInterrupt, SystemExit):
        pass
    finally:
        driver.stop()
        driver.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
'''
_NODES: Mapping[int, str] = {
    ros: text.replace("$common", _COMMON.strip("\n") + "\n").replace("$says", _SAYS.rstrip("\n"))
    for ros, text in ((1, _ROS_1), (2, _ROS_2))
}
