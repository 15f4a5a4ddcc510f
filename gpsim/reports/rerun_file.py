"""Recording, base and corrected simulator on one clock, as a Rerun file: robots side by side, numbers below them.

https://rerun.io. Every file has an id and times of its own, so equal content does not give equal bytes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from gpsim.channels import FloatArray
from gpsim.recordings import start_times
from gpsim.reports.scene import COLOURS, REAL, Frame, Shape, Shown

CLOCK = "t"  # s on the recording's clock
ROOT = "body"
RGB = {motion: tuple(bytes.fromhex(colour[1:])) for motion, colour in COLOURS.items()}


def write_rerun(shown: Shown, path: Path) -> int:
    """Write the .rrd; returns the number of samples in it, of numbers and of frames."""
    out, count = rr.RecordingStream("gpsim"), 0
    out.save(path, _layout(shown))
    facts = "\n\n".join(f"**{name}** {text}" for name, text in shown.facts.items())
    out.log("diagnosis", rr.TextDocument(facts, media_type="text/markdown"), static=True)
    for motion in shown.motions:
        _log_shapes(out, motion, () if shown.body is None else shown.body.shapes)
    said = set[str]()
    for i, (episode, start) in enumerate(
        zip(shown.recording.episodes, start_times(shown.recording), strict=True)
    ):
        clock = episode.t + start
        for names, t, values in _series(shown, i, clock):
            entity = rr.new_entity_path(names)
            if entity not in said:
                said.add(entity)
                out.log(entity, rr.SeriesLines(colors=[RGB[names[-1]]], names=names[-1]), static=True)
            out.send_columns(entity, [rr.TimeColumn(CLOCK, duration=t)], rr.Scalars.columns(scalars=values))
            count += len(t)
        for motion in shown.motions:
            channels, states, at = (
                (shown.recording.state, episode.states, clock)
                if motion == REAL
                else (shown.along.state, shown.along.models[motion][i].said, clock[:: shown.along.every])
            )
            count += _send_frames(out, motion, shown.frames(channels.names, states), at[: len(states)])
        if len(trail := shown.path(i)):
            out.set_time(CLOCK, duration=clock[0])
            ground = np.column_stack([trail, np.zeros(len(trail))])
            out.log(f"{REAL}/path", rr.LineStrips3D([ground], colors=[RGB[REAL]]))
    out.disconnect()
    return count


def _layout(shown: Shown) -> rrb.Blueprint:
    """Bodies side by side, and below them a sheet a channel, in which all motions lie over each other."""
    sheets = [rrb.TimeSeriesView(origin="/mismatch", name="mismatch")]
    sheets += [
        rrb.TimeSeriesView(
            origin=rr.new_entity_path([kind, channel.name]), name=f"{channel.name} [{channel.unit}]"
        )
        for kind, channels in (("state", shown.along.state), ("command", shown.recording.action))
        for channel in channels
    ]
    numbers = rrb.Tabs(*sheets, rrb.TextDocumentView(origin="/diagnosis", name="diagnosis"))
    if shown.body is None:
        return rrb.Blueprint(numbers, collapse_panels=True)
    bodies = rrb.Horizontal(*(rrb.Spatial3DView(origin=f"/{m}", name=m) for m in shown.motions))
    return rrb.Blueprint(rrb.Vertical(bodies, numbers, row_shares=[3, 2]), collapse_panels=True)


def _log_shapes(out: rr.RecordingStream, motion: str, shapes: Iterable[Shape]) -> None:
    """Every shape below its part's frame."""
    parts, colour = defaultdict[str, list[Shape]](list), RGB[motion]
    out.log(motion, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for shape in shapes:
        parts[shape.frame].append(shape)
    for part, its in parts.items():
        for i, shape in enumerate(its):
            out.log(f"{_place(motion, part)}/{shape.kind}{i}", *_drawn(shape, colour), static=True)


def _drawn(shape: Shape, colour: tuple[int, ...]) -> tuple[Any, ...]:
    """Where a shape is in its frame, and what it is."""
    x, y, z = shape.size
    solid: dict[str, Any] = {"colors": [colour], "fill_mode": "solid"}
    at = rr.Transform3D(translation=shape.centre, quaternion=shape.turn)
    if shape.triangles is not None:
        corners = shape.triangles.reshape(-1, 3)
        return at, rr.Mesh3D(vertex_positions=corners, albedo_factor=colour)
    if shape.kind == "cube":
        return at, rr.Boxes3D(sizes=[shape.size], **solid)
    if shape.kind == "sphere":
        return at, rr.Ellipsoids3D(half_sizes=[(x / 2, y / 2, z / 2)], **solid)
    if shape.kind == "cylinder":
        return at, rr.Cylinders3D(lengths=[z], radii=[x / 2], **solid)
    return at, rr.Arrows3D(vectors=[(x, 0.0, 0.0)], radii=y / 2, colors=[colour])


def _send_frames(out: rr.RecordingStream, motion: str, frames: dict[str, Frame], t: FloatArray) -> int:
    count = 0
    for part, frame in frames.items():
        known = np.isfinite(frame.position).all(axis=1)
        columns = rr.Transform3D.columns(translation=frame.position[known], quaternion=frame.turn[known])
        out.send_columns(_place(motion, part), [rr.TimeColumn(CLOCK, duration=t[known])], columns)
        count += int(known.sum())
    return count


def _place(motion: str, part: str) -> str:
    """A part's path: what is no root hangs in the root, or in the world where there is none."""
    return str(rr.new_entity_path([motion, ROOT, part] if part else [motion, ROOT]))


def _series(
    shown: Shown, index: int, clock: FloatArray
) -> Iterator[tuple[list[str], FloatArray, FloatArray]]:
    """The numbers of an episode where they are known: path, t (N,) s and values (N,)."""
    recording, along = shown.recording, shown.along
    episode = recording.episodes[index]
    tables = [("state", REAL, recording.state.names, episode.states)]
    tables.append(("command", REAL, recording.action.names, episode.actions))
    for model, parts in along.models.items():
        one = parts[index]
        tables += [
            ("state", model, along.state.names, one.said),
            ("residual", model, along.state.names, one.off),
        ]
        tables.append(("mismatch", model, ("",), along.mismatch(one)[:, None]))
    for kind, motion, names, table in tables:
        t = (clock if motion == REAL else clock[:: along.every])[: len(table)]
        for name, values in zip(names, table.T, strict=True):
            known = np.isfinite(values)
            if known.any():
                yield [kind, *filter(None, [name]), motion], t[known], values[known]
