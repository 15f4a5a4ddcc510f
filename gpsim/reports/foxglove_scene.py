"""How a simulator's body looks in three dimensions: frames that move with the state, and shapes that hang in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from foxglove_schemas_protobuf.ArrowPrimitive_pb2 import ArrowPrimitive
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from gpsim.channels import FloatArray
from gpsim.reports.canvas import FAINT, OTHERS, POLICIES
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


COLOURS = {
    "real": FAINT,
    "base": POLICIES["Source"],
    "corrected": OTHERS[0],
    "corrected_gp": POLICIES["GP-Sample"],
}
SOLID, GHOST = 1.0, 0.65  # what was measured, and what is said of it
STRAIGHT = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)


def transform(frame: Frame, model: str, stamp: int) -> FrameTransform:
    """Where a part of a model's body is. stamp: ns."""
    message = FrameTransform(parent_frame_id=_id(frame.parent, model), child_frame_id=_id(frame.name, model))
    message.timestamp.FromNanoseconds(stamp)
    message.translation.CopyFrom(Vector3(**_xyz(frame.position)))
    message.rotation.CopyFrom(Quaternion(**dict(zip("xyzw", frame.quaternion, strict=True))))
    return message


def scene(body: Body, models: Sequence[str], stamp: int, path: FloatArray | None = None) -> SceneUpdate:
    """The bodies of all models, each locked to its own frame, and the path (N, 2) [m] that the first one takes."""
    update = SceneUpdate()
    for model in models:
        for frame in dict.fromkeys(shape.frame for shape in body.shapes):
            entity = _entity(update, _id(frame, model), stamp)
            for shape in (s for s in body.shapes if s.frame == frame):
                _add(entity, shape, _colour(model, SOLID if model == models[0] else GHOST))
    if path is not None:
        entity = _entity(update, WORLD, stamp)
        entity.id = f"{models[0]}/path"
        line = LinePrimitive(type=LinePrimitive.LINE_STRIP, thickness=2.0, scale_invariant=True)
        line.pose.CopyFrom(_pose((0.0, 0.0, 0.0)))
        line.color.CopyFrom(_colour(models[0], SOLID))
        line.points.extend(Point3(x=x, y=y, z=0.0) for x, y in path.tolist())
        entity.lines.append(line)
    return update


def _entity(update: SceneUpdate, frame: str, stamp: int) -> SceneEntity:
    entity: SceneEntity = update.entities.add(frame_id=frame, id=frame, frame_locked=True)
    entity.timestamp.FromNanoseconds(stamp)
    return entity


def _add(entity: SceneEntity, shape: Shape, colour: Color) -> None:
    pose, (x, y, z) = _pose(shape.centre), shape.size
    size = Vector3(x=x, y=y, z=z)
    if shape.kind == "cube":
        entity.cubes.append(CubePrimitive(pose=pose, size=size, color=colour))
    elif shape.kind == "sphere":
        entity.spheres.append(SpherePrimitive(pose=pose, size=size, color=colour))
    elif shape.kind == "cylinder":
        entity.cylinders.append(
            CylinderPrimitive(pose=pose, size=size, color=colour, bottom_scale=1.0, top_scale=1.0)
        )
    else:
        arrow = ArrowPrimitive(pose=pose, color=colour, shaft_length=0.6 * x, shaft_diameter=y)
        arrow.head_length, arrow.head_diameter = 0.4 * x, 2 * y
        entity.arrows.append(arrow)


def _id(part: str, model: str) -> str:
    """The frame of a model's part; the world is everybody's."""
    return WORLD if part == WORLD else f"{model}/{part}" if part else model


def _pose(centre: Vector) -> Pose:
    return Pose(position=Vector3(**_xyz(centre)), orientation=STRAIGHT)


def _xyz(vector: Vector) -> dict[str, Any]:
    return dict(zip("xyz", vector, strict=True))


def _colour(model: str, alpha: float) -> Color:
    red, green, blue = (int(COLOURS[model][i : i + 2], 16) / 255 for i in (1, 3, 5))
    return Color(r=red, g=green, b=blue, a=alpha)
