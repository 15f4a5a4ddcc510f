"""Logs and a mapping to a Recording and the report of how it came about."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.recordings import import_report, signals
from gpsim.recordings.assembling import Assembled, assemble
from gpsim.recordings.episodes import hold_out
from gpsim.recordings.import_report import EpisodeCount, ImportReport
from gpsim.recordings.likeness import UNITS, likely_unit
from gpsim.recordings.mapping import ImportMapping
from gpsim.recordings.raw import NamedLog
from gpsim.recordings.recording import Episode, Recording
from gpsim.recordings.signals import Lag
from gpsim.recordings.soundness import unmarked_wraps
from gpsim.recordings.sources import Inspector, Part, read_parts
from gpsim.recordings.values import LARGEST


def import_logs(
    logs: Sequence[NamedLog], mapping: ImportMapping, inspect: Inspector
) -> tuple[Recording, ImportReport]:
    """Read every log, make episodes of it, and put them into one recording.

    Raises UsageError (what, where, remedy) when a topic or field is missing, damage is found that `inspect`
    refuses, or no episode is left.
    """
    parts = [part for log in logs for part in read_parts(log, mapping, inspect)]
    _check_clock(mapping, parts)
    shifts: dict[str, float] = {}
    if isinstance(mapping.clock.apply_offset, float):
        shifts = {
            topic: mapping.clock.apply_offset for part in parts for topic in _command_topics(part.mapping)
        }
    built, found = _assemble_all(parts, shifts)
    if mapping.clock.apply_offset is True:
        shifts = _estimates(found, parts)
        built, _ = _assemble_all(parts, shifts)
    episodes, counts, session = _numbered(parts, built, mapping)
    if not episodes:
        raise UsageError(_nothing_left(built, parts))
    _check_values(mapping, episodes)
    recording = _recording(mapping, episodes, session)
    report = ImportReport(
        topics=tuple(count for one in built for count in one.counts),
        episodes=counts,
        rate=import_report.rate_text(mapping, recording.dt),
        lags=tuple(found),
        applied=shifts,
        notes=import_report.notes_of(mapping, recording, built),
        warnings=(
            *_losses(logs),
            *unmarked_wraps(parts, built),
            *import_report.warnings_of(mapping, recording, built),
        ),
    )
    provenance = {
        "mapping": import_report.mapping_metadata(mapping),
        "import": report.as_metadata(),
        "sources": import_report.origins(counts),
    }
    return replace(recording, provenance=provenance), report


def _check_values(mapping: ImportMapping, episodes: Sequence[Episode]) -> None:
    """Scales and offsets act after the readers' checks of what was measured."""
    channels = (*mapping.state_channels, *mapping.action_channels)
    for episode in episodes:
        columns = (*episode.states.T, *episode.actions.T)
        for channel, column in zip(channels, columns, strict=True):
            if len(column) and not np.abs(column).max() <= LARGEST:
                raise UsageError(
                    f"channel {channel.name} reaches {column[np.abs(column).argmax()]:g} {channel.unit}, no channel is "
                    f"larger than {LARGEST:g}; see its scale and offset in the mapping, and its values in the log"
                )


def _check_clock(mapping: ImportMapping, parts: Sequence[Part]) -> None:
    """Settings of the clock that would do nothing."""
    known = sorted({track.topic for part in parts for track in part.tracks.values()})
    for setting, topics in (("offsets", mapping.clock.offsets), ("topics", mapping.clock.topics)):
        for topic in topics:
            if topic not in known:
                raise UsageError(
                    f"clock.{setting}: no topic '{topic}' is read; there are: {', '.join(known)}"
                )
    if mapping.clock.apply_offset and not any(_command_topics(part.mapping) for part in parts):
        raise UsageError(
            "clock.apply_offset: commands and state share their rows and so their clock, there is nothing to shift"
        )


def _losses(logs: Sequence[NamedLog]) -> list[str]:
    """What salvage could not read of the files themselves."""
    return [f"{log.name}: {number} x {reason}" for log in logs for reason, number in log.log.losses.items()]


def _command_topics(mapping: ImportMapping) -> set[str]:
    state = {source.topic for source in mapping.state}
    return {
        source.topic for source in mapping.action if source.topic is not None and source.topic not in state
    }


def _assemble_all(parts: Sequence[Part], shifts: Mapping[str, float]) -> tuple[list[Assembled], list[Lag]]:
    built, pieces = [], signals.Pieces()
    for part in parts:
        tracks = {name: track.shifted(shifts.get(track.topic, 0.0)) for name, track in part.tracks.items()}
        flag = None if part.flag is None else tracks[part.flag.name]
        one = assemble(part.name, tracks, part.mapping, flag)
        built.append(one)
        pieces.add(tracks, part.mapping, [(float(e.t[0]), float(e.t[-1])) for e in one.episodes])
    return built, pieces.estimates()


def _estimates(found: Sequence[Lag], parts: Sequence[Part]) -> dict[str, float]:
    """The lag of the best correlated command of each command topic."""
    topics = _command_topics(parts[0].mapping) if parts else set()
    best: dict[str, float] = {}
    for lag in sorted(found, key=lambda lag: -abs(lag.correlation)):
        topic = next(s.topic for s in parts[0].mapping.action if s.name == lag.command)
        if topic in topics and lag.usable:
            best.setdefault(topic, lag.lag)
    if not best:
        raise UsageError(
            "clock.apply_offset=true: these data tell the lag of no command topic; give a number [s]"
        )
    return best


def _numbered(
    parts: Sequence[Part], built: Sequence[Assembled], mapping: ImportMapping
) -> tuple[tuple[Episode, ...], tuple[EpisodeCount, ...], bool]:
    """Number the episodes and set their clock: running on over one log, or from 0 in each."""
    kind = mapping.clock.kind
    session = kind == "session" or (kind == "auto" and len(parts) == 1)
    episodes: list[Episode] = []
    counts: list[EpisodeCount] = []
    zero: float | None = None
    for part, one in zip(parts, built, strict=True):
        for episode in one.episodes:
            name, start = str(len(episodes)), float(episode.t[0])
            zero = part.epoch + start if zero is None else zero
            t = episode.t - start + ((part.epoch + start - zero) if session else 0.0)
            if session and episodes and t[0] <= episodes[-1].t[-1]:
                raise UsageError(
                    f"clock.kind=session: {part.name} does not begin after the log before it ended"
                )
            episodes.append(Episode(name, t, episode.states, episode.actions))
            length = float(episode.t[-1] - episode.t[0])
            counts.append(EpisodeCount(name, part.name, start, length, len(episode), part.epoch))
    return tuple(episodes), tuple(counts), session


def _nothing_left(built: Sequence[Assembled], parts: Sequence[Part]) -> str:
    reasons: Counter[str] = Counter()
    for count in (count for one in built for count in one.counts):
        reasons.update({f"{count.name}: {reason}": number for reason, number in count.dropped.items()})
    worst = reasons.most_common(3)
    why = "; ".join(f"{number} rows of {reason}" for reason, number in worst) or "the topics are empty"
    hint = _unit_hint(parts) or "see gpsim import --inspect, gap_limit and episodes"
    return f"no episode is left ({why}); {hint}"


def _unit_hint(parts: Sequence[Part]) -> str:
    """What to write where no episode is left because the time column is in another unit; empty where it is not."""
    for part in parts:
        time = part.mapping.time
        if time is None or time.field is None or time.scale != 1.0:
            continue
        for track in part.tracks.values():
            step = float(np.median(np.diff(track.t))) if len(track.t) > 1 else 0.0
            unit = likely_unit(track.t + part.epoch, step)
            if unit is not None:
                return (
                    f"the time column '{time.field}' looks like {unit}: its usual step is {step:g}; write "
                    f"time: {{field: {time.field}, scale: {UNITS[unit]:.0e}}} in the mapping, or time.scale="
                    f"{UNITS[unit]:.0e} behind the command; if it is in seconds, raise gap_limit above {step:g}"
                )
    return ""


def _recording(mapping: ImportMapping, episodes: tuple[Episode, ...], session: bool) -> Recording:
    steps = np.concatenate([np.diff(episode.t) for episode in episodes])
    velocities: Any = "differentiated" if len(mapping.measured) < len(mapping.state) else None
    if velocities is None and any(name.endswith("_dot") for name in mapping.state_channels.names):
        velocities = "measured"
    return Recording(
        system=mapping.system,
        model=mapping.model,
        state=mapping.state_channels,
        action=mapping.action_channels,
        episodes=episodes,
        dt=1.0 / mapping.rate if mapping.rate else float(np.round(np.median(steps), 9)),
        parameters=mapping.parameters,
        integrator=mapping.integrator,
        velocities=velocities,
        clock="session" if session else "episode",
        noise=mapping.noise,
        held_out=hold_out(episodes, mapping.held_out, session),
    )
