"""The mapping: which topic and field of a log is which channel, and every decision of an import."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as made_by
from typing import Any, Literal

from gpsim.channels import Channel, Channels
from gpsim.errors import UsageError

StampChoice = Literal["auto", "header", "receive"]
AngleName = Literal["roll", "pitch", "yaw"]


def track_name(topic: str, part: str) -> str:
    """What the rows of a topic are called, or a part of them."""
    return f"{topic} ({part})" if part else topic


@dataclass(frozen=True)
class ChannelSource:
    """Where one channel comes from: value = sign * scale * raw + offset, in the channel's unit.

    Exactly one of `field`, `quaternion` (with `angle`) and `derivative_of` is set. topic: None means the only
    table of the log. part: which rows of the topic, where not all of them hold the channel; set when a log is read.
    """

    channel: Channel
    topic: str | None = None
    field: str | None = None
    quaternion: str | None = None
    angle: AngleName = "yaw"
    derivative_of: str | None = None
    scale: float = 1.0
    sign: float = 1.0
    offset: float = 0.0
    part: str = ""

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

    field: str | None = None
    scale: float = 1.0
    seconds: str | None = None
    nanoseconds: str | None = None
    step: float | None = None

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
    offsets: Mapping[str, float] = made_by(default_factory=dict)
    apply_offset: bool | float = False
    kind: Literal["auto", "session", "episode"] = "auto"


@dataclass(frozen=True)
class Smoothing:
    """A filter over the samples of the source: sigma and window in samples; order of the polynomial.

    edges: trim cuts what a full window cannot reach, local fits a line there (and says so in the recording).
    """

    method: Literal["gaussian", "savgol", "none"] = "gaussian"
    sigma: float = 2.0
    window: int = 9
    order: int = 3
    edges: Literal["trim", "local"] = "trim"
    channels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.sigma <= 0:
            raise UsageError(f"mapping: smoothing sigma must be positive (samples), got {self.sigma}")
        if self.window % 2 == 0 or self.window <= self.order or self.order < 1:
            raise UsageError(
                "mapping: savgol needs an odd window larger than its order (at least 1), got "
                f"window {self.window}, order {self.order}"
            )


@dataclass(frozen=True)
class EpisodeRule:
    """What starts an episode besides a file and a gap: a flag that must equal `equals`, or a column's value.

    min_duration [s]: shorter pieces are dropped and counted. variants: name -> {channel: other field},
    for tables that hold several experiments side by side.
    """

    by: Literal["file", "flag", "column"] = "file"
    topic: str | None = None
    field: str | None = None
    equals: float = 1.0
    min_duration: float = 0.0
    variants: Mapping[str, Mapping[str, str]] = made_by(default_factory=dict)


@dataclass(frozen=True)
class HeldOutRule:
    """What is kept for judging: the last `share` (0: none), or an explicit number or moment [s]."""

    share: float = 0.2
    episodes_from: int | None = None
    time_from: float | None = None


@dataclass(frozen=True)
class Checks:
    """What is impossible. jump [s]: a stamp this far from its neighbours; quaternion: allowed | norm - 1 |.

    outlier: how many times its usual unevenness a position may leave its neighbours. max_rate: by channel, the
    largest believable change per second in the channel's unit.
    """

    jump: float = 1.0
    quaternion: float = 0.01
    outlier: float = 50.0
    max_rate: Mapping[str, float] = made_by(default_factory=dict)


@dataclass(frozen=True)
class ImportMapping:
    """A whole mapping. rate: Hz, or None to keep the stamps of the first state channel's topic.

    gap_limit [s]: a longer silence of a state topic ends the episode; hold_limit [s]: the same for commands,
    None to hold them however long it takes. commands: `hold` takes the command standing at t_k, `mean` its
    time average over the step. layout: `files` (each file a log) or `folder` (each folder a log of topics). model:
    of `system: mjcf` the MuJoCo model that simulates it.
    """

    system: str
    state: tuple[ChannelSource, ...]
    action: tuple[ChannelSource, ...]
    rate: float | None
    parameters: Mapping[str, float] = made_by(default_factory=dict)
    integrator: str = "euler"
    noise: Mapping[str, float] = made_by(default_factory=dict)
    layout: Literal["files", "folder"] = "files"
    files: str = "*"
    time: TimeColumns | None = None
    gap_limit: float = 0.5
    hold_limit: float | None = None
    commands: Literal["hold", "mean"] = "hold"
    clock: ClockChoice = made_by(default_factory=ClockChoice)
    velocities: Smoothing = made_by(default_factory=Smoothing)
    smoothing: Smoothing = made_by(default_factory=lambda: Smoothing(method="none"))
    episodes: EpisodeRule = made_by(default_factory=EpisodeRule)
    held_out: HeldOutRule = made_by(default_factory=HeldOutRule)
    checks: Checks = made_by(default_factory=Checks)
    description: str = ""
    model: str | None = None

    def __post_init__(self) -> None:
        if not self.state:
            raise UsageError("mapping: state names no channel")
        if self.rate is not None and not self.rate > 0:
            raise UsageError(f"mapping: rate must be positive [Hz] or 'source', got {self.rate}")
        if not self.gap_limit > 0:
            raise UsageError(f"mapping: gap_limit must be positive [s], got {self.gap_limit}")
        positions = [c.channel.name for c in self.state if c.derivative_of is None]
        for source in self.state:
            _one_of(source.derivative_of, positions, f"mapping: state.{source.channel.name}.derivative_of")
        for name in self.smoothing.channels:
            _one_of(name, positions, "mapping: smoothing.channels")
        names = [c.channel.name for c in (*self.state, *self.action)]
        renamed = [name for variant in self.episodes.variants.values() for name in variant]
        for name in (*self.noise, *self.checks.max_rate, *renamed):
            _one_of(name, names, "mapping: channel")
        for source in self.state:
            if source.derivative_of is not None and source.channel.name in self.checks.max_rate:
                raise UsageError(
                    f"mapping: checks.max_rate.{source.channel.name}: {source.channel.name} is made from "
                    f"{source.derivative_of}, no row holds it; limit {source.derivative_of} instead"
                )
        if self.episodes.by != "file" and self.episodes.field is None:
            raise UsageError(f"mapping: episodes.by={self.episodes.by} needs episodes.field")

    @property
    def state_channels(self) -> Channels:
        """The recording's state channels."""
        return Channels(tuple(source.channel for source in self.state))

    @property
    def action_channels(self) -> Channels:
        """The recording's action channels."""
        return Channels(tuple(source.channel for source in self.action))

    @property
    def differentiates(self) -> bool:
        """Whether any state channel is a derivative made here."""
        return any(source.derivative_of is not None for source in self.state)


def _one_of(name: str | None, known: Sequence[str], where: str) -> None:
    if name is not None and name not in known:
        raise UsageError(f"{where}: no channel '{name}'; there are: {', '.join(known)}")


def with_fields(sources: Sequence[ChannelSource], fields: Mapping[str, str]) -> tuple[ChannelSource, ...]:
    """The same channels from other fields (a variant): fields is channel -> field."""
    return tuple(replace(s, field=fields[s.channel.name]) if s.channel.name in fields else s for s in sources)


def as_metadata(source: ChannelSource) -> dict[str, Any]:
    """What a recording keeps of a channel's origin."""
    raw: dict[str, Any] = {"topic": source.topic, "field": source.field, "quaternion": source.quaternion}
    raw["angle"] = source.angle if source.quaternion else None
    raw["derivative_of"] = source.derivative_of
    raw |= {"scale": source.sign * source.scale, "offset": source.offset}
    defaults = {"scale": 1.0, "offset": 0.0}
    return {key: value for key, value in raw.items() if value is not None and value != defaults.get(key)}
