"""Channels bound to the topics and parts of a log, and what is to be read of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray, IntArray
from gpsim.errors import UsageError
from gpsim.recordings.mapping import ChannelSource, EpisodeRule, ImportMapping
from gpsim.recordings.raw import Series, Topic

# transforms[child_frame_id=cart].transform...: every element that matches makes a row of its own
_SELECTION = re.compile(r"([\w.]+\[[^\]=]+=[^\]]*\])\.")


@dataclass(frozen=True)
class Bound:
    """A mapping whose channels know their topic and part; flag: the field that `episodes` goes by, as a channel."""

    mapping: ImportMapping
    flag: ChannelSource | None = None

    @property
    def roles(self) -> Mapping[str, Sequence[ChannelSource]]:
        """What is read, by what it is for; one role needs all of its fields in one row."""
        return {
            "state": self.mapping.measured,
            "action": self.mapping.action,
            "flag": () if self.flag is None else (self.flag,),
        }

    def changed(self, change: Callable[[ChannelSource, str], ChannelSource]) -> Bound:
        """The same with every source as `change(source, role)` makes it."""
        state = tuple(change(source, "state") for source in self.mapping.state)
        action = tuple(change(source, "action") for source in self.mapping.action)
        flag = None if self.flag is None else change(self.flag, "flag")
        return Bound(replace(self.mapping, state=state, action=action), flag)


@dataclass(frozen=True)
class Group:
    """Channels of one track that are found in the same rows.

    part: what the rows are called beside the topic; fields: what they hold; missing: rows where some of it is
    absent; is_state: whether state is among it.
    """

    part: str
    fields: tuple[str, ...]
    missing: IntArray
    is_state: bool


def bind(name: str, mapping: ImportMapping, topics: Mapping[str, Topic]) -> Bound:
    """Bind unnamed topics to the only one there is, and channels to the part of a topic that selects their element.

    name: of the log. Raises UsageError where a topic is not there, not named, or a channel's column holds text.
    """
    only = next(iter(topics)) if len(topics) == 1 else None
    rule = mapping.episodes
    flag = (
        None if rule.column is None else ChannelSource(rule.column, "", topic=rule.topic, field=rule.column)
    )
    bound = Bound(mapping, flag).changed(lambda source, _: replace(source, topic=source.topic or only))
    sources = [source for role in bound.roles.values() for source in role]
    if any(source.topic is None for source in sources):
        raise UsageError("mapping: the log has several topics, so every channel must name its topic")
    selections: dict[str, dict[str, None]] = {}
    for source in sources:
        topic = source.topic or ""
        if topic not in topics:
            raise UsageError(f"{name}: no topic '{topic}'; there are: {', '.join(topics) or 'none'}")
        _refuse_text(name, source, topics[topic], rule)
        selections.setdefault(topic, {})[_selection(source)] = None
    several = {topic for topic, found in selections.items() if len(found) > 1}
    # Rows of one selection hold nothing of another: where a topic has several, each is a part.
    return bound.changed(lambda s, _: replace(s, part=_selection(s)) if s.topic in several else s)


def _selection(source: ChannelSource) -> str:
    """The element that the channel's fields are of, as `transforms[child_frame_id=cart]`; empty without one."""
    found = _SELECTION.match(source.fields[0]) if source.fields else None
    return "" if found is None else found[1]


def _refuse_text(name: str, source: ChannelSource, topic: Topic, rule: EpisodeRule) -> None:
    for field in source.fields:
        if field in topic.texts and not (rule.by == "column" and field == rule.field):
            raise UsageError(
                f"{name}: column '{field}' holds text, which only episodes.by=column can use; "
                f"numeric columns are: {', '.join(topic.fields[:20]) or 'none'}"
            )


def wanted_fields(bound: Bound) -> list[dict[str, tuple[str, list[str]]]]:
    """What to read: topic -> (track, fields). Several readings where a topic has several selections.

    A reading makes one row for each element that its fields select, so fields of two selections in one reading would
    leave every row half empty, and nobody could tell an empty row from a damaged one.
    """
    fields: dict[str, dict[str, list[str]]] = {}
    for sources in bound.roles.values():
        for source in sources:
            of_track = fields.setdefault(source.topic or "", {}).setdefault(source.track, [])
            of_track += [field for field in source.fields if field not in of_track]
    if bound.mapping.time is not None:
        for tracks in fields.values():
            for of_track in tracks.values():
                of_track += [field for field in bound.mapping.time.fields if field not in of_track]
    readings = max((len(tracks) for tracks in fields.values()), default=0)
    return [
        {topic: list(tracks.items())[number] for topic, tracks in fields.items() if number < len(tracks)}
        for number in range(readings)
    ]


def groups(track: str, series: Series, bound: Bound) -> tuple[Bound, list[Group]]:
    """Part a track whose state, action and flag are not missing in the same rows.

    An empty state must not take the command of its row with it, nor the other way round. Where all are found in the
    same rows they stay together, under the track's own name.
    """
    clock = () if bound.mapping.time is None else bound.mapping.time.fields
    together: dict[bytes, tuple[BoolArray, dict[str, list[ChannelSource]]]] = {}
    for role, every in bound.roles.items():
        own = [source for source in every if source.track == track]
        if own:
            missing = _missing(series, (*(field for source in own for field in source.fields), *clock))
            together.setdefault(missing.tobytes(), (missing, {}))[1][role] = own
    found: list[Group] = []
    parts: dict[str, str] = {}
    for missing, roles in together.values():
        first = next(iter(roles.values()))[0]
        part = first.part if len(together) == 1 else ", ".join([*filter(None, [first.part]), *roles])
        parts |= dict.fromkeys(roles, part)
        held = [field for sources in roles.values() for source in sources for field in source.fields]
        fields = tuple(dict.fromkeys([*held, *clock]))
        found.append(Group(part, fields, np.flatnonzero(missing), "state" in roles))

    def moved(source: ChannelSource, role: str) -> ChannelSource:
        return replace(source, part=parts[role]) if source.track == track and role in parts else source

    return bound.changed(moved), found


def _missing(series: Series, fields: Sequence[str]) -> BoolArray:
    """(N,) rows that hold nothing where something was asked for, and are known to be so."""
    empty = np.zeros(len(series.receive), dtype=np.bool_)
    for field in fields:
        if series.absent.get(field):
            empty |= np.isnan(series.fields[field])
    return empty


def finds_all(mapping: ImportMapping, topics: Sequence[Topic]) -> bool:
    """Whether every topic and field that the mapping names is there; channels without a topic want a single one."""
    only = topics[0].name if len(topics) == 1 else None
    held = {topic.name: {*topic.fields, *topic.texts} for topic in topics if not topic.fault}
    wanted = [
        (source.topic or only, source.fields) for source in (*mapping.state, *mapping.action) if source.fields
    ]
    if mapping.episodes.column is not None:
        wanted.append((mapping.episodes.topic or only, (mapping.episodes.column,)))
    for fields in mapping.episodes.variants.values():
        wanted += [(only, (field,)) for field in fields.values()]
    if mapping.time is not None:
        wanted += [(topic, mapping.time.fields) for topic, _ in tuple(wanted)]
    return all(topic in held and held[topic].issuperset(fields) for topic, fields in wanted)
