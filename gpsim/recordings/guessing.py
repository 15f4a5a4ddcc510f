"""What a log tells of columns, units and roles by itself: of tables, of bags, and for what `--inspect` proposes.

A column's name is held against the words that roboticists use for a channel, a message's type says what it holds, and
the values of a column say the unit of its clock.
"""

from __future__ import annotations

import difflib
import math
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import yaml

from gpsim.channels import Channel, Channels, FloatArray
from gpsim.errors import UsageError, near
from gpsim.recordings.raw import NamedLog, Topic
from gpsim.recordings.values import one_line

EXACT, FULL, LAST, MEASURED = 5.0, 4.0, 1.9, 1.5
"""Called as the channel; as one of its words; its last word is one; one of them and an m, as qm."""
OTHER_NUMBER = (
    0.2  # less where the channel's name has a number and the column's another one, as wrist_1 and wrist_2
)
LATER = 0.1  # less for every place that a word stands further back in its list
WORDS: dict[str, tuple[str, ...]] = {
    "position": ("position", "pos", "q", "x", "displacement", "travel", "distance", "s"),
    "angle": ("theta", "angle", "phi", "th", "alpha", "position", "pos", "q", "rotation"),
    "heading": ("yaw", "heading", "psi", "theta", "orientation"),
    "x": ("x",),
    "y": ("y",),
    "velocity": ("velocity", "vel", "speed", "v", "qd", "xd", "dq", "dx"),
    "angular_velocity": (
        "omega", "velocity", "vel", "angular_velocity", "w", "speed", "qd", "dq", "rate", "gyro",
    ),
    "force": ("force", "motor_force", "u", "f", "effort", "command", "cmd", "control", "input", "action"),
    "torque": (
        "torque", "tau", "effort", "motor_torque", "u", "command", "cmd", "control", "input", "action",
    ),
    "speed_command": ("v_cmd", "cmd_v", "speed", "throttle", "v", "v_ref", "linear", "velocity_command"),
    "turn_command": (
        "w_cmd", "cmd_w", "omega", "angular", "turn_rate", "yaw_rate", "w", "yawrate", "turnrate",
    ),
    "steering_command": ("steering", "steer", "delta", "steering_angle", "steering_cmd"),
}  # fmt: skip
"""What a quantity is called, the likeliest first."""
NO_STATE = frozenset({
    "target", "desired", "des", "ref", "reference", "cmd", "command", "goal", "set", "setpoint", "planned", "err",
    "error", "raw", "squared", "sin", "cos", "acc", "accel", "imu", "std", "cov", "covariance", "count", "seq",
})  # fmt: skip
"""Words of a column that is not what was measured of a state."""
NO_ACTION = frozenset(
    {"raw", "squared", "err", "error", "measured", "sin", "cos", "std", "acc", "seq", "count"}
)
_NUMBERS = re.compile(r"\d+")
_ENDINGS = {
    **{unit: unit for unit in ("ms", "us", "ns", "s", "deg", "rad", "rpm", "m", "mm", "cm", "km", "N", "Nm")},
    "sec": "s", "mps": "m/s", "m_s": "m/s", "rad_s": "rad/s", "rads": "rad/s", "radps": "rad/s",
    "deg_s": "deg/s", "degs": "deg/s", "degps": "deg/s", "dps": "deg/s",
}  # fmt: skip
"""How a column's name may end behind `_`, and the unit that this tells."""
_UNIT = re.compile(
    rf"\s*[\[(]([^\])]*)[\])]\s*$|(?<=[A-Za-z0-9])_({'|'.join(sorted(_ENDINGS, key=len, reverse=True))})$"
)
_SI = {"deg": "rad", "rpm": "rad/s", "mm": "m", "cm": "m", "km": "m"}


def words_of(name: str) -> list[str]:
    """`angleD [rad/s]` -> [angle, d], `time_ms` -> [time]; numbers apart, units and slashes left out."""
    bare = _UNIT.sub("", name)
    bare = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare)
    return [word for word in re.split(r"[^a-zA-Z]+", bare.lower()) if word]


def unit_of(name: str) -> str:
    """The unit that a column's name ends in, as `[deg]`, `(ms)` or `_deg`; empty without one."""
    found = _UNIT.search(name)
    if found is None:
        return ""
    return _ENDINGS[found[2]] if found[2] else found[1].strip()


def factor_of(name: str, unit: str) -> float:
    """What turns a column into this unit, as its name tells; 1 where it tells nothing, or another quantity."""
    own = unit_of(name).removesuffix("/s")
    fits = own in _SI and unit in (_SI[own], f"{_SI[own]}/s")
    return FACTORS[own] if fits else 1.0


def likeness(name: str, channel: str, words: Sequence[str], never: frozenset[str]) -> float:
    """How well a column fits a channel that is called by these words; 0 where it does not."""
    own = words_of(name)
    if "_".join(own) == "_".join(words_of(channel)) or name == channel:
        fit = EXACT
    elif never & set(own) or not own:
        return 0.0
    else:
        asked = own[:-1] if len(own) > 1 and own[-1] in ("cmd", "command") else own
        fits = (max(_fit_of_word(own, word), _fit_of_word(asked, word)) for word in words)
        fit = max(0.0, *(found - LATER * place for place, found in enumerate(fits)))
    wanted = _NUMBERS.findall(channel)
    return fit - OTHER_NUMBER if fit and wanted and _NUMBERS.findall(_UNIT.sub("", name)) != wanted else fit


def _fit_of_word(own: list[str], word: str) -> float:
    parts = word.split("_")
    if own == parts:
        return FULL
    if own[-len(parts) :] == parts:
        return LAST
    return MEASURED if own == [f"{word}m"] else 0.0


def rate_words(position: str) -> tuple[str, ...]:
    """What the velocity of a position column is called, beside the words for velocities."""
    own = "_".join(words_of(position))
    ends = [f"{own}_{end}" for end in ("d", "dot", "vel", "velocity", "rate", "speed")]
    return (*ends, f"d_{own}", f"{own}d", f"{own}dot", f"d{own}", f"v_{own}", f"v{own}")


def drive_words(joint: str, unit: str) -> tuple[str, ...]:
    """What a column of a joint's torque is called, or of what its servo is told."""
    own = "_".join(words_of(joint))
    torque = ("tau", "torque", "effort", "u", "cmd", "command")
    target = ("target", "goal", "cmd", "command", "ref", "reference", "desired", "des", "setpoint")
    return tuple(f"{own}_{end}" for end in (torque if unit in ("N m", "N") else target))


FACTORS = {
    "mm": 1e-3, "cm": 1e-2, "km": 1e3, "deg": math.pi / 180.0, "rpm": math.pi / 30.0, "ms": 1e-3, "us": 1e-6,
    "ns": 1e-9,
}  # fmt: skip
"""Units that may stand before a source: what turns them into m, rad, rad/s and s."""
NOTHING = "none"
"""`force=none`: nobody commanded it."""
_DULL = ("header.", "data_offset", "layout.", "covariance", ".seq")
_SHOWN = 24  # sources that a message lists


@dataclass(frozen=True)
class Source:
    """A field of a topic, and the factor that turns it into the channel's unit. alone: its table is the only topic."""

    topic: str
    field: str
    scale: float = 1.0
    alone: bool = False

    @property
    def typed(self) -> str:
        """As it is typed behind `channel=`; without the field where the topic holds nothing else."""
        return self.field if self.alone else f"{self.topic}:{self.field}"

    def entry(self, unit: str, wraps: bool = False, kind: str = "field") -> dict[str, Any]:
        """The channel's entry of a mapping."""
        raw: dict[str, Any] = {} if self.alone else {"topic": self.topic}
        raw |= {kind: self.field} | ({"angle": "yaw"} if kind == "quaternion" else {}) | {"unit": unit}
        raw |= {"scale": self.scale} if self.scale != 1.0 else {}
        return raw | ({"wraps": True} if wraps else {})


def told_fields(topic: Topic) -> list[str]:
    """The fields that may be a channel: no headers, layouts and covariances."""
    return [field for field in topic.fields if not any(part in field for part in _DULL)]


def sources_of(topics: Sequence[Topic]) -> list[Source]:
    """Every field that may be a channel."""
    alone = len(topics) == 1
    return [Source(t.name, field, alone=alone) for t in topics if not t.fault for field in told_fields(t)]


def short(source: Source, topics: Sequence[Topic]) -> str:
    """How a source is typed at its shortest: a topic with one field by its name alone."""
    of_topic = [told_fields(topic) for topic in topics if topic.name == source.topic]
    return source.topic if not source.alone and of_topic and len(of_topic[0]) == 1 else source.typed


def read_source(channel: str, text: str, topics: Sequence[Topic]) -> Source:
    """`[-][FACTOR*]TOPIC:FIELD`, or TOPIC or FIELD alone where that is enough; raises UsageError with the alternatives.

    FACTOR: a number, or a unit as mm, deg.
    """
    found = _found(text, topics)
    if found is not None:
        return found
    scale, rest = (-1.0, text[1:]) if text.startswith("-") else (1.0, text)
    where = f"{channel}={one_line(text, 60)}"
    while "*" in rest:
        said, _, rest = rest.partition("*")
        try:
            factor = FACTORS.get(said.strip()) or float(said)
        except ValueError:
            factor = math.nan
        if not (math.isfinite(factor) and factor != 0.0):
            units = ", ".join(FACTORS)
            no = f"'{one_line(said.strip(), 30)}' is not a factor; give a number, or one of {units}"
            raise UsageError(f"{where}: {no}")
        scale *= factor
    rest = rest.strip()
    found = _found(rest, topics)
    if found is None:
        names = [short(source, topics) for source in sources_of(topics)]
        what = f"no column or topic '{one_line(rest, 40)}'{near(rest, names)}; there are: {listed(names)}"
        if several := [s.typed for s in sources_of(topics) if rest in (s.field, s.topic)]:
            what = f"which of {', '.join(several[:_SHOWN])}?"
        raise UsageError(f"{where}: {what}")
    return replace(found, scale=scale)


def _found(text: str, topics: Sequence[Topic]) -> Source | None:
    every, alone = sources_of(topics), len(topics) == 1
    for matches in (
        [s for s in every if f"{s.topic}:{s.field}" == text],
        [s for s in every if s.topic == text and short(s, topics) == text],
        [s for s in every if s.field == text],
    ):
        if len(matches) == 1:
            return matches[0]
    hidden = [(t, f) for t in topics for f in t.fields if text == f"{t.name}:{f}" or (alone and text == f)]
    return Source(hidden[0][0].name, hidden[0][1], alone=alone) if hidden else None


def listed(names: Sequence[str]) -> str:
    """Names in a line, not too many."""
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(one_line(name, 60) for name in names[:_SHOWN]) + more


UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
_YEARS = (3e8, 1e10)  # s after 1970 in which clocks of today count: 1979 to 2286
_USUAL = 0.02  # s; a usual step of logs of what moves: a hundredth and a hundred times of it are usual, too


def dated(t: FloatArray) -> str | None:
    """The unit that times after 1970 tell by their size alone, if it is not seconds."""
    size = float(np.median(np.abs(t[np.isfinite(t)]))) if np.isfinite(t).any() else 0.0
    return next(
        (n for n, scale in UNITS.items() if size > _YEARS[1] and _YEARS[0] <= size * scale <= _YEARS[1]), None
    )


def likely_unit(t: FloatArray, step: float) -> str | None:
    """The unit that a time column (N,) with this usual step looks to be in; None where seconds are as likely.

    A date tells it; else a step that is 1 or more as seconds, and that of a log of something that moves in the unit.
    (A step of 20 may be 20 ms: the caller knows what speaks for it.)
    """
    if dated(t) is not None or step < 1.0:
        return dated(t)
    away = {name: abs(np.log10(step * scale / _USUAL)) for name, scale in UNITS.items()}
    nearest = min(away, key=lambda name: away[name])
    return nearest if away[nearest] <= 2.0 else None


ALIKE = 0.75  # of 1: names so much alike are a slip of the pen


def alike(name: str, columns: Sequence[str]) -> str | None:
    """The column that is nearly called so, a slip of the pen; None where none is."""
    lower = {column.lower(): column for column in columns}
    near = difflib.get_close_matches(name.lower(), lower, n=1, cutoff=ALIKE)
    return lower[near[0]] if near else None


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

    names: the columns that it is of; plain: told by a column in seconds that is called so.
    """

    raw: dict[str, Any] = field(default_factory=dict)
    names: Sequence[str] = ()
    taken: tuple[str, str] | None = None
    unclear: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    missing: bool = False
    plain: bool = False


def _clock_of(tables: Sequence[Topic], given: Mapping[str, str], values: Values, beside: list[str]) -> Clock:
    """Of tables; of a bag nothing, whose messages have stamps.

    given: `t=...` and `dt=...` as typed; beside: words of the columns of the state, which a clock may share.
    """
    if not tables:
        return Clock()
    every = [name for name in tables[0].fields if all(name in table.fields for table in tables)]
    fields = every or list(tables[0].fields)
    if TIME in given:
        source = read_source(TIME, given[TIME], tables)
        return _column(source.field, tables, values, source.scale, given[TIME])
    pair = next((p for p in SECONDS if set(p) <= set(fields)), None)
    if pair is not None:
        raw = {"time": {"seconds": pair[0], "nanoseconds": pair[1]}}
        return Clock(raw, pair, remarks=[f"time from {pair[0]} and {pair[1]}"])
    named = [name for name in fields if TIMES & set(words_of(name)) and not NOT & set(words_of(name))]
    exact = [name for name in named if "_".join(words_of(name)) in TIMES]
    chosen = [name for name in named if beside and words_of(name)[:-1] == beside] or exact or named
    if "dt" in given and not exact:
        step = float(given["dt"])
        if not (np.isfinite(step) and step > 0):
            raise UsageError(f"dt={given['dt']}: give the seconds per row, as dt=0.01")
        return _even(step)
    if chosen:
        made = _column(chosen[0], tables, values)
        made.unclear, made.names = (chosen if len(chosen) > 1 else made.unclear), chosen
        return made
    told = next((name for name in fields if "_".join(words_of(name)) in STEPS), None)
    if told is not None:
        column = values(tables[0].name, told)
        steps = np.unique(column[np.isfinite(column)])
        if len(steps) == 1 and 0 < steps[0] < np.inf:
            made = _even(float(steps[0]))
            made.names, made.remarks = [told], [f"{told} says a row every {steps[0]:g} s"]
            return made
    return Clock(missing=True)


def _even(step: float) -> Clock:
    return Clock({"time": {"step": step}, "gap_limit": max(USUAL, GAP * step)}, taken=("dt", f"{step:g}"))


def _column(
    name: str, tables: Sequence[Topic], values: Values, scale: float | None = None, typed: str | None = None
) -> Clock:
    made = Clock(names=[name], taken=(TIME, typed or name))
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
VEHICLE = {"x": "m", "y": "m", "yaw": "rad"}
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
    """x, y and yaw of a topic, or of columns of one. name: as it is typed behind `pose=`; kind: of yaw's entry.

    rate: of the messages [Hz], if known.
    """

    topic: str
    name: str
    sources: Mapping[str, Source]
    kind: str = "quaternion"
    rate: float | None = None


def _often(topics: Sequence[Topic]) -> list[Topic]:
    return sorted(topics, key=lambda topic: -topic.count)


def _poses_of(topics: Sequence[Topic]) -> list[Pose]:
    """Every pose in the log, the most often told first."""
    alone, found = len(topics) == 1, []
    for topic in _often(topics):
        if topic.type in POSES:
            position, turned = POSES[topic.type]
            known = topic.start is not None and topic.end is not None and topic.end > topic.start
            rate = (topic.count - 1) / (topic.end - topic.start) if known else None  # type: ignore[operator]
            fields = {"x": f"{position}.x", "y": f"{position}.y", "yaw": turned}
            sources = {name: Source(topic.name, field, alone=alone) for name, field in fields.items()}
            found.append(Pose(topic.name, topic.name, sources, rate=rate))
        elif topic.type == "table":
            found += _of_columns(topic, alone)
    return found


def _of_columns(topic: Topic, alone: bool) -> list[Pose]:
    """x, y and a heading with the same words before them, as `vicon x`, `vicon y`, `vicon yaw`."""
    groups: dict[str, dict[str, str]] = {}
    for name in topic.fields:
        words = words_of(name)
        if words and not NO_STATE & set(words) and "." not in name:
            part = "yaw" if words[-1] in WORDS["heading"] else words[-1]
            groups.setdefault(" ".join(words[:-1]), {}).setdefault(part, name)
    bases = [name.removesuffix(".w") for name in topic.fields if name.endswith(".w")]
    turned = next((base for base in bases if {f"{base}.{part}" for part in "xyz"} <= set(topic.fields)), None)
    found = []
    for prefix, parts in groups.items():
        kind, yaw = ("field", parts["yaw"]) if "yaw" in parts else ("quaternion", turned)
        if {"x", "y"} <= set(parts) and yaw is not None:
            sources = {
                name: Source(topic.name, column, 1.0 if column == turned else factor_of(column, unit), alone)
                for (name, unit), column in zip(VEHICLE.items(), (parts["x"], parts["y"], yaw), strict=True)
            }
            called = topic.name if not prefix else prefix if alone else f"{topic.name}:{prefix}"
            found.append(Pose(topic.name, called, sources, kind))
    return found


def _command_of(channel: str, topics: Sequence[Topic]) -> list[Source]:
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


class _Joints:
    """The topics that name joints, the most often told first; asked: those of them that ask something of these."""

    def __init__(self, topics: Sequence[Topic]) -> None:
        self.alone = len(topics) == 1
        self.every = _often([topic for topic in topics if topic.type == JOINT_STATE])
        self.asked = [topic for topic in self.every if ASKING & set(words_of(topic.name))]
        self.told = [topic for topic in self.every if topic not in self.asked]

    def named(self, topics: Sequence[Topic], name: str, kind: str) -> list[Source]:
        """Where this is told of a joint: its position, velocity or effort."""
        field = f"{kind}[name={name}]"
        return [Source(topic.name, field, alone=self.alone) for topic in topics if field in topic.fields]

    def command(self, name: str, unit: str, joint: str | None) -> list[Source]:
        """Where an actuator's command is told, by its own name or by that of the joint that it drives.

        Of a motor that nobody tells a command, it is the torque that was measured at its joint.
        """
        kind = {"rad": POSITION, "m": POSITION, "rad/s": VELOCITY, "m/s": VELOCITY}.get(unit, EFFORT)
        for called in dict.fromkeys((name, name.removesuffix("_cmd"), joint)):
            fields = [m for topic in self.asked for f in topic.fields if (m := _NAMED.fullmatch(f))]
            kinds = {m[1] for m in fields if m[2] == called}
            for part in (kind, *(kinds if len(kinds) == 1 else ())):
                if called is not None and (found := self.named(self.asked, called, part)):
                    return found
        found = self.named(self.every, name, kind) if name != joint else []
        return found or self.named(self.told if unit in TORQUES else [], joint or name, EFFORT)


@dataclass(frozen=True)
class System:
    """What a log is compared with. velocities: velocity -> the position it is of; optional: need not be recorded.

    drives: action -> the joint that it moves; model: the file of a system that a recording calls `recorded_as`;
    integrator: how the base simulator steps.
    """

    name: str
    state: Channels
    action: Channels
    velocities: Mapping[str, str]
    optional: tuple[str, ...] = ()
    drives: Mapping[str, str] = field(default_factory=dict)
    recorded_as: str = ""
    model: str | None = None
    integrator: str = ""

    @property
    def is_vehicle(self) -> bool:
        """Whether its state is a pose in the plane."""
        return self.state.names == tuple(VEHICLE)


SURE = 2.0  # a fit that is more than its last word
AS_GOOD = 0.05  # fits that differ by less are a tie
SWITCHES = frozenset({"safety", "enable", "enabled", "armed", "estop", "deadman", "engaged"})
_ACTIONS = {
    "N": "force", "N m": "torque", "m/s": "speed_command", "rad/s": "turn_command", "rad": "steering_command",
}  # fmt: skip


def guess(topics: Sequence[Topic], system: System, given: Mapping[str, str], values: Values) -> Guess:
    """The mapping that the names of topics and columns suggest; given: `channel: source` as typed, which is kept.

    Raises UsageError where what is given cannot be.
    """
    known = [*system.state.names, *system.action.names, TIME, "dt", *([POSE] * system.is_vehicle)]
    for name, typed in given.items():
        if name not in known:
            there = ", ".join(known)
            raise UsageError(f"{name}={typed}: no channel of {system.name}; there are: {there}")
    made = Guess(system, [topic for topic in topics if topic.count and not topic.fault], given)
    made.find(values)
    return made


@dataclass
class Guess:
    """A mapping, and how it came about.

    topics: that can be read; given: channel -> source as typed; taken: the same of what was found; missing: channels
    without a sure source, with what might be theirs; unclear: channels whose source is likely, with the others; typed:
    every channel is told by the type of a message; switch: a source that may say when the motors were on, and the words
    that cut the log by it; fit: of the names, summed.
    """

    system: System
    topics: Sequence[Topic]
    given: Mapping[str, str]
    taken: dict[str, str] = field(default_factory=dict)
    missing: dict[str, list[str]] = field(default_factory=dict)
    unclear: dict[str, list[str]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    typed: bool = True
    switch: tuple[str, str] | None = None
    fit: float = 0.0

    def __post_init__(self) -> None:
        self.raw: dict[str, Any] = {"system": self.system.recorded_as or self.system.name, "rate": "source"}
        self.raw |= {"model": self.system.model} if self.system.model is not None else {}
        self.raw |= {"state": {}, "action": {}}
        self._joints = _Joints(self.topics)
        self._used: set[tuple[str, str]] = set()

    @property
    def complete(self) -> bool:
        """Whether nothing is left to ask."""
        return not self.missing and not self.unclear

    def find(self, values: Values) -> None:
        """Look for every channel, and for what tells the time."""
        if self.system.is_vehicle and not any(name in self.given for name in VEHICLE):
            self._take_pose()
        beside = words_of(self.taken.get(POSE, "").rpartition(":")[2])
        tables = [topic for topic in self.topics if topic.type == "table"]
        clock = _clock_of(tables, self.given, values, beside)
        self._used |= {(table.name, name) for table in tables for name in clock.names}
        for channel in self.system.state if not self.raw["state"] else ():
            self._measure(channel)
        for channel in self.system.action:
            self._command(channel)
        for source in sources_of(self.topics):  # a command is obeyed only when the motors are on
            if SWITCHES & set(words_of(self._called(source))):
                at = [] if source.alone else [f"episodes.topic={source.topic}"]
                words = ["episodes.by=flag", *at, f"episodes.field={source.field}", "episodes.equals=1"]
                self.switch = short(source, self.topics), " ".join(shlex.quote(word) for word in words)
                break
        self.raw |= clock.raw
        self.remarks += clock.remarks
        if clock.missing:
            self.missing[TIME] = [source.typed for source in sources_of(self.topics)]
        if clock.unclear:
            self.unclear[TIME] = clock.unclear
        if clock.taken and (clock.unclear or not clock.plain):
            self.taken[clock.taken[0]] = clock.taken[1]
        if len(self.topics) == 1 and "episode" in (*self.topics[0].fields, *self.topics[0].texts):
            self.raw["episodes"] = {"by": "column", "field": "episode"}

    def _take_pose(self) -> None:
        poses, named = _poses_of(self.topics), self.given.get(POSE)
        if named is None and len(poses) > 1:
            self.unclear[POSE] = [pose.name for pose in poses]
        chosen = next((pose for pose in poses if named in (None, pose.name, pose.topic)), None)
        if named is not None and chosen is None:
            there = ", ".join(pose.name for pose in poses) or "none; name x, y and yaw separately"
            raise UsageError(f"pose={named}: no such pose; found: {there}")
        if chosen is None:
            return
        self._used |= {(chosen.topic, source.field) for source in chosen.sources.values()}
        self.typed &= chosen.name == chosen.topic
        turned = chosen.kind == "quaternion"
        if not turned and any(source.scale != 1.0 for source in chosen.sources.values()):
            self.taken |= {name: self._typed(source) for name, source in chosen.sources.items()}
        else:
            self.taken[POSE] = chosen.name
        self.fit += EXACT * len(VEHICLE)
        if chosen.rate:
            self.raw |= {"rate": min(50, max(1, round(chosen.rate)))}
        self.raw["state"] |= {
            name: source.entry(VEHICLE[name], name == "yaw", chosen.kind if name == "yaw" else "field")
            for name, source in chosen.sources.items()
        }

    def _measure(self, channel: Channel) -> None:
        name = channel.name
        of, optional = self.system.velocities.get(name), name in self.system.optional
        if self.given.get(name) == NOTHING and (of is not None or optional):
            return
        typed = self._joints.named(self._joints.told, of or name, VELOCITY if of else POSITION)
        words = _state_words(channel, of, self.taken.get(of or "", ""))
        if self._found(channel, "state", typed, words, NO_STATE):
            return
        if of is not None and of in self.raw["state"] and not optional:
            self.raw["state"][name] = {"derivative_of": of, "unit": channel.unit}
            self.remarks.append(f"{name} is differentiated from {of}")
        elif of not in self.missing and not optional:
            self.missing[name] = self._unused(NO_STATE)

    def _command(self, channel: Channel) -> None:
        name = channel.name
        if self.given.get(name) == NOTHING:
            self.taken[name] = NOTHING
            return
        joint = self.system.drives.get(name)
        typed = _command_of(name, self.topics) or self._joints.command(name, channel.unit, joint)
        of_joint = drive_words(joint, channel.unit) if joint else ()
        words = (*of_joint, *WORDS.get(_ACTIONS.get(channel.unit, ""), (name, "u", "input")))
        if not self._found(channel, "action", typed, words, NO_ACTION):
            self.missing[name] = self._unused(NO_ACTION)

    def _found(
        self,
        channel: Channel,
        role: str,
        typed: Sequence[Source],
        words: Sequence[str],
        never: frozenset[str],
    ) -> bool:
        """Take what is given, else what the type of a message tells, else the name that fits best, if one does."""
        name = channel.name
        if name in self.given:
            self._take(channel, role, read_source(name, self.given[name], self.topics))
            return True
        if typed:
            self._take(channel, role, typed[0])
            self.fit += EXACT
            if len(typed) > 1:
                self.unclear[name] = [short(source, self.topics) for source in typed]
            return True
        fits = [(likeness(self._called(s), name, words, never), s) for s in self._free()]
        best = max((fit for fit, _ in fits), default=0.0)
        if best <= 0.0 or (best < SURE and role == "action"):
            return False  # another's command would do, and say something else
        chosen = as_good = [source for fit, source in fits if fit > best - AS_GOOD]
        if len(as_good) == 1 and best < SURE:
            chosen = [s for fit, s in sorted(fits, key=lambda pair: -pair[0]) if fit > 0.0]
        if len(as_good) > 1 or best < SURE:
            self.unclear[name] = [short(source, self.topics) for source in chosen]
        self.typed = False
        self._take(channel, role, replace(as_good[0], scale=factor_of(as_good[0].field, channel.unit)))
        self.fit += best
        return True

    def _free(self) -> list[Source]:
        return [s for s in sources_of(self.topics) if (s.topic, s.field) not in self._used]

    def _unused(self, never: frozenset[str]) -> list[str]:
        """What might be a channel's: sources that are nobody's, those that a name speaks against at the end."""
        free = sorted(self._free(), key=lambda source: bool(never & set(words_of(self._called(source)))))
        return [short(source, self.topics) for source in free]

    def _called(self, source: Source) -> str:
        """A scalar message is called as its topic; a field is as what it holds."""
        name = short(source, self.topics)
        return name if name != source.typed else source.field

    def _take(self, channel: Channel, role: str, source: Source) -> None:
        wraps = channel.wraps or channel.name == "yaw"
        self.raw[role][channel.name] = source.entry(channel.unit, wraps)
        self._used.add((source.topic, source.field))
        self.taken[channel.name] = self._typed(source)

    def _typed(self, source: Source) -> str:
        """The source and its factor, as they are typed behind `channel=`."""
        angle = next((f"{unit}*" for unit in ("deg", "rpm") if source.scale == FACTORS[unit]), "")
        factor = {1.0: "", -1.0: "-"}.get(source.scale, angle or f"{source.scale:.6g}*")
        return f"{factor}{short(source, self.topics)}"


def _state_words(channel: Channel, of: str | None, position: str) -> tuple[str, ...]:
    """What the state may be called; of: what it is the velocity of, if it is one, and the column of that."""
    name, unit = channel.name, channel.unit
    if of is not None:
        kind = "angular_velocity" if unit.startswith("rad") else "velocity"
        column = position.rpartition(":")[2].lstrip("-").rpartition("*")[2]
        own = "_".join(words_of(of))
        return (*rate_words(column), f"{own}_velocity", f"{own}_vel", *WORDS[kind])
    if name in ("yaw", "x", "y"):
        return (*WORDS["heading" if name == "yaw" else name], *(WORDS["position"] if name == "x" else ()))
    if unit not in ("rad", "m"):
        return (name, "y", "output")
    words = WORDS["angle" if unit == "rad" else "position"]
    return (*words, *(f"{'_'.join(words_of(name))}_{end}" for end in ("position", "pos", "angle", "q")))


TIME_COLUMNS = ("t", "time", "timestamp", "Time", "time [s]")
"""What the time column of a table is called where nobody says so."""
_COMMANDS = frozenset({"cmd", "command", "commanded", "control", "ctrl", "input", "u"})
"""Words of a column that is an action of whatever it may be."""


def likeliest(guesses: Sequence[Guess]) -> Guess:
    """The one that leaves least to ask, and of those the one whose names fit best."""
    return min(guesses, key=lambda one: (len(one.missing), -one.fit))


def proposal(topics: Sequence[Topic], found: Guess) -> tuple[str, dict[str, str]]:
    """A mapping to start from, as YAML, and what each column was taken for; what nobody can tell is a '?'.

    found: the likeliest guess; where it lacks a state, the log is of something else.
    """
    lacking = [name for name in found.system.state.names if name in found.missing]
    raw, asked = dict(found.raw), []
    if lacking and len(topics) == 1:
        raw = _unknown(topics[0], found)
        asked = ["rename the channels to those of the system", "actions are what was commanded"]
    elif lacking:
        raw = {"system": "?", "rate": 50, "state": {}, "action": {}}
        asked = ["fill in state and action from the fields above"]
    else:
        raw |= {"integrator": found.system.integrator} if found.system.integrator else {}
        at = {} if len(topics) == 1 else {"topic": "?"}
        lost = [name for name in found.system.action.names if name in found.missing]
        units = found.system.action.units
        raw["action"] = raw["action"] | {name: {**at, "field": "?", "unit": units[name]} for name in lost}
        asked += [f"{name} may be {listed(found.missing[name][:_FEW])}" for name in lost]
        asked += [
            f"{name} may be {listed([found.taken[name], *(n for n in names if n != found.taken[name])][:_FEW])}"
            for name, names in found.unclear.items()
        ]
        asked += [f"{name} is in {unit}, unless you change it" for name, unit in units.items()]
    if TIME in found.missing:
        raw["time"] = {"field": "?"}
    text = yaml.safe_dump(raw, sort_keys=False, default_flow_style=None, width=110)
    head = "fill in every '?'" if "'?'" in text else "check it" if found.unclear else "complete"
    lines = "".join(f"# {line}\n" for line in (f"proposed mapping: {head}", *asked))
    return f"{lines}{text}", _roles(raw)


_FEW = 10  # candidates of a channel that a proposal lists


def _unknown(topic: Topic, found: Guess) -> dict[str, Any]:
    """The columns of a table of nobody knows what: told apart by their words, in the units of their names."""
    raw: dict[str, Any] = {"system": "?", "rate": "source"}
    raw |= {key: found.raw[key] for key in ("episodes", "time", "gap_limit") if key in found.raw}
    raw |= {"state": {}, "action": {}}
    told = {str(value) for value in raw.get("time", {}).values()}
    for name in topic.fields:
        if name in told or name == "episode":
            continue
        own = unit_of(name)
        base, per = own.removesuffix("/s"), "/s" if own.endswith("/s") else ""
        unit = f"{_SI[base]}{per}" if base in _SI else own or "?"
        section = "action" if _COMMANDS & set(words_of(name)) else "state"
        raw[section][name] = Source(topic.name, name, factor_of(name, unit), alone=True).entry(unit)
    return raw


def _roles(raw: Mapping[str, Any]) -> dict[str, str]:
    """Field -> what it is read as, of a mapping of one table."""
    time = raw.get("time", {})
    roles = {str(value): "time" for key, value in time.items() if key in ("field", "seconds", "nanoseconds")}
    roles |= {time["field"]: f"time [{time['scale']:g} s]"} if "scale" in time else {}
    for section in ("state", "action"):
        for name, entry in raw[section].items():
            scale = f" times {entry['scale']:.6g}" if "scale" in entry else ""
            if "field" in entry:
                roles[str(entry["field"])] = f"{section} {name} [{entry['unit']}]{scale}"
    return roles


def bare_mapping(
    named: NamedLog, system: str, systems: Mapping[str, tuple[Channels, Channels]]
) -> dict[str, Any]:
    """The mapping of a table whose columns are called as the channels of `system`.

    Raises UsageError naming the columns that lack, or asking for a mapping where the log is no table.
    """
    topics = named.log.topics()
    if len(topics) != 1:
        raise UsageError(
            f"{named.name}: {len(topics)} topics; assign them to channels with --mapping NAME_OR_FILE (gpsim import "
            "--inspect proposes one)"
        )
    if not system:
        raise UsageError(
            f"{named.name}: no --mapping; `gpsim import --inspect` shows what is inside and proposes one (its system "
            "may be your own, as my_system.py:ClassName); or use system=NAME if the columns have the channel names "
            f"of {', '.join(systems)}"
        )
    if system not in systems:
        raise UsageError(f"{named.name}: no simulator '{system}'; there are: {', '.join(systems)}")
    (state, action), fields = systems[system], topics[0].fields
    time = next((name for name in TIME_COLUMNS if name in fields), None)
    if not set(action.names) & set(fields) and not any(alike(name, fields) for name in action.names):
        action = Channels(())  # nobody commanded it
    lacking = [name for name in (*state.names, *action.names) if name not in fields]
    if time is None or lacking:
        what = ", ".join([*([] if time else ["t"]), *lacking])
        raise UsageError(
            f"{named.name}: column(s) {what} missing for {system}; there are: {', '.join(fields[:30])}"
        )
    raw: dict[str, Any] = {"system": system, "rate": "source", "time": {"field": time}}
    if "episode" in (*fields, *topics[0].texts):
        raw["episodes"] = {"by": "column", "field": "episode"}
    raw["state"] = {
        c.name: {"field": c.name, "unit": c.unit} | ({"wraps": True} if c.wraps else {}) for c in state
    }
    raw["action"] = {c.name: {"field": c.name, "unit": c.unit} for c in action}
    return raw
