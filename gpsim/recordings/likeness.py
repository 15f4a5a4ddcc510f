"""How well a column's name fits a channel: by the words that roboticists use for it."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.raw import Topic
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
    "turn_command": ("w_cmd", "cmd_w", "omega", "angular", "turn_rate", "yaw_rate", "w"),
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
_UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")


def words_of(name: str) -> list[str]:
    """`angleD [rad/s]` -> [angle, d]; numbers apart, units and slashes left out."""
    bare = _UNIT.sub("", name)
    bare = re.sub(r"([a-z])([A-Z])", r"\1 \2", bare)
    return [word for word in re.split(r"[^a-zA-Z]+", bare.lower()) if word]


def unit_of(name: str) -> str:
    """The unit that a column's name ends in, as `[deg]` or `(ms)`; empty without one."""
    found = _UNIT.search(name)
    return found[1].strip() if found else ""


def likeness(name: str, channel: str, words: Sequence[str], never: frozenset[str]) -> float:
    """How well a column fits a channel that is called by these words; 0 where it does not."""
    fit = _fit_of_words(name, channel, words, never)
    wanted = _NUMBERS.findall(channel)
    return fit - OTHER_NUMBER if fit and wanted and _NUMBERS.findall(_UNIT.sub("", name)) != wanted else fit


def _fit_of_words(name: str, channel: str, words: Sequence[str], never: frozenset[str]) -> float:
    own = words_of(name)
    joined = "_".join(own)
    if joined == "_".join(words_of(channel)) or name == channel:
        return EXACT
    if never & set(own) or not own:
        return 0.0
    fits = [_fit_of_word(own, word) - LATER * place for place, word in enumerate(words)]
    return max(0.0, *fits)


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

    def entry(self, unit: str, wraps: bool = False) -> dict[str, Any]:
        """The channel's entry of a mapping."""
        raw: dict[str, Any] = {} if self.alone else {"topic": self.topic}
        raw |= {"field": self.field, "unit": unit}
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
    scale, rest = 1.0, text
    if rest.startswith("-"):
        scale, rest = -1.0, rest[1:]
    while "*" in rest:
        factor, _, rest = rest.partition("*")
        scale *= _factor(factor.strip(), channel, text)
    found = _found(rest.strip(), topics)
    if found is None:
        raise UsageError(f"{channel}={one_line(text, 60)}: {_nothing_called(rest.strip(), topics)}")
    return Source(found.topic, found.field, scale, found.alone)


def _factor(text: str, channel: str, word: str) -> float:
    try:
        value = FACTORS[text] if text in FACTORS else float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value != 0.0):
        raise UsageError(
            f"{channel}={one_line(word, 60)}: '{one_line(text, 30)}' is no factor; give a number, or one of "
            f"{', '.join(FACTORS)}"
        )
    return value


def _found(text: str, topics: Sequence[Topic]) -> Source | None:
    every = sources_of(topics)
    for matches in (
        [s for s in every if f"{s.topic}:{s.field}" == text],
        [s for s in every if s.topic == text and short(s, topics) == text],
        [s for s in every if s.field == text],
    ):
        if len(matches) == 1:
            return matches[0]
    hidden = [
        (t, f)
        for t in topics
        for f in t.fields
        if text in (f"{t.name}:{f}", *([f] if len(topics) == 1 else []))
    ]
    return Source(hidden[0][0].name, hidden[0][1], alone=len(topics) == 1) if hidden else None


def _nothing_called(text: str, topics: Sequence[Topic]) -> str:
    names = [short(source, topics) for source in sources_of(topics)]
    near = difflib.get_close_matches(text, names, n=1)
    several = [s.typed for s in sources_of(topics) if text in (s.field, s.topic)]
    if several:
        return f"which of {', '.join(several[:_SHOWN])}?"
    hint = f"; did you mean {near[0]}?" if near else ""
    return f"no column or topic '{one_line(text, 40)}'{hint} There are: {listed(names)}"


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
