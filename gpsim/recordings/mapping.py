"""The mapping: which topic and field of a log is which channel, and every decision of an import, as it is written."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from dataclasses import field as made_by
from typing import Annotated, Any, Literal

from gpsim.channels import Channel, Channels
from gpsim.errors import UsageError
from gpsim.recordings import values
from gpsim.recordings.values import LARGEST, Numbers, Sound, Text, checked, one_line, positive, within
from gpsim.recordings.yaml_data import YamlError, parse_yaml

StampChoice = Literal["auto", "header", "receive"]
AngleName = Literal["roll", "pitch", "yaw"]
APART = within(-1e10, 1e10, "s")  # the most that two clocks may differ by, some 300 years
WIDEST = 10_001  # samples of a smoothing window
FACTOR = within(-LARGEST, LARGEST)


def track_name(topic: str, part: str) -> str:
    """What the rows of a topic are called, or a part of them."""
    return f"{topic} ({part})" if part else topic


def _sign(value: object) -> float:
    found = values.number(value)
    if found not in (1.0, -1.0):
        raise ValueError(f"must be 1 or -1, got {value}; use scale for a factor")
    return found


@dataclass(frozen=True)
class ChannelSource:
    """Where one channel comes from: value = sign * scale * raw + offset, in the channel's unit.

    Exactly one of `field`, `quaternion` (with `angle`) and `derivative_of` is set. topic: None means the only
    table of the log. part: which rows of the topic, where not all of them hold the channel; set when a log is read.
    """

    name: Text
    unit: Text
    wraps: Annotated[bool, Sound(values.flag)] = False
    topic: Text | None = None
    field: Text | None = None
    quaternion: Text | None = None
    angle: AngleName = "yaw"
    derivative_of: Text | None = None
    scale: Annotated[float, FACTOR] = 1.0
    sign: Annotated[float, Sound(_sign)] = 1.0
    offset: Annotated[float, FACTOR] = 0.0
    part: str = ""

    @property
    def channel(self) -> Channel:
        """The channel that is made."""
        return Channel(self.name, self.unit, self.wraps)

    @property
    def track(self) -> str:
        """The track that holds the channel."""
        return track_name(self.topic or "", self.part)

    @property
    def fields(self) -> tuple[str, ...]:
        """The dotted raw fields this channel is made of."""
        if self.quaternion is not None:
            return tuple(f"{self.quaternion}.{part}" for part in "xyzw")
        return () if self.field is None else (self.field,)


@dataclass(frozen=True)
class TimeColumns:
    """How a table tells the time: one column [s after scale], two columns, or a fixed step [s]."""

    field: Text | None = None
    scale: Annotated[float, positive(unit="s per count")] = 1.0
    seconds: Text | None = None
    nanoseconds: Text | None = None
    step: Annotated[float, positive()] | None = None

    def __post_init__(self) -> None:
        if sum(x is not None for x in (self.field, self.seconds, self.step)) != 1:
            raise ValueError("give one of field, seconds (with nanoseconds) and step")

    @property
    def fields(self) -> tuple[str, ...]:
        """The columns that must be read."""
        return tuple(name for name in (self.field, self.seconds, self.nanoseconds) if name is not None)


@dataclass(frozen=True)
class ClockChoice:
    """stamps: for every topic, unless `topics` says otherwise. offsets [s]: added to a topic's stamps.

    apply_offset: False shows the estimated command-to-response offset only; True adds the estimate to the
    command stamps, a number adds that [s]. kind: the recording's clock.
    """

    stamps: StampChoice = "auto"
    topics: Mapping[str, StampChoice] = made_by(default_factory=dict)
    offsets: Mapping[str, Annotated[float, APART]] = made_by(default_factory=dict)
    apply_offset: Annotated[bool | float, Sound(lambda v: v if isinstance(v, bool) else APART.by(v))] = False
    kind: Literal["auto", "session", "episode"] = "auto"


def _names(value: object) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise ValueError("expected a list of channel names")
    return tuple(str(name) for name in value)


@dataclass(frozen=True)
class Smoothing:
    """A filter over the samples of the source: sigma and window in samples; order of the polynomial.

    edges: trim cuts what a full window cannot reach, local fits a line there (and says so in the recording).
    """

    method: Literal["gaussian", "savgol", "none"] = "gaussian"
    sigma: Annotated[float, positive(WIDEST, "samples")] = 2.0
    window: Annotated[int, within(1, WIDEST, whole=True)] = 9
    order: Annotated[int, within(1, 10, whole=True)] = 3
    edges: Literal["trim", "local"] = "trim"
    channels: Annotated[tuple[str, ...], Sound(_names)] = ()

    def __post_init__(self) -> None:
        if self.window % 2 == 0 or self.window <= self.order:
            raise ValueError(
                "savgol needs an odd window larger than its order (at least 1), got "
                f"window {self.window}, order {self.order}"
            )


@dataclass(frozen=True)
class EpisodeRule:
    """What starts an episode besides a file and a gap: a flag that must equal `equals`, or a column's value.

    min_duration [s]: shorter pieces are dropped and counted. variants: name -> {channel: other field},
    for tables that hold several experiments side by side.
    """

    by: Literal["file", "gap", "flag", "column"] = "file"
    topic: Text | None = None
    field: Text | None = None
    equals: Annotated[float, Sound(values.number)] = 1.0
    min_duration: Annotated[float, within(0.0, values.SECONDS, "s")] = 0.0
    variants: Mapping[str, Mapping[str, Text]] = made_by(default_factory=dict)

    @property
    def column(self) -> str | None:
        """The column that says where episodes are, if one does; a gap ends one in any case."""
        return self.field if self.by in ("flag", "column") else None


@dataclass(frozen=True)
class HeldOutRule:
    """What is kept for judging: the last `share` (0: none), or an explicit number or moment [s]."""

    share: Annotated[float, Sound(values.share_of)] = 0.2
    episodes_from: Annotated[int, within(0, 10**9, whole=True)] | None = None
    time_from: Annotated[float, Sound(values.number)] | None = None


@dataclass(frozen=True)
class Checks:
    """What is impossible. jump [s]: a stamp this far from its neighbours; quaternion: allowed | norm - 1 |.

    outlier: how many times its usual unevenness a position may leave its neighbours. max_rate: by channel, the
    largest believable change per second in the channel's unit.
    """

    jump: Annotated[float, positive()] = 1.0
    quaternion: Annotated[float, positive(1.0, "")] = 0.01
    outlier: Annotated[float, positive(LARGEST, "")] = 50.0
    max_rate: Mapping[str, Annotated[float, positive(LARGEST, "per s")]] = made_by(default_factory=dict)


def _rate(value: object) -> float | None:
    return None if value == "source" else positive(LARGEST, "Hz, or 'source'").by(value)


@dataclass(frozen=True)
class ImportMapping:
    """A whole mapping. rate: Hz, or None to keep the stamps of the first state channel's topic.

    gap_limit [s]: a longer silence of a state topic ends the episode; hold_limit [s]: the same for commands,
    None to hold them however long it takes. commands: `hold` takes the command standing at t_k, `mean` its
    time average over the step. layout: `files` (each file a log) or `folder` (each folder a log of topics). model:
    of `system: mjcf` the MuJoCo model that simulates it.
    """

    system: Text
    state: tuple[ChannelSource, ...]
    action: tuple[ChannelSource, ...]
    rate: Annotated[float | None, Sound(_rate)]
    parameters: Numbers = made_by(default_factory=dict)
    integrator: Literal["euler", "semi_implicit", "rk4"] = "euler"
    noise: Mapping[str, Annotated[float, within(0.0, LARGEST)]] = made_by(default_factory=dict)
    layout: Literal["files", "folder"] = "files"
    files: Text = "*"
    time: TimeColumns | None = None
    gap_limit: Annotated[float, positive()] = 0.5
    hold_limit: Annotated[float, positive()] | None = None
    commands: Literal["hold", "mean"] = "hold"
    clock: ClockChoice = made_by(default_factory=ClockChoice)
    velocities: Smoothing = made_by(default_factory=Smoothing)
    smoothing: Smoothing = made_by(default_factory=lambda: Smoothing(method="none"))
    episodes: EpisodeRule = made_by(default_factory=EpisodeRule)
    held_out: HeldOutRule = made_by(default_factory=HeldOutRule)
    checks: Checks = made_by(default_factory=Checks)
    description: Text = ""
    model: Text | None = None

    def __post_init__(self) -> None:
        if not self.state:
            raise ValueError("state names no channel")
        made = {s.name: s.derivative_of for s in self.state if s.derivative_of is not None}
        positions = [s.name for s in self.state if s.name not in made]
        for name, origin in made.items():
            _one_of(origin, positions, f"state.{name}.derivative_of")
            if name in self.checks.max_rate:
                raise ValueError(
                    f"checks.max_rate.{name}: {name} is computed from {origin} and has no rows; limit {origin} instead"
                )
        for name in self.smoothing.channels:
            _one_of(name, positions, "smoothing.channels")
        names = [s.name for s in (*self.state, *self.action)]
        renamed = [name for variant in self.episodes.variants.values() for name in variant]
        for name in (*self.noise, *self.checks.max_rate, *renamed):
            _one_of(name, names, "channel")
        if self.episodes.by in ("flag", "column") and self.episodes.field is None:
            raise ValueError(f"episodes.by={self.episodes.by} needs episodes.field")

    @property
    def measured(self) -> tuple[ChannelSource, ...]:
        """The sources of state channels that are read, not made here."""
        return tuple(source for source in self.state if source.derivative_of is None)

    def filters(self, name: str) -> bool:
        """Whether a state channel is smoothed, made by differentiation, or what another is made from."""
        made = {name for s in self.state if s.derivative_of is not None for name in (s.name, s.derivative_of)}
        return name in made or name in self.smoothing.channels

    @property
    def state_channels(self) -> Channels:
        """The recording's state channels."""
        return Channels(tuple(source.channel for source in self.state))

    @property
    def action_channels(self) -> Channels:
        """The recording's action channels."""
        return Channels(tuple(source.channel for source in self.action))


def _one_of(name: str, known: Sequence[str], where: str) -> None:
    if name not in known:
        raise ValueError(f"{where}: no channel '{name}'; there are: {', '.join(known)}")


_PART = re.compile(r"\.?([^.\[\]]+)|\[([^\[\]]+)\]")
_WRITTEN = ("[", "{", '"', "'")  # values that begin like this are meant as YAML


def changes_of_words(words: Sequence[str]) -> dict[str, Any]:
    """Nested changes from words as rate=50, state.x.field=a or checks.max_rate[a name]=3; later words win.

    Values are YAML (numbers, true, null, lists); what is none is taken as text, so that files=*.csv needs no quotes.
    """
    made: dict[str, Any] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise UsageError(
                f"'{one_line(word, 80)}' is neither a source nor a setting: write key=value, as rate=50"
            )
        try:
            change: Any = parse_yaml(value)
        except YamlError as error:
            if value.startswith(_WRITTEN):
                raise UsageError(f"setting {one_line(word, 80)}: {error}") from error
            change = value
        for part in reversed(_parts(key, word)):
            change = {part: change}
        made = merged(made, change)
    return made


def _parts(key: str, word: str) -> list[str]:
    parts: list[str] = []
    position = 0
    while position < len(key):
        match = _PART.match(key, position)
        if match is None or (position == 0 and match[1] is None):
            raise UsageError(
                f"setting {one_line(word, 80)}: '{one_line(key, 60)}' is not a key; write it as state.x.field"
            )
        parts.append(match[1] or match[2])
        position = match.end()
    return parts


def merged(raw: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`raw` with `changes`: tables are merged key by key, everything else is replaced."""
    made = dict(raw)
    for key, value in changes.items():
        known = made.get(key)
        both = isinstance(known, Mapping) and isinstance(value, Mapping)
        made[key] = merged(known, value) if both else value  # type: ignore[arg-type]
    return made


OPEN = "?"  # what a proposal leaves for the person to fill in
TOP_KEYS = (*(f.name for f in fields(ImportMapping)), "dt")
_SECTIONS = {
    "time": TimeColumns, "clock": ClockChoice, "velocities": Smoothing, "smoothing": Smoothing,
    "episodes": EpisodeRule, "held_out": HeldOutRule, "checks": Checks,
}  # fmt: skip


def parse_mapping(raw: object, where: str = "mapping") -> ImportMapping:
    """Check a plain dictionary and build the mapping; every fault is one line with the alternatives."""
    given = {key: value for key, value in values.table(raw, where, TOP_KEYS).items() if value is not None}
    _refuse_open_questions(given, where)
    for key in ("system", "state"):
        if key not in given:
            raise UsageError(f"{where}: {key} missing; a mapping needs system, state, action and rate")
    if given.get("held_out") in (False, "none"):
        given["held_out"] = {"share": 0.0}
    for key, kind in _SECTIONS.items():
        if key in given:
            given[key] = checked(kind, given[key], f"{where}: {key}")
    for key in ("state", "action"):
        named, place = given.get(key) or {}, f"{where}: {key}"
        if not isinstance(named, Mapping):
            raise UsageError(f"{place}: expected channel names, each with its field and unit")
        values.check_channels(named, place)
        given[key] = tuple(_channel(str(name), entry, f"{place}.{name}") for name, entry in named.items())
    step = given.pop("dt", None)
    if step is not None and "rate" in given:
        raise UsageError(f"{where}: give rate [Hz] or dt [s], not both")
    if step is not None:
        seconds = Annotated[float, within(1e-9, 1e6, "s", above=True)]
        given["rate"] = 1.0 / values.sound(seconds, step, f"{where}: dt")
    if "rate" not in given:
        raise UsageError(f"{where}: rate missing; a number [Hz], or 'source' to keep the state's own stamps")
    return checked(ImportMapping, given, where, top=True)


def _refuse_open_questions(given: Mapping[str, Any], where: str) -> None:
    """`gpsim import --inspect` proposes '?' where only a person can tell."""
    entries = {key: given[key] for key in ("time", "state", "action") if isinstance(given.get(key), Mapping)}
    found = ["system"] if given.get("system") == OPEN else []
    found += [f"time.{name}" for name, value in entries.pop("time", {}).items() if value == OPEN]
    for section, channels in entries.items():
        for name, entry in channels.items():
            held = entry.items() if isinstance(entry, Mapping) else ()
            found += [f"{section}.{name}.{key}" for key, value in held if value == OPEN]
    if found:
        more = f" and {len(found) - 8} more" if len(found) > 8 else ""
        raise UsageError(
            f"{where}: still '{OPEN}' at {', '.join(found[:8])}{more}; fill in what the log does not contain (a "
            "system, units), and remove the channels that you do not need"
        )


def _channel(name: str, raw: object, where: str) -> ChannelSource:
    known = [f.name for f in fields(ChannelSource) if f.name not in ("name", "part")]
    table = values.table(raw, where, known)
    origins = [key for key in ("field", "quaternion", "derivative_of") if table.get(key) is not None]
    if len(origins) != 1:
        got = " and ".join(origins) or "none"
        raise UsageError(f"{where}: needs exactly one of field, quaternion, derivative_of; got {got}")
    if table.get("unit") is None:
        raise UsageError(f"{where}: unit missing, as in {{field: pose.position.x, unit: m}}")
    return checked(ChannelSource, {"name": name, **table}, where)
