"""A recording for other programs: MCAP for Foxglove and PlotJuggler, or one wide table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from gpsim.channels import Channels, FloatArray, columns_beside
from gpsim.recordings.recording import Episode, Recording

Predictions = Mapping[str, Sequence[FloatArray]]
"""Name, as `simulated`, to one array of predicted states (K + 1, S) an episode; NaN where nothing is predicted."""
SPACE = 1.0  # s between episodes that do not follow one another by themselves
_Sample = tuple[int, str, str, tuple[float, ...]]


def start_times(recording: Recording) -> list[float]:
    """When t = 0 of each episode was [s]: as logged where the logs follow one another, else one after the other."""
    origins: Mapping[str, Any] = recording.provenance.get("sources") or {}
    episodes = recording.episodes
    if all(e.name in origins and {"epoch_s", "start_s"} <= set(origins[e.name]) for e in episodes):
        first = [float(origins[e.name]["epoch_s"]) + float(origins[e.name]["start_s"]) for e in episodes]
        known = [start - float(e.t[0]) for start, e in zip(first, episodes, strict=True)]
        ends = [start + float(e.t[-1]) for start, e in zip(known, episodes, strict=True)]
        if all(start >= end for start, end in zip(first[1:], ends[:-1], strict=True)) and min(first) >= 0:
            return known
    if recording.clock == "session":
        return [-float(episodes[0].t[0])] * len(episodes)
    starts, now = [], 0.0
    for episode in episodes:
        starts.append(now - float(episode.t[0]))
        now += float(episode.t[-1] - episode.t[0]) + SPACE
    return starts


def wide_table(recording: Recording, predictions: Predictions) -> pd.DataFrame:
    """One row a sample: episode, t, time [s], measured channels, actions, then PREDICTION.CHANNEL columns.

    Channels keep their names: a column that is no channel's and would be called as one gets `export.` before it.
    """
    frames, names = [], recording.state.names
    added = ["time", *(f"{label}.{name}" for label in predictions for name in names)]
    time, *predicted = columns_beside(added, (*names, *recording.action.names), "export")
    for i, (episode, start) in enumerate(zip(recording.episodes, start_times(recording), strict=True)):
        columns: dict[str, Any] = {"episode": episode.name, "t": episode.t, time: episode.t + start}
        columns |= {name: episode.states[:, c] for c, name in enumerate(recording.state.names)}
        actions = np.vstack([episode.actions, np.full((1, len(recording.action)), np.nan)])
        columns |= {name: actions[:, c] for c, name in enumerate(recording.action.names)}
        said = np.hstack([states[i] for states in predictions.values()]) if predictions else np.empty((0, 0))
        columns |= dict(zip(predicted, said.T, strict=True))
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


def write_table(recording: Recording, predictions: Predictions, path: Path) -> None:
    """Write the wide table as .csv or .parquet, by the path's ending."""
    frame = wide_table(recording, predictions)
    if path.suffix == ".parquet":
        frame.to_parquet(path, index=False)
    else:
        frame.to_csv(path, index=False, lineterminator="\n")


def write_mcap(recording: Recording, predictions: Predictions, path: Path) -> None:
    """Write an MCAP of ROS 2 messages, in the order of time.

    /measured/CHANNEL, /command/CHANNEL and /PREDICTION/CHANNEL are std_msgs/Float64; where the state has x, y
    and yaw there is a geometry_msgs/PoseStamped at /measured/pose and /PREDICTION/pose too.
    """
    types = get_typestore(Stores.ROS2_HUMBLE)
    float64: Any = types.types["std_msgs/msg/Float64"]
    with TemporaryDirectory(dir=path.parent, prefix=".export-") as folder:
        bag = Path(folder) / "bag"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections: dict[str, Any] = {}
            for stamp, topic, kind, values in _samples(recording, predictions):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=types)
                message = float64(values[0]) if len(values) == 1 else _pose(types.types, stamp, values)
                writer.write(connections[topic], stamp, types.serialize_cdr(message, kind))
        next(bag.glob("*.mcap")).rename(path)


def _samples(recording: Recording, predictions: Predictions) -> Iterator[_Sample]:
    for i, (episode, start) in enumerate(zip(recording.episodes, start_times(recording), strict=True)):
        stamps = np.round((episode.t + start) * 1e9).astype(np.int64)
        shown = {"measured": episode.states} | {label: states[i] for label, states in predictions.items()}
        for k, stamp in enumerate(stamps.tolist()):
            for label, states in shown.items():
                yield from _state(stamp, label, states[k], recording.state)
            yield from _commands(stamp, episode, k, recording.action)


def _state(stamp: int, label: str, row: FloatArray, channels: Channels) -> Iterator[_Sample]:
    if not np.isfinite(row).all():
        return
    values = dict(zip(channels.names, row.tolist(), strict=True))
    for name, value in values.items():
        yield stamp, f"/{label}/{name}", "std_msgs/msg/Float64", (value,)
    if {"x", "y", "yaw"} <= set(values) and "pose" not in values:  # a topic holds messages of one type
        pose = (values["x"], values["y"], values["yaw"])
        yield stamp, f"/{label}/pose", "geometry_msgs/msg/PoseStamped", pose


def _commands(stamp: int, episode: Episode, k: int, channels: Channels) -> Iterator[_Sample]:
    if k < len(episode.actions):
        for name, value in zip(channels.names, episode.actions[k].tolist(), strict=True):
            yield stamp, f"/command/{name}", "std_msgs/msg/Float64", (value,)


def _pose(types: Mapping[str, Any], stamp: int, values: Sequence[float]) -> object:
    x, y, yaw = values
    time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    place = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](x, y, 0.0), turn)
    return types["geometry_msgs/msg/PoseStamped"](types["std_msgs/msg/Header"](time, "map"), place)
