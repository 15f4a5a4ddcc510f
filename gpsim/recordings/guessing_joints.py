"""Joints in a log: messages that name them (sensor_msgs/JointState) tell by themselves which number is whose."""

from __future__ import annotations

import re
from collections.abc import Sequence

from gpsim.recordings.channel_words import Source
from gpsim.recordings.likeness import words_of
from gpsim.recordings.raw import Topic

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
