"""Frames and shapes as Foxglove's own messages: foxglove.FrameTransform and foxglove.SceneUpdate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

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
from gpsim.reports.foxglove_bodies import WORLD, Body, Frame, Shape, Vector
from gpsim.reports.palette import FAINT, OTHERS, POLICIES

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
