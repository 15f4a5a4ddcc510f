"""The bodies of simulators, as far as anybody knows their shape."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.channels import FloatArray
from gpsim.mjcf import MjcfSimulator
from gpsim.reports.robot_scene import robot
from gpsim.reports.scene import WORLD, Body, Columns, Frame, Shape
from gpsim.simulators import Simulator


def body_of(simulator: Simulator, parameters: Mapping[str, float], reach: float) -> Body | None:
    """The body of a simulator; None of one whose shape nobody knows. reach: m that it travels, for what has no size."""
    if isinstance(simulator, MjcfSimulator):
        return robot(simulator)
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


def _frame(
    parent: str, position: tuple[FloatArray, ...], axis: int = 2, angle: float | FloatArray = 0.0
) -> Frame:
    """At (x, y, z) m, turned by `angle` [rad] about the axis of this number."""
    half = np.broadcast_to(angle, position[0].shape) / 2
    turn = np.zeros((len(half), 4))
    turn[:, axis], turn[:, 3] = np.sin(half), np.cos(half)
    return Frame(parent, np.stack(position, axis=1), turn)


def _cart_pole(half: float) -> Body:
    """Theta leans towards +x, 0 upright; the pole is twice `half` [m] long."""

    def frames(columns: Columns) -> dict[str, Frame]:
        x, none = columns["x"], np.zeros_like(columns["x"])
        return {"": _frame(WORLD, (x, none, none)), "pole": _frame("", (none,) * 3, 1, columns["theta"])}

    cart = Shape("", "cube", (0.0, 0.0, -half / 5), (0.8 * half, half / 2, 0.4 * half))
    pole = Shape("pole", "cylinder", (0.0, 0.0, half), (half / 12, half / 12, 2 * half))
    return Body(("x", "theta"), frames, (cart, pole))


def _pendulum(length: float) -> Body:
    """Theta turns the bob from below towards +x; the frame's origin is the bob."""

    def frames(columns: Columns) -> dict[str, Frame]:
        theta = columns["theta"]
        bob = (length * np.sin(theta), np.zeros_like(theta), -length * np.cos(theta))
        return {"": _frame(WORLD, bob, 1, -theta)}

    bob = Shape("", "sphere", (0.0, 0.0, 0.0), (length / 5, length / 5, length / 5))
    rod = Shape("", "cylinder", (0.0, 0.0, length / 2), (length / 25, length / 25, length))
    return Body(("theta",), frames, (bob, rod))


def _slider(channel: str, size: float) -> Body:
    def frames(columns: Columns) -> dict[str, Frame]:
        none = np.zeros_like(columns[channel])
        return {"": _frame(WORLD, (columns[channel], none, none))}

    return Body((channel,), frames, (Shape("", "cube", (0.0, 0.0, 0.0), (size, size / 2, size / 2)),))


def _vehicle(length: float) -> Body:
    def frames(columns: Columns) -> dict[str, Frame]:
        place = (columns["x"], columns["y"], np.zeros_like(columns["x"]))
        return {"": _frame(WORLD, place, 2, columns["yaw"])}

    hull = Shape("", "cube", (0.0, 0.0, length / 8), (length, 0.6 * length, length / 4))
    nose = Shape("", "arrow", (length / 2, 0.0, length / 8), (length / 2, length / 8, length / 8))
    return Body(("x", "y", "yaw"), frames, (hull, nose), path=True)
