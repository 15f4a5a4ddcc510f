"""Nodes of ROS 1 and 2 that drive a vehicle to a goal by an exported policy, under a monitor, or play a plan."""

from __future__ import annotations

import ast
import inspect
from importlib import resources
from textwrap import dedent
from typing import Literal

from jinja2 import StrictUndefined, Template

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
            "only policies that drive a vehicle to a goal have a ROS node; this one takes no goal in the plane"
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
