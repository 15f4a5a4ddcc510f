"""A drive as the robot's own software would log it: velocity commands and motion-capture poses in a ROS bag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from gpsim.channels import FloatArray

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
    types = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:
        connections = {
            name: writer.add_connection(name, kind, typestore=types)
            for name, kind in ((topics.command, COMMAND), (topics.pose, POSE))
        }
        for stamp, topic, kind, message in _messages(log, topics, types, ros=1):
            writer.write(connections[topic], stamp, types.serialize_ros1(message, kind))


def write_ros2_bag(path: Path, log: DriveLog, topics: Topics) -> None:
    """Write a ROS 2 bag, a folder with an MCAP in it; otherwise as `write_ros1_bag`."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    with Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            name: writer.add_connection(name, kind, typestore=types)
            for name, kind in ((topics.command, COMMAND), (topics.pose, POSE))
        }
        for stamp, topic, kind, message in _messages(log, topics, types, ros=2):
            writer.write(connections[topic], stamp, types.serialize_cdr(message, kind))


def _messages(
    log: DriveLog, topics: Topics, types: Typestore, ros: int
) -> Iterator[tuple[int, str, str, Any]]:
    """In order of time; at the same moment the pose comes first, because the command answers it."""
    stamps = np.concatenate([_nanoseconds(log.pose_t), _nanoseconds(log.command_t)])
    poses = len(log.pose_t)
    for row in np.argsort(stamps, kind="stable").tolist():
        stamp = int(stamps[row])
        if row < poses:
            yield stamp, topics.pose, POSE, _pose(types.types, stamp, log.poses[row], row, ros)
        else:
            yield stamp, topics.command, COMMAND, _twist(types.types, log.commands[row - poses])


def _nanoseconds(t: FloatArray) -> np.ndarray:
    return np.int64(EPOCH) * 10**9 + np.round(t * 1e9).astype(np.int64)


def _twist(types: Any, command: FloatArray) -> object:
    vector = types["geometry_msgs/msg/Vector3"]
    v, w = command.tolist()
    return types[COMMAND](vector(v, 0.0, 0.0), vector(0.0, 0.0, w))


def _pose(types: Any, stamp: int, pose: FloatArray, number: int, ros: int) -> object:
    x, y, yaw = pose.tolist()
    time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    header = types["std_msgs/msg/Header"]
    made = header(number, time, "world") if ros == 1 else header(time, "world")
    turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    place = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](x, y, 0.0), turn)
    return types[POSE](made, place)
