"""A ROS 1 node that drives a vehicle to a goal by an exported policy, under a monitor if wanted, or plays a plan."""

from __future__ import annotations

import ast
import inspect
from string import Template
from textwrap import dedent

from gpsim.effects import ActuatorLag, Law
from gpsim.errors import UsageError
from gpsim.policies.policy import Policy


def ros_node(
    policy: Policy, rate: float, goal_radius: float, goal: tuple[float, float], max_steps: int, floor: float
) -> str:
    """A ROS 1 node (Python) that drives to a goal with policy.onnx beside it, `rate` times a second.

    goal (x, y) [m], goal_radius [m], max_steps (commands) and floor [m], the edge of the square about the origin that
    it does not leave, are the defaults of its parameters: the policy's task.
    Raises UsageError for a policy that does not take a goal in the plane and give a velocity command.
    """
    if policy.bounds is None or policy.bounds.shape != (2, 2) or len(policy.scale) != 2:
        raise UsageError(
            "only policies that drive a vehicle to a goal have a ROS node; this one takes no goal in the plane"
        )
    return Template(_NODE).substitute(
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


_NODE = '''#!/usr/bin/env python3
"""Drive to a goal with the policy in policy.onnx beside this file, $rate times a second; or play a plan.

    rosrun YOUR_PACKAGE drive_to_goal.py _goal_x:=$goal_x _goal_y:=$goal_y
    rosrun YOUR_PACKAGE drive_to_goal.py _plan:=/home/me/plan/plan.csv

Reads a pose (geometry_msgs/PoseStamped) and writes velocity commands (geometry_msgs/Twist); ~pose_topic,
~command_topic, ~goal_x, ~goal_y [m] and ~goal_radius [m] are parameters. It stops at the goal or the plan's end, after
~max_steps commands of the policy, where x or y is beyond ~limit [m], and while no pose is newer than 0.3 s. Record both
topics to score the trip: gpsim evaluate experiment=limo deployed=BAG.

Where monitor.json lies beside it (gpsim export policy --monitor) it also stops where what is observed is no longer what
the simulator predicts. A plan goes where the recording never was, and is played without it.
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


class Driver:
    def __init__(self):
        plan = rospy.get_param("~plan", "")
        self.rows = rows_of(plan) if plan else None
        if not plan:
            import onnxruntime

            network = os.path.join(HERE, "policy.onnx")
            self.session = onnxruntime.InferenceSession(network, providers=["CPUExecutionProvider"])
        watched = os.path.join(HERE, "monitor.json")
        self.monitor = Monitor(watched) if os.path.exists(watched) and not plan else None
        self.goal = rospy.get_param("~goal_x", $goal_x), rospy.get_param("~goal_y", $goal_y)
        self.radius = rospy.get_param("~goal_radius", $goal_radius)
        self.left = len(self.rows) if plan else rospy.get_param("~max_steps", $max_steps)
        self.limit = rospy.get_param("~limit", $limit)
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

    def end(self, why):
        self.stop()
        rospy.signal_shutdown(why)

    def step(self, _event):
        if self.pose is None or (rospy.Time.now() - self.pose.header.stamp).to_sec() > 0.3:
            self.stop()
            if self.monitor is not None:
                self.monitor.rejoin()
            return
        x, y = self.pose.pose.position.x, self.pose.pose.position.y
        yaw = yaw_of(self.pose.pose.orientation)
        if not max(abs(x), abs(y)) <= self.limit:
            return self.end("limit passed")
        if self.rows is None and math.hypot(self.goal[0] - x, self.goal[1] - y) <= self.radius:
            return self.end("goal reached")
        if self.left == 0:
            return self.end("out of steps" if self.rows is None else "plan played")
        speed, turn = self.commanded(x, y, yaw)
        if self.monitor is not None and self.monitor.stops([x, y, yaw], [speed, turn]):
            return self.end("the simulator no longer predicts what the robot does")
        command = Twist()
        command.linear.x, command.angular.z = speed, turn
        self.publisher.publish(command)
        self.left -= 1

    def commanded(self, x, y, yaw):
        if self.rows is not None:
            return self.rows[-self.left]
        action = self.session.run(["action"], {"observation": observe(x, y, yaw, *self.goal)})[0][0]
        return float(action[0]), float(action[1])


if __name__ == "__main__":
    rospy.init_node("drive_to_goal")
    driver = Driver()
    rospy.Timer(rospy.Duration(DT), driver.step)
    rospy.spin()
'''
