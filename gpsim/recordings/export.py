"""A drive as the robot's own software would log it: velocity commands and motion-capture poses in a ROS bag."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from gpsim.channels import FloatArray, columns_beside
from gpsim.recordings.files import to_frame
from gpsim.recordings.recording import Recording

COMMAND, POSE = "geometry_msgs/msg/Twist", "geometry_msgs/msg/PoseStamped"
EPOCH = 1_750_000_000.0
"""Where the clock of a stand-in's drive begins [s since 1970]: a moment in 2025, always the same."""


@dataclass(frozen=True)
class DriveLog:
    """What was sent and seen: commands (M, 2) [m/s, rad/s] at command_t (M,) s, poses (N, 3) [m, m, rad] at pose_t."""

    command_t: FloatArray
    commands: FloatArray
    pose_t: FloatArray
    poses: FloatArray


@dataclass(frozen=True)
class Topics:
    """Where commands (Twist) and poses (PoseStamped) are published."""

    command: str = "/cmd_vel"
    pose: str = "/vrpn_client_node/limo/pose"


def write_ros1_bag(path: Path, log: DriveLog, topics: Topics) -> None:
    """Write a ROS 1 bag; every message is received the moment it is stamped, and the same log gives the same bytes."""
    with Writer1(path) as writer:
        _write(writer, log, topics, 1)


def write_ros2_bag(path: Path, log: DriveLog, topics: Topics) -> None:
    """Write a ROS 2 bag, a folder with an MCAP in it; otherwise as `write_ros1_bag`."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        _write(writer, log, topics, 2)


def _write(writer: Any, log: DriveLog, topics: Topics, ros: int) -> None:
    """In order of time; at the same moment the pose comes first, because the command answers it."""
    types = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    serialize = types.serialize_ros1 if ros == 1 else types.serialize_cdr
    command, pose = (
        writer.add_connection(name, kind, typestore=types)
        for name, kind in ((topics.command, COMMAND), (topics.pose, POSE))
    )
    vector = types.types["geometry_msgs/msg/Vector3"]
    stamps = np.concatenate([_nanoseconds(log.pose_t), _nanoseconds(log.command_t)])
    poses = len(log.pose_t)
    for row in np.argsort(stamps, kind="stable").tolist():
        stamp = int(stamps[row])
        if row < poses:
            number = (row,) if ros == 1 else ()
            message = _pose(types.types, stamp, log.poses[row].tolist(), "world", *number)
            writer.write(pose, stamp, serialize(message, POSE))
        else:
            v, w = log.commands[row - poses].tolist()
            message = types.types[COMMAND](vector(v, 0.0, 0.0), vector(0.0, 0.0, w))
            writer.write(command, stamp, serialize(message, COMMAND))


def _nanoseconds(t: FloatArray) -> np.ndarray:
    return np.int64(EPOCH) * 10**9 + np.round(t * 1e9).astype(np.int64)


def _pose(types: Any, stamp: int, pose: Sequence[float], frame: str, *number: int) -> object:
    """A PoseStamped; number: of the message, which a header of ROS 1 has."""
    x, y, yaw = pose
    time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    place = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](x, y, 0.0), turn)
    return types[POSE](types["std_msgs/msg/Header"](*number, time, frame), place)


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
    names = recording.state.names
    added = ["time", *(f"{label}.{name}" for label in predictions for name in names)]
    time, *predicted = columns_beside(added, (*names, *recording.action.names), "export")
    frame, starts = to_frame(recording), start_times(recording)
    clock = [episode.t + start for episode, start in zip(recording.episodes, starts, strict=True)]
    frame.insert(2, time, np.concatenate(clock))
    said = [np.concatenate(states).T for states in predictions.values()]
    return frame.assign(**dict(zip(predicted, np.concatenate(said), strict=True))) if said else frame


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
                message = float64(values[0]) if len(values) == 1 else _pose(types.types, stamp, values, "map")
                writer.write(connections[topic], stamp, types.serialize_cdr(message, kind))
        next(bag.glob("*.mcap")).rename(path)


def _samples(recording: Recording, predictions: Predictions) -> Iterator[_Sample]:
    for i, (episode, start) in enumerate(zip(recording.episodes, start_times(recording), strict=True)):
        stamps = np.round((episode.t + start) * 1e9).astype(np.int64)
        shown = {"measured": episode.states} | {label: states[i] for label, states in predictions.items()}
        actions = [*episode.actions.tolist(), []]  # none behind the last sample
        for k, stamp in enumerate(stamps.tolist()):
            for label, states in shown.items():
                if not np.isfinite(states[k]).all():
                    continue
                values = dict(zip(recording.state.names, states[k].tolist(), strict=True))
                for name, value in values.items():
                    yield stamp, f"/{label}/{name}", "std_msgs/msg/Float64", (value,)
                if {"x", "y", "yaw"} <= {
                    *values
                } and "pose" not in values:  # a topic has messages of one type
                    yield stamp, f"/{label}/pose", POSE, (values["x"], values["y"], values["yaw"])
            for name, value in zip(recording.action.names, actions[k], strict=False):
                yield stamp, f"/command/{name}", "std_msgs/msg/Float64", (value,)
