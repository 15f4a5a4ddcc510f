"""A body's frames and shapes as the messages of Foxglove."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from gpsim.channels import FloatArray
from gpsim.reports.scene import COLOURS, STRAIGHT, WORLD, Body, Frame, Shape, Turn, Vector

SOLID, GHOST = 1.0, 0.65  # what was measured, and what is said of it


def transform(name: str, frame: Frame, row: int, model: str, stamp: int) -> FrameTransform:
    """Where a part of a model's body is at one of its moments. stamp: ns."""
    message = FrameTransform(parent_frame_id=_id(frame.parent, model), child_frame_id=_id(name, model))
    message.timestamp.FromNanoseconds(stamp)
    message.translation.CopyFrom(Vector3(**_named(frame.position[row].tolist())))
    message.rotation.CopyFrom(Quaternion(**_named(frame.turn[row].tolist())))
    return message


def scene(body: Body, models: Sequence[str], stamp: int, path: FloatArray) -> SceneUpdate:
    """The bodies of all models, each locked to its own frame, and the path (N, 2) [m] that the first one takes."""
    update = SceneUpdate()
    for model in models:
        for frame in dict.fromkeys(shape.frame for shape in body.shapes):
            entity = _entity(update, _id(frame, model), stamp)
            for shape in (s for s in body.shapes if s.frame == frame):
                _add(entity, shape, _colour(model, SOLID if model == models[0] else GHOST))
    if body.path:
        entity = _entity(update, WORLD, stamp)
        entity.id = f"{models[0]}/path"
        line = LinePrimitive(type=LinePrimitive.LINE_STRIP, thickness=2.0, scale_invariant=True)
        line.pose.CopyFrom(_pose((0.0, 0.0, 0.0), STRAIGHT))
        line.color.CopyFrom(_colour(models[0], SOLID))
        line.points.extend(Point3(x=x, y=y, z=0.0) for x, y in path.tolist())
        entity.lines.append(line)
    return update


def _entity(update: SceneUpdate, frame: str, stamp: int) -> SceneEntity:
    entity: SceneEntity = update.entities.add(frame_id=frame, id=frame, frame_locked=True)
    entity.timestamp.FromNanoseconds(stamp)
    return entity


def _add(entity: SceneEntity, shape: Shape, colour: Color) -> None:
    pose, (x, y, z) = _pose(shape.centre, shape.turn), shape.size
    size = Vector3(x=x, y=y, z=z)
    if shape.kind == "cube":
        entity.cubes.append(CubePrimitive(pose=pose, size=size, color=colour))
    elif shape.kind == "sphere":
        entity.spheres.append(SpherePrimitive(pose=pose, size=size, color=colour))
    elif shape.kind == "cylinder":
        entity.cylinders.append(
            CylinderPrimitive(pose=pose, size=size, color=colour, bottom_scale=1.0, top_scale=1.0)
        )
    elif shape.triangles is not None:
        mesh = TriangleListPrimitive(pose=pose, color=colour)
        mesh.points.extend(Point3(**_named(corner)) for corner in shape.triangles.reshape(-1, 3).tolist())
        entity.triangles.append(mesh)
    else:
        arrow = ArrowPrimitive(pose=pose, color=colour, shaft_length=0.6 * x, shaft_diameter=y)
        arrow.head_length, arrow.head_diameter = 0.4 * x, 2 * y
        entity.arrows.append(arrow)


def _id(part: str, model: str) -> str:
    """The frame of a model's part; the world is everybody's."""
    return WORLD if part == WORLD else f"{model}/{part}" if part else model


def _pose(centre: Vector, turn: Turn) -> Pose:
    return Pose(position=Vector3(**_named(centre)), orientation=Quaternion(**_named(turn)))


def _named(parts: Iterable[float]) -> dict[str, Any]:
    """Of a place x, y and z, of a turn w too."""
    return dict(zip("xyzw", parts, strict=False))


def _colour(model: str, alpha: float) -> Color:
    red, green, blue = (int(COLOURS[model][i : i + 2], 16) / 255 for i in (1, 3, 5))
    return Color(r=red, g=green, b=blue, a=alpha)
