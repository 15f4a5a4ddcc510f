"""What a log is compared with, and what was guessed of it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from gpsim.channels import Channel, Channels
from gpsim.errors import UsageError
from gpsim.recordings.guessing_parts import (
    POSE,
    TIME,
    Clock,
    Values,
    clock_of,
    command_of,
    fitting_pose,
    joint_command,
    measured_joint,
    poses_of,
)
from gpsim.recordings.likeness import (
    EXACT,
    FACTORS,
    NO_ACTION,
    NO_STATE,
    NOTHING,
    WORDS,
    Source,
    drive_words,
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

    taken: channel -> source as typed; missing: channels without a sure source, with what might be theirs; unclear:
    channels whose source is likely, with the others; typed: every channel is told by the type of a message; switch: a
    source that may say when the motors were on, and the words that cut the log by it; fit: of the names, summed.
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


SURE = 2.0  # a fit that is more than its last word
AS_GOOD = 0.05  # fits that differ by less are a tie
SWITCHES = frozenset({"safety", "enable", "enabled", "armed", "estop", "deadman", "engaged"})


def guess(topics: Sequence[Topic], system: System, given: Mapping[str, str], values: Values) -> Guess:
    """The mapping that the names of topics and columns suggest; given: `channel: source` as typed, which is kept.

    Raises UsageError where what is given cannot be.
    """
    sound = [topic for topic in topics if topic.count and not topic.fault]
    made = Guess(system, {"system": system.recorded_as or system.name, "rate": "source"})
    made.raw |= {"model": system.model} if system.model is not None else {}
    guesser = _Guesser(made, sound, given)
    guesser.check_given()
    if system.is_vehicle and not any(name in given for name in VEHICLE):
        guesser.take_pose()
    beside = made.taken.get(POSE, "").rpartition(":")[2]
    clock = clock_of(sound, given.get(TIME), given.get("dt"), values, beside)
    guesser.used |= clock.used
    for channel in system.state if not guesser.state else ():
        guesser.measure(channel)
    for channel in system.action:
        guesser.command(channel)
    made.switch = guesser.switch()
    made.raw |= {"state": guesser.state, "action": guesser.action}
    guesser.add_clock(clock)
    return made


_ACTIONS = {
    "N": "force", "N m": "torque", "m/s": "speed_command", "rad/s": "turn_command", "rad": "steering_command",
}  # fmt: skip


@dataclass
class _Guesser:
    """A guess in the making. used: (topic, field) that are a channel's already."""

    made: Guess
    topics: Sequence[Topic]
    given: Mapping[str, str]
    state: dict[str, Any] = field(default_factory=dict)
    action: dict[str, Any] = field(default_factory=dict)
    used: set[tuple[str, str]] = field(default_factory=set)

    def switch(self) -> tuple[str, str] | None:
        """What may say when the motors were on: a command is obeyed only then."""
        for source in sources_of(self.topics):
            if SWITCHES & set(words_of(self._called(source))):
                at = [] if source.alone else [f"episodes.topic={source.topic}"]
                words = ["episodes.by=flag", *at, f"episodes.field={source.field}", "episodes.equals=1"]
                return short(source, self.topics), " ".join(shlex.quote(word) for word in words)
        return None

    def check_given(self) -> None:
        """Refuse a word for what the system does not have."""
        system = self.made.system
        known = [
            *system.state.names,
            *system.action.names,
            TIME,
            "dt",
            *([POSE] if system.is_vehicle else []),
        ]
        for name, source in self.given.items():
            if name not in known:
                raise UsageError(
                    f"{name}={source}: no channel of {system.name}; there are: {', '.join(known)}"
                )

    def take_pose(self) -> None:
        """Take the pose's three channels, where a topic has one."""
        made, poses = self.made, poses_of(self.topics)
        if POSE in self.given:
            chosen = fitting_pose(self.given[POSE], poses)
        elif not poses:
            return
        else:
            chosen = poses[0]
            if len(poses) > 1:
                made.unclear[POSE] = [pose.name for pose in poses]
        self.used |= {(chosen.topic, name) for name in (chosen.x, chosen.y, chosen.yaw)}
        made.typed &= not chosen.prefix
        made.taken[POSE] = chosen.name
        made.fit += EXACT * len(VEHICLE)
        if chosen.rate:
            made.raw |= {"rate": min(50, max(1, round(chosen.rate)))}
        self.state |= chosen.entries()

    def measure(self, channel: Channel) -> None:
        """Find the source of a channel of the state."""
        made, name = self.made, channel.name
        of, optional = made.system.velocities.get(name), name in made.system.optional
        if self.given.get(name) == NOTHING and (of is not None or optional):
            return
        words = _state_words(channel, of, made.taken.get(of or "", ""))
        typed = measured_joint(name, of, self.topics)
        if self._found(self.state, channel, typed, words, NO_STATE):
            return
        if of is not None and of in self.state and not optional:
            self.state[name] = {"derivative_of": of, "unit": channel.unit}
            made.remarks.append(f"{name} is differentiated from {of}")
        elif of not in made.missing and not optional:
            made.missing[name] = self._unused(NO_STATE)

    def command(self, channel: Channel) -> None:
        """Find the source of an action."""
        made, name = self.made, channel.name
        if self.given.get(name) == NOTHING:
            made.taken[name] = NOTHING
            return
        joint = made.system.drives.get(name)
        typed = command_of(name, self.topics) or joint_command(name, channel.unit, joint, self.topics)
        of_joint = drive_words(joint, channel.unit) if joint else ()
        words = (*of_joint, *WORDS.get(_ACTIONS.get(channel.unit, ""), (name, "u", "input")))
        if not self._found(self.action, channel, typed, words, NO_ACTION):
            made.missing[name] = self._unused(NO_ACTION)

    def _found(
        self,
        entries: dict[str, Any],
        channel: Channel,
        typed: Sequence[Source],
        words: Sequence[str],
        never: frozenset[str],
    ) -> bool:
        """Take what is given, else what the type of a message tells, else the name that fits best, if one does."""
        name = channel.name
        if name in self.given:
            self._take(entries, channel, read_source(name, self.given[name], self.topics))
            return True
        if not typed:
            return self._best(entries, channel, words, never)
        self._take(entries, channel, typed[0])
        self.made.fit += EXACT
        if len(typed) > 1:
            self.made.unclear[name] = [short(source, self.topics) for source in typed]
        return True

    def _unused(self, never: frozenset[str]) -> list[str]:
        """What might be a channel's: sources that are nobody's, those that a name speaks against at the end."""
        free = [s for s in sources_of(self.topics) if (s.topic, s.field) not in self.used]
        free.sort(key=lambda source: bool(never & set(words_of(self._called(source)))))
        return [short(source, self.topics) for source in free]

    def _best(
        self, entries: dict[str, Any], channel: Channel, words: Sequence[str], never: frozenset[str]
    ) -> bool:
        fits = [
            (likeness(self._called(source), channel.name, words, never), source)
            for source in sources_of(self.topics)
            if (source.topic, source.field) not in self.used
        ]
        best = max((fit for fit, _ in fits), default=0.0)
        if best <= 0.0 or (best < SURE and channel in self.made.system.action):
            return False  # another's command would do, and say something else
        as_good = [source for fit, source in fits if fit > best - AS_GOOD]
        if len(as_good) > 1:
            self.made.unclear[channel.name] = [short(source, self.topics) for source in as_good]
        elif best < SURE:
            others = [
                short(s, self.topics) for fit, s in sorted(fits, key=lambda pair: -pair[0]) if fit > 0.0
            ]
            self.made.unclear[channel.name] = others
        self.made.typed = False
        factor = FACTORS.get(unit_of(as_good[0].field).removesuffix("/s"), 1.0)
        self._take(entries, channel, replace(as_good[0], scale=factor))
        self.made.fit += best
        return True

    def _called(self, source: Source) -> str:
        """A scalar message is called as its topic; a field is as what it holds."""
        name = short(source, self.topics)
        return name if name != source.typed else source.field

    def _take(self, entries: dict[str, Any], channel: Channel, source: Source) -> None:
        entries[channel.name] = source.entry(channel.unit, channel.wraps or channel.name == "yaw")
        self.used.add((source.topic, source.field))
        factor = "" if source.scale == 1.0 else "-" if source.scale == -1.0 else f"{source.scale:.6g}*"
        self.made.taken[channel.name] = f"{factor}{short(source, self.topics)}"

    def add_clock(self, clock: Clock) -> None:
        """How the tables tell the time; a bag's topics have stamps."""
        made = self.made
        made.raw |= clock.raw
        made.remarks += clock.remarks
        if clock.missing:
            made.missing[TIME] = [source.typed for source in sources_of(self.topics)]
        if clock.unclear:
            made.unclear[TIME] = clock.unclear
        if clock.taken and (clock.unclear or not clock.plain):
            made.taken[clock.taken[0]] = clock.taken[1]
        if len(self.topics) == 1 and "episode" in (*self.topics[0].fields, *self.topics[0].texts):
            made.raw["episodes"] = {"by": "column", "field": "episode"}


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
