"""Small bags of every kind for tests: written with rosbags' writers, messages given as nested dictionaries.

write_bag(folder / "drive.bag", "ros1-lz4", drive(seconds=2.0))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from mcap_writer import Chunks, write_mcap
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROS1_KINDS = ("ros1", "ros1-bz2", "ros1-lz4")
ROS2_KINDS = ("sqlite3", "sqlite3-message", "sqlite3-file", "mcap-folder", "mcap-folder-zstd")
MCAP_KINDS = ("mcap", "mcap-lz4", "mcap-zstd", "mcap-unchunked", "mcap-no-summary")
KINDS = (*ROS1_KINDS, *ROS2_KINDS, *MCAP_KINDS)
EPOCH = 1_700_000_000_000_000_000
ACKERMANN = "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
CUSTOM = {
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "ackermann_msgs/msg/AckermannDrive": ACKERMANN,
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
    "dynamic_reconfigure/msg/ParamDescription": "string name\nstring type\nuint32 level\n",
    "dynamic_reconfigure/msg/Group": "string name\ndynamic_reconfigure/ParamDescription[] parameters\nint32 id\n",
    "dynamic_reconfigure/msg/ConfigDescription": "dynamic_reconfigure/Group[] groups\n",
    "limo_msgs/msg/Status": "std_msgs/Header header\nuint8 vehicle_state\nfloat64 battery_voltage\nint16[4] wheel_ticks\n"
    "bool[] flags\nbool from\n",
}


@dataclass(frozen=True)
class Messages:
    """What one topic says: (receive time [ns], fields as nested dictionaries; what is left out is zero or empty)."""

    type: str
    rows: Sequence[tuple[int, Mapping[str, Any]]] = field(default_factory=list)


@lru_cache(maxsize=2)
def typestore(ros):
    """The message types of ROS 1 Noetic or ROS 2 Humble, and the custom ones."""
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    for name, text in CUSTOM.items():
        if name not in store.fielddefs:
            store.register(get_types_from_msg(text, name))
    return store


def stamp(nanoseconds):
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}


def header(nanoseconds, frame="map"):
    return {"stamp": stamp(nanoseconds), "frame_id": frame}


def build(store, name, values):
    """A message object from nested dictionaries."""
    made = {key: _value(store, description, values.get(key)) for key, description in store.fielddefs[name][1]}
    unknown = set(values) - set(made) - {"seq"}
    assert not unknown, f"{name} has no {unknown}"
    return store.types[name](*made.values())


def _value(store, description, value):
    kind, detail = description
    if kind == Nodetype.NAME:
        return build(store, detail, value or {})
    if kind == Nodetype.BASE:
        return ("" if value is None else value) if detail[0] == "string" else (value or 0)
    inner, length = detail
    values = list(value) if value is not None else [None] * (length if kind == Nodetype.ARRAY else 0)
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        dtype = {"bool": "bool_", "char": "uint8", "byte": "uint8"}.get(inner[1][0], inner[1][0])
        return np.array([v or 0 for v in values], dtype=dtype)
    return [_value(store, inner, v) for v in values]


def serialise(ros, kind, values):
    """A message's bytes in ROS 1 or ROS 2 (CDR) form."""
    store = typestore(ros)
    message = build(store, kind, values)
    return bytes(store.serialize_ros1(message, kind) if ros == 1 else store.serialize_cdr(message, kind))


def called(kind, stem="a"):
    """What a bag of this kind is called: a file by its ending, a folder without one."""
    if kind.startswith("ros1"):
        return f"{stem}.bag"
    return f"{stem}.mcap" if kind.startswith("mcap") and "folder" not in kind else stem


def write_bag(path, kind, topics, *, chunk=4096):
    """Write a bag whose messages lie in order of receive time; returns what `open_log` is given.

    chunk: bytes of a chunk (ROS 1 and the .mcap kinds). ROS 2 kinds but .mcap make a folder.
    """
    ros = 1 if kind in ROS1_KINDS else 2
    rows = sorted(
        (
            (receive, topic, messages.type, values)
            for topic, messages in topics.items()
            for receive, values in messages.rows
        ),
        key=lambda row: row[0],
    )
    found = [(receive, topic, serialise(ros, name, values)) for receive, topic, name, values in rows]
    types = {topic: messages.type for topic, messages in topics.items()}
    if kind.startswith("mcap") and "folder" not in kind:
        definitions = {name: typestore(2).generate_msgdef(name, ros_version=2)[0] for name in types.values()}
        options = Chunks(
            compression={"mcap-lz4": "lz4", "mcap-zstd": "zstd"}.get(kind, "none"),
            size=None if kind == "mcap-unchunked" else chunk,
            summary=kind != "mcap-no-summary",
            checked=kind != "mcap-unchecked",
        )
        path.write_bytes(write_mcap(types, definitions, found, options))
    elif ros == 1:
        _write_ros1(path, kind, types, found, chunk)
    else:
        _write_ros2(path, kind, types, found)
    return path


def _write(writer, ros, types, rows):
    with writer:
        store = typestore(ros)
        connections = {
            topic: writer.add_connection(topic, name, typestore=store) for topic, name in types.items()
        }
        for receive, topic, data in rows:
            writer.write(connections[topic], receive, data)


def _write_ros1(path, kind, types, rows, chunk):
    writer = Writer1(path)
    writer.chunk_threshold = chunk
    if kind != "ros1":
        writer.set_compression(Writer1.CompressionFormat[kind.removeprefix("ros1-").upper()])
    _write(writer, 1, types, rows)


def _write_ros2(path, kind, types, rows):
    plugin = StoragePlugin.SQLITE3 if kind.startswith("sqlite3") else StoragePlugin.MCAP
    writer = Writer2(path, version=9, storage_plugin=plugin)
    mode = {"sqlite3-message": "MESSAGE", "sqlite3-file": "FILE", "mcap-folder-zstd": "STORAGE"}.get(kind)
    if mode is not None:
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    _write(writer, 2, types, rows)


def drive(seconds=1.0, rate=50.0, seed=0):
    """A car on a circle: every message type that an import knows, header stamps 7 ms before arrival.

    /pose and /tf at `rate` [Hz], the commands at a fifth of it; header stamps carry odd nanoseconds.
    """
    rng = np.random.default_rng(seed)
    kinds = {
        "/pose": "geometry_msgs/msg/PoseStamped",
        "/pose_cov": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/transform": "geometry_msgs/msg/TransformStamped",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/odom": "nav_msgs/msg/Odometry",
    }
    made = {topic: Messages(kind, []) for topic, kind in kinds.items()}
    for i in range(int(seconds * rate)):
        receive = EPOCH + 123_456_789 + round(i * 1e9 / rate) + int(rng.integers(0, 500_000))
        when, angle = receive - 7_000_001, 0.02 * i
        position = {"x": float(np.cos(angle)), "y": float(np.sin(angle)), "z": 0.05}
        orientation = {"z": float(np.sin(angle / 2)), "w": float(np.cos(angle / 2))}
        pose = {"position": position, "orientation": orientation}
        head = {"header": header(when)}
        child = {
            **head,
            "child_frame_id": "base_link",
            "transform": {"translation": position, "rotation": orientation},
        }
        other = {
            "header": header(when - 5),
            "child_frame_id": "wheel",
            "transform": {"translation": {"x": float(i)}, "rotation": {"w": 1.0}},
        }
        covered = {"pose": pose, "covariance": [float(j) for j in range(36)]}
        twist = {"twist": {"linear": {"x": 0.5}, "angular": {"z": 0.1}}}
        said = (
            {**head, "pose": pose},
            {**head, "pose": covered},
            child,
            {"transforms": [child, other] if i % 2 else [other]},
            {**head, "pose": {"pose": pose}, "twist": twist},
        )
        for messages, values in zip(made.values(), said, strict=True):
            messages.rows.append((receive, values))
    return made | _commands(seconds, rate / 5.0)


def _commands(seconds, rate):
    times = [EPOCH + 150_000_003 + round(i * 1e9 / rate) for i in range(int(seconds * rate))]

    def told(kind, late, of):
        """late: ns from stamp to arrival, None of messages without a header."""
        rows = [
            (t, of(i) | ({} if late is None else {"header": header(t - late)})) for i, t in enumerate(times)
        ]
        return Messages(kind, rows)

    def twist(i):
        return {"linear": {"x": 0.1 * i}, "angular": {"z": -0.2 * i}}

    def steered(i):
        return {"steering_angle": 0.125 * i, "speed": 0.25 * i}

    def state(i):
        return {"battery_voltage": 11.5 - 0.01 * i, "wheel_ticks": [i, -i, 7, -7], "from": True}

    several = "std_msgs/msg/Float32MultiArray"
    return {
        "/cmd_vel": told("geometry_msgs/msg/Twist", None, twist),
        "/cmd_stamped": told("geometry_msgs/msg/TwistStamped", 11, lambda i: {"twist": twist(i)}),
        "/ackermann": told("ackermann_msgs/msg/AckermannDrive", None, steered),
        "/ackermann_stamped": told(
            "ackermann_msgs/msg/AckermannDriveStamped", 13, lambda i: {"drive": steered(i)}
        ),
        "/throttle": told("std_msgs/msg/Float32", None, lambda i: {"data": 0.5 * i}),
        "/sensors": told(several, None, lambda i: {"data": [float(i), 2.0, 3.0][: 3 if i % 4 else 2]}),
        "/joy": told("sensor_msgs/msg/Joy", 17, lambda i: {"axes": [0.0, 0.01 * i], "buttons": [1, 0, i]}),
        "/status": told("limo_msgs/msg/Status", 19, state),
    }
