"""The Recording: a timestamped log in episodes, and the transitions it holds."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal

import numpy as np

from gpsim.channels import BoolArray, Channel, Channels, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings.values import Number, Sound, share_of, within

Clock = Literal["session", "episode"]
UNSEEN = Channels(())
"""Of a recording whose robot nobody else looked at."""
Velocities = Literal["measured", "differentiated"]


@dataclass(frozen=True)
class Episode:
    """One episode: K + 1 samples of the state and the K actions between them.

    name: as in the file's `episode` column. t: (K + 1,) s, increasing. states: (K + 1, S).
    actions: (K, A); actions[k] is what was commanded from t[k] to t[k + 1].
    weights: (K + 1, S) what each sample counts where a simulator is compared with it, 0 if nothing; None: all alike. A
    file does not hold them. source: of a joined recording, the place in its `sources` of the recording it is from.
    poses: (K + 1, P) what somebody else saw of it, NaN where nothing; None: nobody looked.
    """

    name: str
    t: FloatArray
    states: FloatArray
    actions: FloatArray
    weights: FloatArray | None = None
    source: int = 0
    poses: FloatArray | None = None

    def __post_init__(self) -> None:
        rows = len(self.t)
        if rows < 1 or self.states.shape[0] != rows or self.actions.shape[0] != rows - 1:
            raise UsageError(
                f"episode {self.name}: expected K + 1 states and K actions for K + 1 times, got "
                f"{rows} times, {self.states.shape[0]} states and {self.actions.shape[0]} actions"
            )

    def __len__(self) -> int:
        """Number of transitions K."""
        return len(self.t) - 1


@dataclass(frozen=True)
class HeldOut:
    """Which part is kept for judging: episodes from a number on, time from a moment on [s], or the last share of it.

    A share is of the episodes, or of the samples where it is less than one episode.
    """

    episodes_from: Annotated[int, within(-1e9, 1e9, whole=True)] | None = None
    time_from: Number | None = None
    share: Annotated[float, Sound(share_of)] | None = None


@dataclass(frozen=True)
class Source:
    """A recording that was joined with others: its name, and what it holds out."""

    name: str
    held_out: HeldOut | None = None


@dataclass(frozen=True)
class Transitions:
    """All transitions of a recording, in order.

    states, next_states: (N, S); actions: (N, A); dt: (N,) s; t: (N,) s, the clock at the state;
    episode: (N,) index into the recording's episodes.
    """

    states: FloatArray
    actions: FloatArray
    next_states: FloatArray
    dt: FloatArray
    t: FloatArray
    episode: IntArray

    def __len__(self) -> int:
        return len(self.dt)

    def take(self, rows: IntArray | BoolArray) -> Transitions:
        """The transitions at `rows` (indices or a mask)."""
        return Transitions(*(getattr(self, column.name)[rows] for column in fields(self)))


@dataclass(frozen=True)
class Recording:
    """What happened: episodes of measured states and commanded actions on one clock.

    `system`, `parameters`, `integrator` and `dt` describe the base simulator that the recording is to be
    compared with (`model`: the file of one that is a MuJoCo model); `noise` is the known measurement noise (standard
    deviation by channel), if any; `provenance` is free-form metadata (how it was collected, imported, smoothed) and is
    kept as it is. sources: the recordings that it was joined from, none of one by itself; each holds out its own part
    unless `held_out` of the whole says otherwise. poses: columns of the file that are neither state nor action, but
    where a motion capture saw something (`pose_channels`); only a diagnosis of a model looks at them.
    """

    system: str
    state: Channels
    action: Channels
    episodes: tuple[Episode, ...]
    dt: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    integrator: str = "euler"
    velocities: Velocities | None = None
    clock: Clock = "episode"
    noise: Mapping[str, float] = field(default_factory=dict)
    held_out: HeldOut | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    model: str | None = None
    sources: tuple[Source, ...] = ()
    poses: Channels = UNSEEN

    def __post_init__(self) -> None:
        if not self.episodes:
            raise UsageError("the recording has no episodes")
        if not self.dt > 0:
            raise UsageError(f"the recording's dt must be positive, got {self.dt}")
        for episode in self.episodes:
            expected = (len(self.state), len(self.action))
            got = (episode.states.shape[1], episode.actions.shape[1])
            if got != expected:
                raise UsageError(
                    f"episode {episode.name}: expected (state, action) columns {expected}, got {got}"
                )

    def __repr__(self) -> str:
        return (
            f"<Recording of {self.system}: {self.transition_count} transitions of {self.dt:.6g} s in "
            f"{len(self.episodes)} episode(s); state {self.state.listed()}, action {self.action.listed()}>"
        )

    @property
    def transition_count(self) -> int:
        """Number of transitions over all episodes."""
        return sum(len(episode) for episode in self.episodes)

    def transitions(self) -> Transitions:
        """All transitions in order; episodes of a single sample contribute none."""
        parts = self.episodes
        return Transitions(
            states=np.concatenate([e.states[:-1] for e in parts]),
            actions=np.concatenate([e.actions for e in parts]),
            next_states=np.concatenate([e.states[1:] for e in parts]),
            dt=np.concatenate([np.diff(e.t) for e in parts]),
            t=np.concatenate([e.t[:-1] for e in parts]),
            episode=np.concatenate([np.full(len(e), i, dtype=np.int64) for i, e in enumerate(parts)]),
        )


def evenly(count: int, most: int) -> IntArray:
    """(n,) at most `most` of the rows 0 ... count - 1, evenly spread, the first and the last among them; all if few."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(np.int64)


PLACE, TURN = ("x", "y", "z"), ("qw", "qx", "qy", "qz")


def pose_channels(names: Sequence[str], taken: Collection[str]) -> Channels:
    """The columns of poses among `names`, in their order, whole places alone; taken: names that mean something else.

    They are no channels: NAME.x .y .z [m], and NAME.qw .qx .qy .qz, that somebody else measured.
    """
    heads = dict.fromkeys(name.removesuffix(".x") for name in names if name.endswith(".x"))
    found: list[Channel] = []
    for head in heads:
        place, turn = ([f"{head}.{part}" for part in parts] for parts in (PLACE, TURN))
        if not head or {*place, *turn} & {*taken} or not {*place} <= {*names}:
            continue
        found += [Channel(name, "m") for name in place]
        found += [Channel(name, "1") for name in turn] if {*turn} <= {*names} else []
    return Channels(tuple(found))


def without_poses(recording: Recording) -> Recording:
    """The recording as nobody else saw it."""
    if not len(recording.poses):
        return recording
    alone = tuple(replace(episode, poses=None) for episode in recording.episodes)
    return replace(recording, poses=UNSEEN, episodes=alone)


SAME_STEP = 0.05  # relative difference of two recordings' steps that the clocks of one machine may make


def joined(recordings: Sequence[Recording], names: Sequence[str]) -> Recording:
    """The recordings one after the other; raises UsageError where they are not of one machine at one rate.

    Episodes are called `recording/episode`. Each recording keeps its own clock and what it holds out. A channel's known
    noise is the largest that a recording says.
    """
    first = recordings[0]
    for recording, name in zip(recordings[1:], names[1:], strict=True):
        _check_alike(first, recording, names[0], name)
    seen = first.poses if all(r.poses == first.poses for r in recordings) else UNSEEN
    stated = [n for n in first.noise if all(n in r.noise for r in recordings)]
    return replace(
        first,
        episodes=tuple(
            replace(
                episode,
                name=f"{name}/{episode.name}",
                source=place,
                poses=episode.poses if len(seen) else None,
            )
            for place, (recording, name) in enumerate(zip(recordings, names, strict=True))
            for episode in recording.episodes
        ),
        clock="episode",
        noise={n: max(r.noise[n] for r in recordings) for n in stated},
        held_out=None,
        poses=seen,
        sources=tuple(Source(n, r.held_out) for n, r in zip(names, recordings, strict=True)),
    )


def apart(recording: Recording) -> list[Recording]:
    """The recordings that a joined one is of, as it has them; itself where it is one."""
    if not recording.sources:
        return [recording]
    found = []
    for place, source in enumerate(recording.sources):
        own = tuple(episode for episode in recording.episodes if episode.source == place)
        found.append(replace(recording, episodes=own, held_out=source.held_out, sources=()))
    return found


def _check_alike(one: Recording, other: Recording, first: str, second: str) -> None:
    pairs: list[tuple[str, object, object]] = [("system", one.system, other.system)]
    for kind, own, theirs in (("state", one.state, other.state), ("action", one.action, other.action)):
        if not own.same_as(theirs):
            pairs.append((kind, own.listed(), theirs.listed()))
    _check_same(pairs, first, second)
    if abs(other.dt - one.dt) > SAME_STEP * one.dt:
        raise UsageError(
            f"{first} has a step of {one.dt:g} s, {second} of {other.dt:g} s: several recordings are judged together "
            "at one rate; import them at the same one, or judge each with --each"
        )
    pairs = [(what, getattr(one, what), getattr(other, what)) for what in ("velocities", "integrator")]
    for name in dict.fromkeys((*one.parameters, *other.parameters)):
        pairs.append((f"{name} of the base simulator", one.parameters.get(name), other.parameters.get(name)))
    _check_same(pairs, first, second)


def _check_same(pairs: Sequence[tuple[str, object, object]], first: str, second: str) -> None:
    for what, one, other in pairs:
        if one != other:
            raise UsageError(
                f"{first} and {second} differ in {what} ({one} and {other}); make them alike, or judge each by itself "
                "with --each"
            )
