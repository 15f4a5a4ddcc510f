"""What a log tells by itself: how its tables tell the time, and poses, commands and joints of typed messages."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.likeness import (
    FACTORS,
    NO_STATE,
    UNITS,
    WORDS,
    Source,
    dated,
    likely_unit,
    read_source,
    unit_of,
    words_of,
)
from gpsim.recordings.raw import Topic

TIME = "t"
SECONDS = (("s", "ns"), ("sec", "nsec"), ("secs", "nsecs"), ("sec", "nanosec"), ("seconds", "nanoseconds"))
"""Columns that tell the time together."""
STEPS = frozenset({"ts", "dt", "sample_time", "sampling_time"})
"""What a column is called that holds the step alone, in its first row."""
TIMES = frozenset({"t", "time", "timestamp", "timestamps", "stamp", "clock"})
NOT = frozenset({"delta", "d", "latency", "delay", "diff"})
SHORT = {"milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}
USUAL, GAP = 0.5, 2.5  # s that a gap has at the least, and in steps of the table
Values = Callable[[str, str], FloatArray]
"""Reads a field of a topic: (topic, field) -> (N,)."""


@dataclass
class Clock:
    """raw: of the mapping; taken: what was decided, as it is typed; unclear: columns to choose from.

    plain: told by a column in seconds that is called so.
    """

    raw: dict[str, Any] = field(default_factory=dict)
    used: set[tuple[str, str]] = field(default_factory=set)
    taken: tuple[str, str] | None = None
    unclear: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    missing: bool = False
    plain: bool = False


def clock_of(
    topics: Sequence[Topic], given: str | None, step: str | None, values: Values, beside: str = ""
) -> Clock:
    """Of tables; of a bag nothing, whose messages have stamps.

    given: `t=...`, step: `dt=...` as typed; beside: words of the columns of the state, which a clock may share.
    """
    tables = [topic for topic in topics if topic.type == "table"]
    if not tables:
        return Clock()
    every = [name for name in tables[0].fields if all(name in table.fields for table in tables)]
    fields = every or list(tables[0].fields)

    def used(*names: str) -> set[tuple[str, str]]:
        return {(topic.name, name) for topic in tables for name in names}

    if given is not None:
        source = read_source(TIME, given, tables)
        made = _column(source.field, source.scale, tables, values, typed=given)
        made.used = used(source.field)
        return made
    pair = next((p for p in SECONDS if set(p) <= set(fields)), None)
    if pair is not None:
        raw = {"time": {"seconds": pair[0], "nanoseconds": pair[1]}}
        return Clock(raw, used(*pair), remarks=[f"time from {pair[0]} and {pair[1]}"])
    named = [name for name in fields if TIMES & set(words_of(name)) and not NOT & set(words_of(name))]
    exact = [name for name in named if "_".join(words_of(name)) in TIMES]
    shared = [name for name in named if beside and words_of(name)[:-1] == words_of(beside)]
    chosen = shared or exact or named
    if step is not None and not exact:
        return _fixed(float(step), typed=step)
    if chosen:
        made = _column(chosen[0], None, tables, values)
        made.unclear = chosen if len(chosen) > 1 else made.unclear
        made.used = used(*chosen)
        return made
    told = next((name for name in fields if "_".join(words_of(name)) in STEPS), None)
    if told is not None:
        column = values(tables[0].name, told)
        steps = np.unique(column[np.isfinite(column)])
        if len(steps) == 1 and steps[0] > 0:
            made = _fixed(float(steps[0]))
            made.used, made.remarks = used(told), [f"{told} says a row every {steps[0]:g} s"]
            return made
    return Clock(missing=True)


def _fixed(step: float, typed: str | None = None) -> Clock:
    if not (np.isfinite(step) and step > 0):
        raise UsageError(f"dt={typed}: give the seconds between two rows, as dt=0.01")
    raw = {"time": {"step": step}, "gap_limit": max(USUAL, GAP * step)}
    return Clock(raw, taken=("dt", f"{step:g}"))


def _column(
    name: str, scale: float | None, tables: Sequence[Topic], values: Values, typed: str | None = None
) -> Clock:
    made = Clock(taken=(TIME, typed or name))
    t = values(next(topic for topic in tables if name in topic.fields).name, name)
    t = t[np.isfinite(t)]
    steps = np.diff(t)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    if scale is None:
        own = unit_of(name) or words_of(name)[-1]
        scale = FACTORS[own] if own in ("ms", "us", "ns") else 1.0
        sure, likely = dated(t), likely_unit(t, step)
        if scale == 1.0 and sure is not None:
            scale = UNITS[sure]
            made.remarks.append(f"{name} counts {sure}")
        elif scale == 1.0 and likely is not None:
            made.unclear = [name, f"{SHORT[likely]}*{name}"]
        if scale != 1.0:
            made.taken = (TIME, f"{scale:g}*{name}")
    made.plain = scale == 1.0 and typed is None and "_".join(words_of(name)) in TIMES
    made.raw["time"] = {"field": name} | ({"scale": scale} if scale != 1.0 else {})
    if GAP * step * scale > USUAL:
        made.raw["gap_limit"] = GAP * step * scale
    return made


POSE = "pose"
"""`pose=TOPIC` says where x, y and yaw are from."""
POSES = {
    "geometry_msgs/msg/PoseStamped": ("pose.position", "pose.orientation"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ("pose.pose.position", "pose.pose.orientation"),
    "geometry_msgs/msg/TransformStamped": ("transform.translation", "transform.rotation"),
    "nav_msgs/msg/Odometry": ("pose.pose.position", "pose.pose.orientation"),
    "geometry_msgs/msg/Pose": ("position", "orientation"),
}
_TWIST = {"v_cmd": "linear.x", "w_cmd": "angular.z"}
_ACKERMANN = {"v_cmd": "speed", "steering": "steering_angle"}
COMMANDS = {
    "geometry_msgs/msg/Twist": ("", _TWIST),
    "geometry_msgs/msg/TwistStamped": ("twist.", _TWIST),
    "ackermann_msgs/msg/AckermannDrive": ("", _ACKERMANN),
    "ackermann_msgs/msg/AckermannDriveStamped": ("drive.", _ACKERMANN),
}
"""Type of a message -> what stands before its fields, and channel -> field."""


@dataclass(frozen=True)
class Pose:
    """A topic, or columns of one, that hold a pose. prefix: of the columns; rate: of the messages [Hz], if known."""

    topic: str
    x: str
    y: str
    yaw: str
    quaternion: bool
    alone: bool
    prefix: str = ""
    rate: float | None = None

    @property
    def name(self) -> str:
        """As it is typed behind `pose=`."""
        if not self.prefix:
            return self.topic
        return self.prefix if self.alone else f"{self.topic}:{self.prefix}"

    def entries(self) -> dict[str, Any]:
        """The three channels of a mapping."""
        at: dict[str, Any] = {} if self.alone else {"topic": self.topic}
        heading = {"quaternion": self.yaw, "angle": "yaw"} if self.quaternion else {"field": self.yaw}
        return {
            "x": {**at, "field": self.x, "unit": "m"},
            "y": {**at, "field": self.y, "unit": "m"},
            "yaw": {**at, **heading, "unit": "rad", "wraps": True},
        }


def _often(topics: Sequence[Topic]) -> list[Topic]:
    """The most often told first."""
    return sorted(topics, key=lambda topic: -topic.count)


def poses_of(topics: Sequence[Topic]) -> list[Pose]:
    """Every pose in the log, the most often told first."""
    alone, found = len(topics) == 1, []
    for topic in _often(topics):
        if topic.type in POSES:
            found.append(pose_of(topic, alone))
        elif topic.type == "table":
            found += _of_columns(topic, alone)
    return found


def pose_of(topic: Topic, alone: bool) -> Pose:
    """The pose that messages of a known type hold."""
    position, orientation = POSES[topic.type]
    known = topic.start is not None and topic.end is not None and topic.end > topic.start
    rate = (topic.count - 1) / (topic.end - topic.start) if known else None  # type: ignore[operator]
    return Pose(topic.name, f"{position}.x", f"{position}.y", orientation, True, alone, rate=rate)


def _of_columns(topic: Topic, alone: bool) -> list[Pose]:
    """x, y and a heading with the same words before them, as `vicon x`, `vicon y`, `vicon yaw`."""
    groups: dict[tuple[str, ...], dict[str, str]] = {}
    for name in topic.fields:
        words = words_of(name)
        if words and not NO_STATE & set(words) and "." not in name:
            part = "yaw" if words[-1] in WORDS["heading"] else words[-1]
            groups.setdefault(tuple(words[:-1]), {}).setdefault(part, name)
    bases = [name.removesuffix(".w") for name in topic.fields if name.endswith(".w")]
    turned = next((base for base in bases if {f"{base}.{part}" for part in "xyz"} <= set(topic.fields)), None)
    return [
        Pose(topic.name, parts["x"], parts["y"], heading, "yaw" not in parts, alone, " ".join(prefix))
        for prefix, parts in groups.items()
        if {"x", "y"} <= set(parts) and (heading := parts.get("yaw") or turned) is not None
    ]


def fitting_pose(text: str, poses: Sequence[Pose]) -> Pose:
    """The pose that was named; raises UsageError."""
    for pose in poses:
        if text in (pose.name, pose.topic):
            return pose
    there = ", ".join(pose.name for pose in poses) or "none; name x, y and yaw by themselves"
    raise UsageError(f"pose={text}: no such pose; there are: {there}")


def command_of(channel: str, topics: Sequence[Topic]) -> list[Source]:
    """The fields of typed command messages that are this channel, the most often told first."""
    known = [(topic, *COMMANDS[topic.type]) for topic in _often(topics) if topic.type in COMMANDS]
    return [
        Source(topic.name, f"{prefix}{ends[channel]}", alone=len(topics) == 1)
        for topic, prefix, ends in known
        if channel in ends
    ]


JOINT_STATE = "sensor_msgs/msg/JointState"
ASKING = frozenset({
    "command", "commands", "cmd", "cmds", "commanded", "desired", "target", "targets", "goal", "reference", "ref",
    "setpoint", "setpoints", "control", "controls", "ctrl",
})  # fmt: skip
"""Words of a topic that says what is asked of the joints, not where they are."""
POSITION, VELOCITY, EFFORT = "position", "velocity", "effort"
TORQUES = ("N m", "N")  # units of what a motor gives, and of an effort
_NAMED = re.compile(r"(\w+)\[name=(.+)\]")


def measured_joint(name: str, of: str | None, topics: Sequence[Topic]) -> list[Source]:
    """Where a joint's position is told, or its velocity (`of`: the joint), the most often told first."""
    told = [topic for topic in _of_joints(topics) if not ASKING & set(words_of(topic.name))]
    return _named(told, topics, of or name, VELOCITY if of else POSITION)


def joint_command(name: str, unit: str, joint: str | None, topics: Sequence[Topic]) -> list[Source]:
    """Where an actuator's command is told, by its own name or by that of the joint that it drives.

    Of a motor that nobody tells a command, it is the torque that was measured at its joint.
    """
    every = _of_joints(topics)
    asked = [topic for topic in every if ASKING & set(words_of(topic.name))]
    kind = {"rad": POSITION, "m": POSITION, "rad/s": VELOCITY, "m/s": VELOCITY}.get(unit, EFFORT)
    for called in dict.fromkeys((name, name.removesuffix("_cmd"), joint)):
        if called is None:
            continue
        fields = [m for topic in asked for f in topic.fields if (m := _NAMED.fullmatch(f))]
        kinds = {m[1] for m in fields if m[2] == called}
        for part in (kind, *(kinds if len(kinds) == 1 else ())):
            if found := _named(asked, topics, called, part):
                return found
    found = _named(every, topics, name, kind) if name != joint else []
    measured = [topic for topic in every if topic not in asked] if unit in TORQUES else []
    return found or _named(measured, topics, joint or name, EFFORT)


def _of_joints(topics: Sequence[Topic]) -> list[Topic]:
    return _often([topic for topic in topics if topic.type == JOINT_STATE])


def _named(told: Sequence[Topic], topics: Sequence[Topic], name: str, kind: str) -> list[Source]:
    field = f"{kind}[name={name}]"
    return [Source(topic.name, field, alone=len(topics) == 1) for topic in told if field in topic.fields]
