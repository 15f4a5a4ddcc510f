"""Does a log hold what a mapping asks for? Told by its topics and columns, before any row is read."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.recordings.mapping import ImportMapping
from gpsim.recordings.raw import Topic


def finds_all(mapping: ImportMapping, topics: Sequence[Topic]) -> bool:
    """Whether every topic and field that the mapping names is there; channels without a topic want a single one."""
    only = topics[0].name if len(topics) == 1 else None
    held = {topic.name: {*topic.fields, *topic.texts} for topic in topics if not topic.fault}
    wanted = [
        (source.topic or only, source.fields) for source in (*mapping.state, *mapping.action) if source.fields
    ]
    if mapping.episodes.by != "file" and mapping.episodes.field is not None:
        wanted.append((mapping.episodes.topic or only, (mapping.episodes.field,)))
    for fields in mapping.episodes.variants.values():
        wanted += [(only, (field,)) for field in fields.values()]
    if mapping.time is not None:
        wanted += [(topic, mapping.time.fields) for topic, _ in tuple(wanted)]
    return all(topic in held and held[topic].issuperset(fields) for topic, fields in wanted)
