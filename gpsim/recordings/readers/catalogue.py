"""Streams of a bag and how many messages each has, gathered record by record."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from gpsim.recordings.readers.source import Stream


@dataclass
class Tally:
    """Messages of one stream: how many, first and last receive time [ns]."""

    count: int = 0
    start: int | None = None
    end: int | None = None

    def add(self, count: int, start: int, end: int) -> None:
        """Count more messages."""
        self.count += count
        self.start = start if self.start is None else min(self.start, start)
        self.end = end if self.end is None else max(self.end, end)


@dataclass
class Catalogue:
    """Streams by id and what is known of their messages; chunks: the streams in the chunk that begins at a byte."""

    streams: dict[int, Stream] = field(default_factory=dict)
    tallies: dict[int, Tally] = field(default_factory=dict)
    chunks: dict[int, frozenset[int]] = field(default_factory=dict)

    def tally(self, stream: int) -> Tally:
        """The tally of a stream, made when first asked for."""
        return self.tallies.setdefault(stream, Tally())

    def add(self, stream: Stream) -> None:
        """Note a stream; the first description of it that can be used stays."""
        known = self.streams.get(stream.id)
        if known is None or (known.fault and not stream.fault):
            self.streams[stream.id] = stream

    def result(self) -> list[Stream]:
        """The streams with their counts and times."""
        empty = Tally()
        found = [(s, self.tallies.get(s.id, empty)) for s in self.streams.values()]
        return [replace(s, count=t.count, start=t.start, end=t.end) for s, t in found]
