"""A policy for a robot: its network as ONNX, and a short ROS node that plays it."""

from __future__ import annotations

from string import Template

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from gpsim import __version__
from gpsim.errors import UsageError
from gpsim.policies.policy import Policy

OPSET, IR_VERSION = 17, 8
"""Old enough for the runtimes that robots carry."""


def to_onnx(policy: Policy) -> bytes:
    """The policy's most probable action as an ONNX model: observation (batch, O) float32 -> action.

    Continuous policies give (batch, A) float32 in the units of the task, discrete ones (batch,) int64.
    """
    nodes, constants = [], []

    def constant(name: str, values: NDArray[np.float32]) -> str:
        constants.append(numpy_helper.from_array(np.ascontiguousarray(values, dtype=np.float32), name))
        return name

    nodes.append(helper.make_node("Div", ["observation", constant("scale", policy.scale)], ["scaled"]))
    last = "scaled"
    for layer in range(policy.layers):
        weight, bias = (policy.weights[f"layer.{layer}.{part}"] for part in ("weight", "bias"))
        if layer == policy.layers - 1 and policy.bounds is not None:
            mean = policy.bounds.shape[
                1
            ]  # the rows below are the spread, which the most probable action leaves out
            weight, bias = weight[:mean], bias[:mean]
        names = [last, constant(f"weight.{layer}", weight), constant(f"bias.{layer}", bias)]
        last = f"layer.{layer}"
        nodes.append(helper.make_node("Gemm", names, [last], transB=1))
        if layer < policy.layers - 1:
            kind = {"tanh": "Tanh", "relu": "Relu"}[policy.activation]
            nodes.append(helper.make_node(kind, [last], [f"hidden.{layer}"]))
            last = f"hidden.{layer}"
    if policy.bounds is None:
        nodes.append(helper.make_node("ArgMax", [last], ["action"], axis=1, keepdims=0))
        out = helper.make_tensor_value_info("action", TensorProto.INT64, ["batch"])
    else:
        low, high = policy.bounds
        nodes.append(helper.make_node("Tanh", [last], ["squashed"]))
        half = constant("half_range", 0.5 * (high - low))
        nodes.append(helper.make_node("Mul", ["squashed", half], ["stretched"]))
        nodes.append(
            helper.make_node("Add", ["stretched", constant("middle", 0.5 * (high + low))], ["action"])
        )
        out = helper.make_tensor_value_info("action", TensorProto.FLOAT, ["batch", len(low)])
    seen = helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["batch", len(policy.scale)])
    graph = helper.make_graph(nodes, "policy", [seen], [out], constants)
    model = helper.make_model(
        graph,
        producer_name="gpsim",
        producer_version=__version__,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
    )
    onnx.checker.check_model(model)
    content: bytes = model.SerializeToString(deterministic=True)
    return content


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
    )


_NODE = '''#!/usr/bin/env python3
"""Drive to a goal with the policy in policy.onnx beside this file, $rate times a second.

    rosrun YOUR_PACKAGE drive_to_goal.py _goal_x:=$goal_x _goal_y:=$goal_y

Reads a pose (geometry_msgs/PoseStamped) and writes velocity commands (geometry_msgs/Twist); ~pose_topic,
~command_topic, ~goal_x, ~goal_y [m] and ~goal_radius [m] are parameters. It stops at the goal, after ~max_steps
commands, where x or y is beyond ~limit [m], and while no pose is newer than 0.3 s. Record both topics to score the
trip: gpsim evaluate experiment=limo deployed=BAG.
Needs rospy, numpy and onnxruntime.
"""

import math
import os

import numpy as np
import onnxruntime
import rospy
from geometry_msgs.msg import PoseStamped, Twist

POLICY = os.path.join(os.path.dirname(os.path.abspath(__file__)), "policy.onnx")


def observe(x, y, yaw, goal_x, goal_y):
    """The goal in the robot's frame: ahead and to the left [m]."""
    dx, dy = goal_x - x, goal_y - y
    sin, cos = math.sin(yaw), math.cos(yaw)
    return np.array([[dx * cos + dy * sin, dy * cos - dx * sin]], dtype=np.float32)


def yaw_of(q):
    """Yaw [rad] of a quaternion message."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


class Driver:
    def __init__(self):
        self.session = onnxruntime.InferenceSession(POLICY, providers=["CPUExecutionProvider"])
        self.goal = rospy.get_param("~goal_x", $goal_x), rospy.get_param("~goal_y", $goal_y)
        self.radius = rospy.get_param("~goal_radius", $goal_radius)
        self.left = rospy.get_param("~max_steps", $max_steps)
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

    def step(self, _event):
        if self.pose is None or (rospy.Time.now() - self.pose.header.stamp).to_sec() > 0.3:
            self.stop()
            return
        at = self.pose.pose
        near = math.hypot(self.goal[0] - at.position.x, self.goal[1] - at.position.y) <= self.radius
        outside = not max(abs(at.position.x), abs(at.position.y)) <= self.limit
        if near or outside or self.left == 0:
            self.stop()
            rospy.signal_shutdown("goal reached" if near else "limit passed" if outside else "out of steps")
            return
        seen = observe(at.position.x, at.position.y, yaw_of(at.orientation), *self.goal)
        speed, turn = self.session.run(["action"], {"observation": seen})[0][0]
        command = Twist()
        command.linear.x, command.angular.z = float(speed), float(turn)
        self.publisher.publish(command)
        self.left -= 1


if __name__ == "__main__":
    rospy.init_node("drive_to_goal")
    driver = Driver()
    rospy.Timer(rospy.Duration(1.0 / $rate), driver.step)
    rospy.spin()
'''
