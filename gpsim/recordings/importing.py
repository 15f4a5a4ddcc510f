"""Logs and a mapping to a Recording and the report of how it came about."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.channels import IntArray
from gpsim.errors import UsageError
from gpsim.recordings import clock, lags
from gpsim.recordings.assembling import Assembled, assemble
from gpsim.recordings.clock import Lag
from gpsim.recordings.episodes import hold_out
from gpsim.recordings.import_report import EpisodeCount, ImportReport
from gpsim.recordings.mapping import ImportMapping, Smoothing, as_metadata, with_fields
from gpsim.recordings.raw import RawLog, Series
from gpsim.recordings.recording import Episode, Recording
from gpsim.recordings.tracks import Track, build_track, fields_by_topic

BadRows = Mapping[str, IntArray]
Inspector = Callable[[str, Series, ImportMapping], BadRows]
"""Looks for silent damage: (log name, series, mapping) -> rows to leave out, by reason; may refuse instead."""


@dataclass(frozen=True)
class NamedLog:
    """A log with the name the report uses for it; is_table: rows of a table, not messages of a bag."""

    name: str
    log: RawLog


@dataclass(frozen=True)
class _Part:
    """One piece of a log on one unbroken clock, its channels bound to topics."""

    name: str
    mapping: ImportMapping
    tracks: dict[str, Track]
    flag: Track | None
    epoch: float


def import_logs(logs: Sequence[NamedLog], mapping: ImportMapping, inspect: Inspector) -> tuple[Recording, ImportReport]:
    """Read every log, make episodes of it, and put them into one recording.

    Raises UsageError (what, where, remedy) when a topic or field is missing, damage is found that `inspect`
    refuses, or no episode is left.
    """
    parts = [part for log in logs for part in _parts(log, mapping, inspect)]
    shifts: dict[str, float] = {}
    if isinstance(mapping.clock.apply_offset, float):
        shifts = {topic: mapping.clock.apply_offset for part in parts for topic in _command_topics(part.mapping)}
    built, found = _assemble_all(parts, shifts)
    if mapping.clock.apply_offset is True:
        shifts = _estimates(found, mapping, parts)
        built, _ = _assemble_all(parts, shifts)
    episodes, counts, session = _numbered(parts, built, mapping)
    if not episodes:
        raise UsageError(_nothing_left(built))
    recording = _recording(mapping, episodes, session)
    report = ImportReport(
        topics=tuple(count for one in built for count in one.counts),
        episodes=counts,
        rate=_rate_text(mapping, recording.dt),
        lags=tuple(found),
        applied=shifts,
        notes=_notes(mapping, recording, built, parts),
        warnings=_warnings(mapping, recording, built),
    )
    provenance = {"mapping": _mapping_metadata(mapping), "import": report.as_metadata(), "sources": _origins(counts)}
    return replace(recording, provenance=provenance), report


def _parts(named: NamedLog, mapping: ImportMapping, inspect: Inspector) -> list[_Part]:
    """Read one log: once, or once a variant; a table whose clock was set back becomes several parts."""
    if not mapping.episodes.variants:
        return _read_parts(named, mapping, inspect)
    parts = []
    for label, fields in mapping.episodes.variants.items():
        state, action = with_fields(mapping.state, fields), with_fields(mapping.action, fields)
        variant = NamedLog(f"{named.name} [{label}]", named.log)
        parts += _read_parts(variant, replace(mapping, state=state, action=action), inspect)
    return parts


def _read_parts(named: NamedLog, mapping: ImportMapping, inspect: Inspector) -> list[_Part]:
    bound, flag_topic, series = _read(named, mapping)
    pieces = _unbroken(named.name, series, bound)
    parts = []
    for number, piece in enumerate(pieces):
        name = named.name if len(pieces) == 1 else f"{named.name} [{number + 1}]"
        bad = {topic: inspect(name, one, bound) for topic, one in piece.items()}
        state = {s.topic for s in bound.state if s.derivative_of is None}
        tracks = {t: build_track(one, bad[t], bound, t in state, name) for t, one in piece.items()}
        first = [float(track.t[0]) for track in tracks.values() if len(track.t)]
        epoch = float(np.floor(min(first))) if first else 0.0
        tracks = {topic: track.shifted(-epoch) for topic, track in tracks.items()}
        parts.append(_Part(name, bound, tracks, tracks[flag_topic] if flag_topic else None, epoch))
    return parts


def _read(named: NamedLog, mapping: ImportMapping) -> tuple[ImportMapping, str | None, Mapping[str, Series]]:
    """Bind unnamed topics to the only one there is, and read what the mapping wants."""
    topics = {topic.name: topic for topic in named.log.topics()}
    only = next(iter(topics)) if len(topics) == 1 else None
    rule = mapping.episodes
    extra: list[tuple[str | None, Sequence[str]]] = []
    if rule.by != "file" and rule.field is not None:
        extra.append((rule.topic, (rule.field,)))
    wanted = fields_by_topic((*mapping.state, *mapping.action), extra, only)
    for name in wanted:
        if name not in topics:
            raise UsageError(f"{named.name}: no topic '{name}'; there are: {', '.join(topics) or 'none'}")
        if mapping.time is not None:
            wanted[name] += [f for f in mapping.time.fields if f not in wanted[name]]
    state = tuple(replace(s, topic=s.topic or only) for s in mapping.state)
    action = tuple(replace(s, topic=s.topic or only) for s in mapping.action)
    bound = replace(mapping, state=state, action=action)
    flag_topic = (rule.topic or only) if extra else None
    return bound, flag_topic, named.log.series(wanted)


def _unbroken(name: str, series: Mapping[str, Series], mapping: ImportMapping) -> list[Mapping[str, Series]]:
    """Cut a single table where its clock was set back; with several topics nobody can tell which part is whose."""
    from gpsim.recordings.tracks import stamps

    for topic, one in series.items():
        choice = mapping.clock.topics.get(topic, mapping.clock.stamps)
        t, _ = stamps(one, mapping.time, choice, name)
        finite = np.flatnonzero(np.isfinite(t))
        jumps = set(clock.jumping(t[finite], mapping.checks.jump).tolist())
        sound = np.array([row for i, row in enumerate(finite.tolist()) if i not in jumps], dtype=np.int64)
        cuts = [int(sound[i]) for i in clock.restarts(t[sound])]
        if not cuts:
            continue
        if len(series) > 1:
            back = float(np.max(t[sound][t[sound] <= np.inf][: int(np.searchsorted(sound, cuts[0]))]) - t[cuts[0]])
            raise UsageError(
                f"{name}: the clock of {topic} was set back by {back:.3g} s at row {cuts[0]}; choose the other "
                f"clock with clock.topics, or split the log there"
            )
        edges = [0, *cuts, len(t)]
        return [{topic: _rows(one, a, b)} for a, b in zip(edges[:-1], edges[1:], strict=True)]
    return [series]


def _rows(series: Series, start: int, stop: int) -> Series:
    """A run of rows; what the reader dropped is booked on the first run."""
    return replace(
        series,
        receive=series.receive[start:stop],
        header=None if series.header is None else series.header[start:stop],
        fields={name: values[start:stop] for name, values in series.fields.items()},
        read=stop - start,
        dropped=series.dropped if start == 0 else {},
    )


def _command_topics(mapping: ImportMapping) -> set[str]:
    state = {source.topic for source in mapping.state}
    return {source.topic for source in mapping.action if source.topic is not None and source.topic not in state}


def _assemble_all(parts: Sequence[_Part], shifts: Mapping[str, float]) -> tuple[list[Assembled], list[Lag]]:
    built, pieces = [], lags.Pieces()
    for part in parts:
        tracks = {topic: track.shifted(shifts.get(topic, 0.0)) for topic, track in part.tracks.items()}
        flag = None if part.flag is None else tracks[part.flag.topic]
        one = assemble(part.name, tracks, part.mapping, flag)
        built.append(one)
        pieces.add(tracks, part.mapping, [(float(e.t[0]), float(e.t[-1])) for e in one.episodes])
    return built, pieces.estimates()


def _estimates(found: Sequence[Lag], mapping: ImportMapping, parts: Sequence[_Part]) -> dict[str, float]:
    """The lag of the best correlated command of each command topic."""
    topics = _command_topics(parts[0].mapping) if parts else set()
    best: dict[str, Lag] = {}
    for lag in found:
        topic = next(s.topic for s in parts[0].mapping.action if s.channel.name == lag.command)
        if topic in topics and lag.usable:
            known = best.get(topic)
            if known is None or abs(lag.correlation) > abs(known.correlation):
                best[topic] = lag
    if not best:
        raise UsageError(
            "clock.apply_offset=true: no command topic of its own whose lag these data can tell; give a number [s]"
        )
    return {topic: lag.lag for topic, lag in best.items()}


def _numbered(
    parts: Sequence[_Part], built: Sequence[Assembled], mapping: ImportMapping
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
                raise UsageError(f"clock.kind=session: {part.name} does not begin after the log before it ended")
            episodes.append(Episode(name, t, episode.states, episode.actions))
            length = float(episode.t[-1] - episode.t[0])
            counts.append(EpisodeCount(name, part.name, start, length, len(episode)))
    return tuple(episodes), tuple(counts), session


def _nothing_left(built: Sequence[Assembled]) -> str:
    reasons: dict[str, int] = {}
    for one in built:
        for count in one.counts:
            for reason, number in count.dropped.items():
                reasons[f"{count.topic}: {reason}"] = reasons.get(f"{count.topic}: {reason}", 0) + number
    worst = sorted(reasons.items(), key=lambda item: -item[1])[:3]
    why = "; ".join(f"{number} rows of {reason}" for reason, number in worst) or "the topics are empty"
    return f"no episode is left ({why}); see gpsim import --inspect, gap_limit and episodes"


def _recording(mapping: ImportMapping, episodes: tuple[Episode, ...], session: bool) -> Recording:
    steps = np.concatenate([np.diff(episode.t) for episode in episodes])
    velocities: Any = "differentiated" if mapping.differentiates else None
    if velocities is None and any(name.endswith("_dot") for name in mapping.state_channels.names):
        velocities = "measured"
    return Recording(
        system=mapping.system,
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


def _rate_text(mapping: ImportMapping, dt: float) -> str:
    if mapping.rate is None:
        return f"the source's own stamps, nothing interpolated in time on its topic; median step {1e3 * dt:.4g} ms"
    return f"{mapping.rate:g} Hz, interpolated"


def _notes(
    mapping: ImportMapping, recording: Recording, built: Sequence[Assembled], parts: Sequence[_Part]
) -> tuple[str, ...]:
    notes = []
    if len(mapping.action):
        how = "averaged over each step" if mapping.commands == "mean" else "held (zero order), the one standing at t_k"
        longest = max(one.longest_hold for one in built)
        notes.append(f"commands: {how}; the longest time without a new one inside an episode is {longest:.3g} s")
    made = [s.channel.name for s in mapping.state if s.derivative_of is not None]
    if made:
        notes.append(f"velocities: {', '.join(made)} differentiated, {describe(mapping.velocities)}")
    if mapping.smoothing.channels:
        notes.append(f"smoothed: {', '.join(mapping.smoothing.channels)}, {describe(mapping.smoothing)}")
    held = recording.held_out
    if held is None:
        notes.append("held out: nothing")
    elif held.episodes_from is not None:
        notes.append(f"held out: episodes from {held.episodes_from} on")
    else:
        notes.append(f"held out: time from {held.time_from:g} s on")
    return tuple(notes)


def describe(smoothing: Smoothing) -> str:
    """A smoothing choice in words."""
    edges = "edges trimmed" if smoothing.edges == "trim" else "edges by a one-sided fit"
    if smoothing.method == "gaussian":
        return f"Gaussian smoothing of sigma = {smoothing.sigma:g} samples of the source, {edges}"
    if smoothing.method == "savgol":
        return f"Savitzky-Golay, {smoothing.window} samples, order {smoothing.order}, {edges}"
    return f"no smoothing, {edges}"


def _warnings(mapping: ImportMapping, recording: Recording, built: Sequence[Assembled]) -> tuple[str, ...]:
    found = []
    clocks = {(count.topic, count.clock) for one in built for count in one.counts}
    kinds = {"header" if name == "header" else "receive" for _, name in clocks if name[:6] in ("header", "receiv")}
    if len(kinds) > 1:
        on = ", ".join(sorted(topic for topic, name in clocks if name.startswith("receive")))
        found.append(f"header stamps and receive times are mixed ({on} on receive time): transport delay is an offset")
    steps = np.concatenate([np.diff(e.t) for e in recording.episodes])
    if mapping.rate is None and float(steps.max()) > 1.5 * recording.dt:
        found.append(f"steps are uneven, {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms; give a rate to even them")
    lost: dict[str, list[int]] = {}
    for one in built:
        for count in one.counts:
            total = lost.setdefault(count.topic, [0, 0])
            total[0] += count.read
            total[1] += count.kept
    found += [
        f"{topic}: only {100.0 * kept / read:.0f} % of its rows lie in an episode"
        for topic, (read, kept) in lost.items()
        if read and kept < 0.5 * read
    ]
    return tuple(found)


def _origins(counts: Sequence[EpisodeCount]) -> dict[str, Any]:
    """Episode name -> the log it is from and where it starts there."""
    return {count.name: {"log": count.source, "start_s": round(count.start, 6)} for count in counts}


def _mapping_metadata(mapping: ImportMapping) -> dict[str, Any]:
    metadata: dict[str, Any] = {
        "state": {source.channel.name: as_metadata(source) for source in mapping.state},
        "action": {source.channel.name: as_metadata(source) for source in mapping.action},
        "rate": "source" if mapping.rate is None else mapping.rate,
        "gap_limit_s": mapping.gap_limit,
        "commands": mapping.commands,
    }
    if mapping.differentiates:
        metadata["velocities"] = describe(mapping.velocities)
    if mapping.smoothing.channels:
        metadata["smoothing"] = f"{', '.join(mapping.smoothing.channels)}: {describe(mapping.smoothing)}"
    return metadata
