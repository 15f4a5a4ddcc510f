"""Recording, base and corrected simulator on one clock, as MCAP with the schemas of Foxglove.

MCAP: https://mcap.dev/spec. Schemas: https://docs.foxglove.dev/docs/sdk/schemas; numbers for plots are plain JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from matplotlib.colors import to_rgb
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from gpsim.channels import Channels, FloatArray
from gpsim.recordings import start_times
from gpsim.reports.scene import COLOURS, REAL, STRAIGHT, WORLD, Body, Frame, Shape, Shown, Turn, Vector
from gpsim.traces import Along

NUMBER, TEXT, FLAG = "number", "string", "boolean"
SOLID, GHOST = 1.0, 0.65  # what was measured, and what is said of it

Frames = Mapping[str, Mapping[str, Frame]]
"""Motion -> part of the body -> where it is."""


def write_foxglove(shown: Shown, path: Path) -> int:
    """Write the MCAP; returns the number of messages. Equal content gives equal bytes."""
    with path.open("wb") as stream:
        writer, topics, count = Writer(stream), dict[str, int](), 0
        writer.start(library="gpsim")
        for topic, fields in _fields(shown).items():  # what every topic of plain JSON holds is told before
            name = f"gpsim.{topic.rpartition('/')[2].capitalize()}"
            known = {field: {"type": kind, "description": text} for field, (kind, text) in fields.items()}
            content = json.dumps({"title": name, "type": "object", "properties": known}).encode()
            schema = writer.register_schema(name, SchemaEncoding.JSONSchema, content)
            topics[topic] = writer.register_channel(topic, MessageEncoding.JSON, schema)
        for count, (stamp, topic, message) in enumerate(_messages(shown), start=1):  # noqa: B007
            if topic not in topics:
                schema = register_schema(writer, type(message))
                topics[topic] = writer.register_channel(topic, MessageEncoding.Protobuf, schema)
            plain = isinstance(message, dict)
            data = json.dumps(message).encode() if plain else message.SerializeToString(deterministic=True)
            writer.add_message(topics[topic], stamp, data, stamp)
        writer.add_metadata("gpsim", dict(shown.facts))
        writer.finish()  # type: ignore[no-untyped-call]
        return count


def _fields(shown: Shown) -> dict[str, dict[str, tuple[str, str]]]:
    """Topic -> field -> type and unit or meaning, of everything that is plain JSON."""
    recording, along = shown.recording, shown.along

    def numbers(channels: Channels) -> dict[str, tuple[str, str]]:
        return {name: (NUMBER, unit) for name, unit in channels.units.items()}

    fields = {f"/{REAL}/state": numbers(recording.state)}
    if len(recording.action):
        fields[f"/{REAL}/command"] = numbers(recording.action)
    for model in along.models:
        fields[f"/{model}/state"] = numbers(along.state)
        fields[f"/{model}/residual"] = numbers(along.state)
    size = "root mean square of the residuals of all channels, each divided by its spread"
    fields["/mismatch"] = dict.fromkeys(along.models, (NUMBER, size))
    fields["/rollout"] = {"age": (NUMBER, "s since both simulators started from a measured state")}
    fields["/episode"] = {"name": (TEXT, "as in the recording"), "held_out": (FLAG, "it was only judged on")}
    return fields


def _messages(shown: Shown) -> Iterator[tuple[int, str, Any]]:
    """Everything in the order of time: (ns, topic, message)."""
    recording, along = shown.recording, shown.along
    for i, (episode, start) in enumerate(zip(recording.episodes, start_times(recording), strict=True)):
        stamps = np.round((episode.t + start) * 1e9).astype(np.int64).tolist()
        commands = [*_rows(recording.action.names, episode.actions), {}]
        models = {model: parts[i] for model, parts in along.models.items()}
        frames = {model: shown.frames(along.state.names, one.said) for model, one in models.items()}
        frames[REAL] = shown.frames(recording.state.names, episode.states)
        for k, measured in enumerate(_rows(recording.state.names, episode.states)):
            if k in (0, int(shown.held_out[i])):
                held = k >= int(shown.held_out[i])
                yield stamps[k], "/episode", {"name": episode.name, "held_out": held}
            if k == 0 and shown.body is not None:
                yield stamps[k], "/scene", scene(shown.body, shown.motions, stamps[k], shown.path(i))
            if measured:
                yield stamps[k], f"/{REAL}/state", measured
            if commands[k]:
                yield stamps[k], f"/{REAL}/command", commands[k]
            yield from _frames(frames, REAL, k, stamps[k])
            n, between = divmod(k, along.every)
            if not between and n < len(next(iter(models.values())).age):
                yield from _simulated(shown, models, frames, n, stamps[k])


def _simulated(
    shown: Shown, models: Mapping[str, Along], frames: Frames, n: int, stamp: int
) -> Iterator[tuple[int, str, Any]]:
    names, sizes = shown.along.state.names, dict[str, float]()
    for model, one in models.items():
        (state,), (off,) = _rows(names, one.said[n : n + 1]), _rows(names, one.off[n : n + 1])
        if not state:
            continue
        yield stamp, f"/{model}/state", state
        yield from _frames(frames, model, n, stamp)
        if off:
            yield stamp, f"/{model}/residual", off
            sizes[model] = float(shown.along.mismatch(one)[n])
    if sizes:
        yield stamp, "/mismatch", sizes
    age = float(next(iter(models.values())).age[n])
    if np.isfinite(age):
        yield stamp, "/rollout", {"age": age}


def _frames(frames: Frames, model: str, row: int, stamp: int) -> Iterator[tuple[int, str, Any]]:
    """The body's frames where all that places it is known."""
    for name, frame in frames[model].items():
        if np.isfinite(frame.position[row]).all():
            yield stamp, "/tf", transform(name, frame, row, model, stamp)


def _rows(names: Sequence[str], table: FloatArray) -> Iterable[dict[str, float]]:
    """Name -> value of every row, without those that are not finite."""
    finite = np.isfinite(table)
    for row, known in zip(table.tolist(), finite, strict=True):
        yield {name: value for name, value, ok in zip(names, row, known, strict=True) if ok}


def transform(name: str, frame: Frame, row: int, model: str, stamp: int) -> FrameTransform:
    """Where a part of a model's body is at one of its moments. stamp: ns."""
    message = FrameTransform(
        parent_frame_id=_id(frame.parent, model),
        child_frame_id=_id(name, model),
        translation=_named(frame.position[row].tolist()),
        rotation=_named(frame.turn[row].tolist()),
    )
    message.timestamp.FromNanoseconds(stamp)
    return message


def scene(body: Body, models: Sequence[str], stamp: int, path: FloatArray) -> SceneUpdate:
    """The bodies of all models, each locked to its own frame, and the path (N, 2) [m] that the first one takes."""
    update = SceneUpdate()

    def entity_in(frame: str, name: str) -> Any:
        entity = update.entities.add(frame_id=frame, id=name, frame_locked=True)
        entity.timestamp.FromNanoseconds(stamp)
        return entity

    for model in models:
        for frame in dict.fromkeys(shape.frame for shape in body.shapes):
            entity = entity_in(_id(frame, model), _id(frame, model))
            for shape in (s for s in body.shapes if s.frame == frame):
                _add(entity, shape, _colour(model, SOLID if model == models[0] else GHOST))
    if body.path:
        entity_in(WORLD, f"{models[0]}/path").lines.add(  # a strip
            pose=_pose((0.0, 0.0, 0.0), STRAIGHT),
            thickness=2.0,
            scale_invariant=True,
            color=_colour(models[0], SOLID),
            points=[{"x": x, "y": y, "z": 0.0} for x, y in path.tolist()],
        )
    return update


def _add(entity: Any, shape: Shape, colour: dict[str, float]) -> None:
    both: dict[str, Any] = {"pose": _pose(shape.centre, shape.turn), "color": colour}
    x, y, _ = shape.size
    if shape.kind == "cube":
        entity.cubes.add(**both, size=_named(shape.size))
    elif shape.kind == "sphere":
        entity.spheres.add(**both, size=_named(shape.size))
    elif shape.kind == "cylinder":
        entity.cylinders.add(**both, size=_named(shape.size), bottom_scale=1.0, top_scale=1.0)
    elif shape.triangles is not None:
        entity.triangles.add(**both, points=list(map(_named, shape.triangles.reshape(-1, 3).tolist())))
    else:
        shaft = {"shaft_length": 0.6 * x, "shaft_diameter": y}
        entity.arrows.add(**both, **shaft, head_length=0.4 * x, head_diameter=2 * y)


def _id(part: str, model: str) -> str:
    """The frame of a model's part; the world is everybody's."""
    return WORLD if part == WORLD else f"{model}/{part}" if part else model


def _pose(centre: Vector, turn: Turn) -> dict[str, dict[str, float]]:
    return {"position": _named(centre), "orientation": _named(turn)}


def _named(parts: Iterable[float]) -> Any:
    """Of a place x, y and z, of a turn w too."""
    return dict(zip("xyzw", parts, strict=False))


def _colour(model: str, alpha: float) -> dict[str, float]:
    red, green, blue = to_rgb(COLOURS[model])
    return {"r": red, "g": green, "b": blue, "a": alpha}
