"""How a simulator's body looks in three dimensions: frames that move with the state, and shapes that hang in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from gpsim.simulators import Simulator

Vector = tuple[float, float, float]
Values = Mapping[str, float]
WORLD = "world"  # x ahead, y to the left, z upwards


@dataclass(frozen=True)
class Frame:
    """Where a part is in its parent's frame. name, parent: parts of one body, `` its root, WORLD what stands still.

    position: m; turned by `angle` [rad] about the axis.
    """

    name: str
    parent: str
    position: Vector
    axis: Literal["y", "z"] = "z"
    angle: float = 0.0

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """x, y, z, w."""
        sin, cos = math.sin(self.angle / 2), math.cos(self.angle / 2)
        return (0.0, sin, 0.0, cos) if self.axis == "y" else (0.0, 0.0, sin, cos)


@dataclass(frozen=True)
class Shape:
    """What is drawn in a frame: centre and size along its axes, both in m; an arrow points along x from its centre."""

    frame: str
    kind: Literal["cube", "cylinder", "sphere", "arrow"]
    centre: Vector
    size: Vector


@dataclass(frozen=True)
class Body:
    """needs: state channels that must be known; frames(values): in the order of parents; path: x and y are a trail."""

    needs: tuple[str, ...]
    frames: Callable[[Values], tuple[Frame, ...]]
    shapes: tuple[Shape, ...]
    path: bool = False


def body_of(simulator: Simulator, parameters: Values, reach: float) -> Body | None:
    """The body of a simulator; None of one whose shape nobody knows. reach: m that it travels, for what has no size."""
    units, positions = simulator.state.units, [c.name for c in simulator.coordinates]
    if simulator.name == "cartpole":
        return _cart_pole(parameters["pole_half_length"])
    if simulator.name == "pendulum":
        return _pendulum(parameters["length"])
    if {"x": "m", "y": "m", "yaw": "rad"}.items() <= units.items():
        return _vehicle(1.5 * parameters["wheelbase"] if "wheelbase" in parameters else reach / 20)
    if len(positions) == 1 and units[positions[0]] == "m":
        return _slider(positions[0], reach / 5)
    return None


def _cart_pole(half: float) -> Body:
    """Theta leans towards +x, 0 upright; the pole is twice `half` [m] long."""

    def frames(values: Values) -> tuple[Frame, ...]:
        cart = Frame("", WORLD, (values["x"], 0.0, 0.0))
        return cart, Frame("pole", "", (0.0, 0.0, 0.0), "y", values["theta"])

    cart = Shape("", "cube", (0.0, 0.0, -half / 5), (0.8 * half, half / 2, 0.4 * half))
    pole = Shape("pole", "cylinder", (0.0, 0.0, half), (half / 12, half / 12, 2 * half))
    return Body(("x", "theta"), frames, (cart, pole))


def _pendulum(length: float) -> Body:
    """Theta turns the bob from below towards +x; the frame's origin is the bob."""

    def frames(values: Values) -> tuple[Frame, ...]:
        theta = values["theta"]
        bob = (length * math.sin(theta), 0.0, -length * math.cos(theta))
        return (Frame("", WORLD, bob, "y", -theta),)

    bob = Shape("", "sphere", (0.0, 0.0, 0.0), (length / 5, length / 5, length / 5))
    rod = Shape("", "cylinder", (0.0, 0.0, length / 2), (length / 25, length / 25, length))
    return Body(("theta",), frames, (bob, rod))


def _slider(channel: str, size: float) -> Body:
    def frames(values: Values) -> tuple[Frame, ...]:
        return (Frame("", WORLD, (values[channel], 0.0, 0.0)),)

    return Body((channel,), frames, (Shape("", "cube", (0.0, 0.0, 0.0), (size, size / 2, size / 2)),))


def _vehicle(length: float) -> Body:
    def frames(values: Values) -> tuple[Frame, ...]:
        return (Frame("", WORLD, (values["x"], values["y"], 0.0), "z", values["yaw"]),)

    hull = Shape("", "cube", (0.0, 0.0, length / 8), (length, 0.6 * length, length / 4))
    nose = Shape("", "arrow", (length / 2, 0.0, length / 8), (length / 2, length / 8, length / 8))
    return Body(("x", "y", "yaw"), frames, (hull, nose), path=True)
