"""Recording, base and corrected simulator on one clock, as MCAP with the schemas of Foxglove.

MCAP: https://mcap.dev/spec. Schemas: https://docs.foxglove.dev/docs/sdk/schemas; numbers for plots are plain JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from gpsim.channels import Channels, FloatArray
from gpsim.recordings import start_times
from gpsim.reports.foxglove_scene import scene, transform
from gpsim.reports.scene import REAL, Frame, Shown
from gpsim.traces import Along

NUMBER, TEXT, FLAG = "number", "string", "boolean"

Frames = Mapping[str, Mapping[str, Frame]]
"""Motion -> part of the body -> where it is."""


def write_foxglove(shown: Shown, path: Path) -> int:
    """Write the MCAP; returns the number of messages. Equal content gives equal bytes."""
    with path.open("wb") as stream:
        out = _File(stream)
        out.schemas(shown)
        for stamp, topic, message in _messages(shown):
            out.write(stamp, topic, message)
        out.finish(shown.facts)
        return out.count


class _File:
    """Topics of JSON numbers, whose schemas are told before, and of Foxglove's messages."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._writer, self._topics, self.count = Writer(stream), dict[str, int](), 0
        self._writer.start(library="gpsim")

    def schemas(self, shown: Shown) -> None:
        """Tell what every plain topic holds."""
        for topic, fields in _fields(shown).items():
            name = f"gpsim.{topic.rpartition('/')[2].capitalize()}"
            known = {field: {"type": kind, "description": text} for field, (kind, text) in fields.items()}
            content = json.dumps({"title": name, "type": "object", "properties": known}).encode()
            schema = self._writer.register_schema(name, SchemaEncoding.JSONSchema, content)
            self._topics[topic] = self._writer.register_channel(topic, MessageEncoding.JSON, schema)

    def write(self, stamp: int, topic: str, message: Any) -> None:
        """A mapping as JSON, everything else as the protobuf message that it is. stamp: ns."""
        if topic not in self._topics:
            schema = register_schema(self._writer, type(message))
            self._topics[topic] = self._writer.register_channel(topic, MessageEncoding.Protobuf, schema)
        plain = isinstance(message, dict)
        data = json.dumps(message).encode() if plain else message.SerializeToString(deterministic=True)
        self._writer.add_message(self._topics[topic], stamp, data, stamp)
        self.count += 1

    def finish(self, facts: Mapping[str, str]) -> None:
        """The metadata and the index."""
        self._writer.add_metadata("gpsim", dict(facts))
        self._writer.finish()  # type: ignore[no-untyped-call]


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
    size = "root mean square of the residuals of all channels, each over how much it varies"
    fields["/mismatch"] = dict.fromkeys(along.models, (NUMBER, size))
    fields["/rollout"] = {"age": (NUMBER, "s since base and corrected began from a measured state")}
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
