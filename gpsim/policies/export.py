"""A policy for a robot: its network as ONNX, and nodes of ROS 1 and 2 that drive to a goal by it or play a plan."""

from __future__ import annotations

import ast
import inspect
from importlib import resources
from textwrap import dedent
from typing import Literal

import numpy as np
import onnx
from jinja2 import StrictUndefined, Template
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from gpsim import __version__
from gpsim.effects import ActuatorLag, Law
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
    text = (resources.files("gpsim.policies") / "drive_to_goal.py.jinja").read_text(encoding="utf-8")
    node = Template(text, undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True)
    numbers = {
        "rate": rate,
        "goal_radius": goal_radius,
        "limit": floor / 2.0,
        "goal_x": goal[0],
        "goal_y": goal[1],
    }
    defaults = {name: f"{value:g}" for name, value in numbers.items()}
    law = _source(ActuatorLag.law, "lagged")
    return str(node.render(ros=ros, max_steps=max_steps, law=law, **defaults))


def _source(law: Law, name: str) -> str:
    """The text of a law under another name: a node has the catalogue's own."""
    (function,) = ast.parse(dedent(inspect.getsource(law))).body
    assert isinstance(function, ast.FunctionDef)
    function.name, function.decorator_list, function.returns = name, [], None
    for argument in function.args.args:
        argument.annotation = None
    return ast.unparse(function)
