"""What a log is compared with, and what was guessed of it."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gpsim.channels import Channel, Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.recordings.guessing_poses import (
    POSE,
    command_of,
    fitting_pose,
    joint_command,
    measured_joint,
    poses_of,
)
from gpsim.recordings.guessing_time import TIME, Clock, clock_of
from gpsim.recordings.likeness import (
    EXACT,
    FACTORS,
    NO_ACTION,
    NO_STATE,
    NOTHING,
    WORDS,
    Source,
    likeness,
    rate_words,
    read_source,
    short,
    sources_of,
    unit_of,
    words_of,
)
from gpsim.recordings.raw import Topic

VEHICLE = ("x", "y", "yaw")


@dataclass(frozen=True)
class System:
    """What a log is compared with. velocities: velocity -> the position it is of; optional: need not be recorded.

    drives: action -> the joint that it moves; model: the file of a system that a recording calls `recorded_as`.
    """

    name: str
    state: Channels
    action: Channels
    velocities: Mapping[str, str]
    optional: tuple[str, ...] = ()
    drives: Mapping[str, str] = field(default_factory=dict)
    recorded_as: str = ""
    model: str | None = None

    @property
    def is_vehicle(self) -> bool:
        """Whether its state is a pose in the plane."""
        return self.state.names == VEHICLE


@dataclass
class Guess:
    """A mapping, and how it came about.

    taken: channel -> source as it is typed; missing: channels for which nothing sure was found, with what might be
    theirs; unclear: channels whose source is likely, with the others; typed: every channel is told by the type of a
    message; switch: a source that may say when the motors were on, and the words that cut the log by it; fit: how well
    the names fit, summed.
    """

    system: System
    raw: dict[str, Any]
    taken: dict[str, str] = field(default_factory=dict)
    missing: dict[str, list[str]] = field(default_factory=dict)
    unclear: dict[str, list[str]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    typed: bool = True
    switch: tuple[str, str] | None = None
    fit: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether nothing is left to ask."""
        return not self.missing and not self.unclear


Values = Callable[[str, str], FloatArray]
"""Reads a field of a topic: (topic, field) -> (N,)."""
SURE = 2.0  # a fit that is more than its last word
AS_GOOD = 0.05  # fits that differ by less are a tie
SWITCHES = frozenset({"safety", "enable", "enabled", "armed", "estop", "deadman", "engaged"})


def guess(topics: Sequence[Topic], system: System, given: Mapping[str, str], values: Values) -> Guess:
    """The mapping that the names of topics and columns suggest; given: `channel: source` as typed, which is kept.

    Raises UsageError where what is given cannot be.
    """
    topics = [topic for topic in topics if topic.count and not topic.fault]
    made = Guess(system, {"system": system.recorded_as or system.name, "rate": "source"})
    made.raw |= {"model": system.model} if system.model is not None else {}
    _check_given(given, system)
    state: dict[str, Any] = {}
    action: dict[str, Any] = {}
    used: set[tuple[str, str]] = set()
    if system.is_vehicle and not any(name in given for name in VEHICLE):
        state = _pose(made, topics, given.get(POSE), used)
    beside = made.taken.get(POSE, "").rpartition(":")[2]
    clock = clock_of(topics, given.get(TIME), given.get("dt"), values, beside)
    used |= clock.used
    for channel in system.state if not state else ():
        _state_channel(made, state, channel, topics, given, used)
    for channel in system.action:
        _action_channel(made, action, channel, topics, given, used)
    made.switch = _switch(topics)
    made.raw |= {"state": state, "action": action}
    _add_clock(made, clock, topics)
    return made


def _switch(topics: Sequence[Topic]) -> tuple[str, str] | None:
    """What may say when the motors were on: a command is obeyed only then."""
    for source in sources_of(topics):
        name = _called(source, topics)
        if SWITCHES & set(words_of(name)):
            at = [] if source.alone else [f"episodes.topic={source.topic}"]
            words = ["episodes.by=flag", *at, f"episodes.field={source.field}", "episodes.equals=1"]
            return short(source, topics), " ".join(shlex.quote(word) for word in words)
    return None


def _check_given(given: Mapping[str, str], system: System) -> None:
    known = [*system.state.names, *system.action.names, TIME, "dt", *([POSE] if system.is_vehicle else [])]
    for name in given:
        if name not in known:
            raise UsageError(
                f"{name}={given[name]}: no channel of {system.name}; there are: {', '.join(known)}"
            )


def _pose(
    made: Guess, topics: Sequence[Topic], given: str | None, used: set[tuple[str, str]]
) -> dict[str, Any]:
    """The pose's three channels; empty where no topic has one."""
    poses = poses_of(topics)
    if given is not None:
        chosen = fitting_pose(given, poses)
    elif not poses:
        return {}
    else:
        chosen = poses[0]
        if len(poses) > 1:
            made.unclear[POSE] = [pose.name for pose in poses]
    used |= {(chosen.topic, name) for name in (chosen.x, chosen.y, chosen.yaw)}
    made.typed &= not chosen.prefix
    made.taken[POSE] = chosen.name
    made.fit += EXACT * len(VEHICLE)
    if chosen.rate:
        made.raw |= {"rate": min(50, max(1, round(chosen.rate)))}
    return chosen.entries()


def _state_channel(
    made: Guess,
    state: dict[str, Any],
    channel: Channel,
    topics: Sequence[Topic],
    given: Mapping[str, str],
    used: set[tuple[str, str]],
) -> None:
    name, of = channel.name, made.system.velocities.get(channel.name)
    if given.get(name) == NOTHING and (of is not None or name in made.system.optional):
        return
    if name in given:
        _take(made, state, channel, read_source(name, given[name], topics), topics, used)
        return
    if _take_typed(made, state, channel, measured_joint(name, of, topics), topics, used):
        return
    words = _state_words(channel, None if of is None else made.taken.get(of, ""))
    if _best(made, state, channel, topics, words, NO_STATE, used):
        return
    if of is not None and of in state and name not in made.system.optional:
        state[name] = {"derivative_of": of, "unit": channel.unit}
        made.remarks.append(f"{name} is differentiated from {of}")
    elif of not in made.missing and name not in made.system.optional:
        made.missing[name] = _unused(topics, used)


def _state_words(channel: Channel, position: str | None) -> tuple[str, ...]:
    """What the state may be called; position: the column of what it is the velocity of, None where it is none."""
    if position is not None:
        kind = "angular_velocity" if channel.unit.startswith("rad") else "velocity"
        column = position.rpartition(":")[2].lstrip("-").rpartition("*")[2]
        return (*rate_words(column), *WORDS[kind])
    if channel.name in ("yaw", "x", "y"):
        return WORDS["heading"] if channel.name == "yaw" else (*WORDS[channel.name], *_cart(channel.name))
    if channel.unit == "rad":
        return WORDS["angle"]
    return WORDS["position"] if channel.unit == "m" else (channel.name, "y", "output")


def _cart(name: str) -> tuple[str, ...]:
    return WORDS["position"] if name == "x" else ()


_ACTIONS = {
    "N": "force",
    "N m": "torque",
    "m/s": "speed_command",
    "rad/s": "turn_command",
    "rad": "steering_command",
}


def _action_channel(
    made: Guess,
    action: dict[str, Any],
    channel: Channel,
    topics: Sequence[Topic],
    given: Mapping[str, str],
    used: set[tuple[str, str]],
) -> None:
    name = channel.name
    if given.get(name) == NOTHING:
        made.taken[name] = NOTHING
        return
    if name in given:
        _take(made, action, channel, read_source(name, given[name], topics), topics, used)
        return
    typed = command_of(name, topics)
    typed = typed or joint_command(name, channel.unit, made.system.drives.get(name), topics)
    if _take_typed(made, action, channel, typed, topics, used):
        return
    words = WORDS.get(_ACTIONS.get(channel.unit, ""), (name, "u", "input"))
    if not _best(made, action, channel, topics, words, NO_ACTION, used):
        made.missing[name] = _unused(topics, used, never=NO_ACTION)


def _take_typed(
    made: Guess,
    entries: dict[str, Any],
    channel: Channel,
    typed: Sequence[Source],
    topics: Sequence[Topic],
    used: set[tuple[str, str]],
) -> bool:
    """Take the first of the sources that the type of a message tells, if there is one."""
    if not typed:
        return False
    _take(made, entries, channel, typed[0], topics, used)
    made.fit += EXACT
    if len(typed) > 1:
        made.unclear[channel.name] = [short(source, topics) for source in typed]
    return True


def _unused(
    topics: Sequence[Topic], used: set[tuple[str, str]], never: frozenset[str] = NO_STATE
) -> list[str]:
    """What might be a channel's: sources that are nobody's, those that a name speaks against at the end."""
    free = [s for s in sources_of(topics) if (s.topic, s.field) not in used]
    against = [bool(never & set(words_of(_called(s, topics)))) for s in free]
    kept = sorted(zip(against, range(len(free)), strict=True))
    return [short(free[i], topics) for _, i in kept]


def _best(
    made: Guess,
    entries: dict[str, Any],
    channel: Channel,
    topics: Sequence[Topic],
    words: Sequence[str],
    never: frozenset[str],
    used: set[tuple[str, str]],
) -> bool:
    """Take the source that fits best, if one does."""
    fits = [
        (likeness(_called(source, topics), channel.name, words, never), source)
        for source in sources_of(topics)
        if (source.topic, source.field) not in used
    ]
    best = max((fit for fit, _ in fits), default=0.0)
    if best <= 0.0:
        return False
    as_good = [source for fit, source in fits if fit > best - AS_GOOD]
    if best < SURE and channel in made.system.action:
        return False  # another's command would do, and say something else
    if len(as_good) > 1:
        made.unclear[channel.name] = [short(source, topics) for source in as_good]
    elif best < SURE:
        others = [short(s, topics) for fit, s in sorted(fits, key=lambda pair: -pair[0]) if fit > 0.0]
        made.unclear[channel.name] = others
    made.typed = False
    chosen = as_good[0]
    factor = FACTORS.get(unit_of(chosen.field).removesuffix("/s"), 1.0)
    _take(made, entries, channel, Source(chosen.topic, chosen.field, factor, chosen.alone), topics, used)
    made.fit += best
    return True


def _called(source: Source, topics: Sequence[Topic]) -> str:
    """A scalar message is called as its topic; a field is as what it holds."""
    name = short(source, topics)
    return name if name != source.typed else source.field


def _take(
    made: Guess,
    entries: dict[str, Any],
    channel: Channel,
    source: Source,
    topics: Sequence[Topic],
    used: set[tuple[str, str]],
) -> None:
    entries[channel.name] = source.entry(channel.unit, channel.wraps or channel.name == "yaw")
    used.add((source.topic, source.field))
    factor = "" if source.scale == 1.0 else "-" if source.scale == -1.0 else f"{source.scale:.6g}*"
    made.taken[channel.name] = f"{factor}{short(source, topics)}"


def _add_clock(made: Guess, clock: Clock, topics: Sequence[Topic]) -> None:
    """How the tables tell the time; a bag's topics have stamps."""
    made.raw |= clock.raw
    made.remarks += clock.remarks
    if clock.missing:
        made.missing[TIME] = [source.typed for source in sources_of(topics)]
    if clock.unclear:
        made.unclear[TIME] = clock.unclear
    if clock.taken and (clock.unclear or not clock.plain):
        made.taken[clock.taken[0]] = clock.taken[1]
    if "episode" in {name for topic in topics for name in (*topic.fields, *topic.texts)} and len(topics) == 1:
        made.raw["episodes"] = {"by": "column", "field": "episode"}
