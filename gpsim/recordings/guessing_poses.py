"""Poses and commands of vehicles in a log: known by the type of their message, or by their columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gpsim.errors import UsageError
from gpsim.recordings.inspection import ACKERMANN, POSES, TWISTS
from gpsim.recordings.likeness import NO_STATE, WORDS, Source, words_of
from gpsim.recordings.raw import Topic

POSE = "pose"
"""`pose=TOPIC` says where x, y and yaw are from."""


@dataclass(frozen=True)
class Pose:
    """A topic, or columns of one, that hold a pose. prefix: of the columns; rate: of the messages [Hz], if known."""

    topic: str
    x: str
    y: str
    yaw: str
    quaternion: bool
    prefix: str = ""
    alone: bool = False
    rate: float | None = None

    @property
    def name(self) -> str:
        """As it is typed behind `pose=`."""
        return (
            self.prefix
            if self.alone and self.prefix
            else f"{self.topic}:{self.prefix}"
            if self.prefix
            else self.topic
        )

    def entries(self) -> dict[str, Any]:
        """The three channels of a mapping."""
        at: dict[str, Any] = {} if self.alone else {"topic": self.topic}
        heading = {"quaternion": self.yaw, "angle": "yaw"} if self.quaternion else {"field": self.yaw}
        return {
            "x": {**at, "field": self.x, "unit": "m"},
            "y": {**at, "field": self.y, "unit": "m"},
            "yaw": {**at, **heading, "unit": "rad", "wraps": True},
        }


def poses_of(topics: Sequence[Topic]) -> list[Pose]:
    """Every pose in the log, the most often told first."""
    alone, found = len(topics) == 1, []
    for topic in sorted(topics, key=lambda topic: -topic.count):
        if topic.type in POSES:
            position, orientation = POSES[topic.type]
            found.append(
                Pose(
                    topic.name,
                    f"{position}.x",
                    f"{position}.y",
                    orientation,
                    True,
                    alone=alone,
                    rate=_rate(topic),
                )
            )
        elif topic.type == "table":
            found += _of_columns(topic, alone)
    return found


def _rate(topic: Topic) -> float | None:
    if topic.start is None or topic.end is None or not topic.end > topic.start:
        return None
    return (topic.count - 1) / (topic.end - topic.start)


def _of_columns(topic: Topic, alone: bool) -> list[Pose]:
    """x, y and a heading with the same words before them, as `vicon x`, `vicon y`, `vicon yaw`."""
    groups: dict[tuple[str, ...], dict[str, str]] = {}
    for name in topic.fields:
        words = words_of(name)
        if words and not NO_STATE & set(words) and "." not in name:
            part = "yaw" if words[-1] in WORDS["heading"] else words[-1]
            groups.setdefault(tuple(words[:-1]), {}).setdefault(part, name)
    found = []
    turned = _quaternion(topic)
    for prefix, parts in groups.items():
        if not {"x", "y"} <= set(parts):
            continue
        heading = parts.get("yaw") or turned
        if heading is not None:
            shown = " ".join(prefix)
            found.append(Pose(topic.name, parts["x"], parts["y"], heading, "yaw" not in parts, shown, alone))
    return found


def _quaternion(topic: Topic) -> str | None:
    """What stands before .x, .y, .z and .w of four columns."""
    held = set(topic.fields)
    return next(
        (
            n.removesuffix(".w")
            for n in topic.fields
            if {f"{n[:-1]}{part}" for part in "xyzw"} <= held and n[-2:] == ".w"
        ),
        None,
    )


def fitting_pose(text: str, poses: Sequence[Pose]) -> Pose:
    """The pose that was named; raises UsageError."""
    for pose in poses:
        if text in (pose.name, pose.topic):
            return pose
    there = ", ".join(pose.name for pose in poses) or "none; name x, y and yaw by themselves"
    raise UsageError(f"pose={text}: no such pose; there are: {there}")


def command_of(channel: str, topics: Sequence[Topic]) -> list[Source]:
    """The fields of typed command messages that are this channel, the most often told first."""
    alone, found = len(topics) == 1, []
    for topic in sorted(topics, key=lambda topic: -topic.count):
        if topic.type in TWISTS:
            ends = {"v_cmd": "linear.x", "w_cmd": "angular.z"}
            prefix = TWISTS[topic.type]
        elif topic.type in ACKERMANN:
            ends = {"v_cmd": "speed", "steering": "steering_angle"}
            prefix = ACKERMANN[topic.type]
        else:
            continue
        if channel in ends:
            found.append(Source(topic.name, f"{prefix}{ends[channel]}", alone=alone))
    return found


JOINT_STATE = "sensor_msgs/msg/JointState"
COMMANDS = frozenset({
    "command", "commands", "cmd", "cmds", "commanded", "desired", "target", "targets", "goal", "reference", "ref",
    "setpoint", "setpoints", "control", "controls", "ctrl",
})  # fmt: skip
"""Words of a topic that says what is asked of the joints, not where they are."""
POSITION, VELOCITY, EFFORT = "position", "velocity", "effort"
_NAMED = re.compile(r"(\w+)\[name=(.+)\]")


def measured_joint(name: str, of: str | None, topics: Sequence[Topic]) -> list[Source]:
    """Where a joint's position is told, or its velocity (`of`: the joint), the most often told first."""
    told = [topic for topic in _of_joints(topics) if not _commands(topic)]
    return _named(told, topics, of or name, VELOCITY if of else POSITION)


def joint_command(name: str, unit: str, joint: str | None, topics: Sequence[Topic]) -> list[Source]:
    """Where an actuator's command is told, by its own name or by that of the joint that it drives."""
    every = _of_joints(topics)
    asked = [topic for topic in every if _commands(topic)]
    kind = {"rad": POSITION, "m": POSITION, "rad/s": VELOCITY, "m/s": VELOCITY}.get(unit, EFFORT)
    for called in dict.fromkeys((name, name.removesuffix("_cmd"), joint)):
        if called is None:
            continue
        for part in (kind, *(_only_kind(asked, called))):
            if found := _named(asked, topics, called, part):
                return found
    return _named(every, topics, name, kind) if name != joint else []


def _only_kind(topics: Sequence[Topic], name: str) -> list[str]:
    """The list that holds this name's number, where there is but one."""
    kinds = {m[1] for t in topics for f in t.fields if (m := _NAMED.fullmatch(f)) and m[2] == name}
    return list(kinds) if len(kinds) == 1 else []


def _of_joints(topics: Sequence[Topic]) -> list[Topic]:
    return sorted((t for t in topics if t.type == JOINT_STATE), key=lambda topic: -topic.count)


def _commands(topic: Topic) -> bool:
    return bool(COMMANDS & set(words_of(topic.name)))


def _named(told: Sequence[Topic], topics: Sequence[Topic], name: str, kind: str) -> list[Source]:
    field = f"{kind}[name={name}]"
    return [Source(topic.name, field, alone=len(topics) == 1) for topic in told if field in topic.fields]
