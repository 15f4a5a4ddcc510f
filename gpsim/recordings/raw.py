"""Raw logs as they lie in a file: topics with numeric fields over time, before one clock is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from gpsim.channels import FloatArray


@dataclass(frozen=True)
class Topic:
    """One topic (or one table) of a log: what `gpsim import --inspect` lists.

    fields: dotted paths of the numeric fields, as `pose.position.x`; count: messages or rows;
    start, end: receive time of the first and the last message [s], None when empty; has_header: stamps of its own.
    """

    name: str
    type: str
    count: int
    fields: tuple[str, ...]
    start: float | None
    end: float | None
    has_header: bool


@dataclass(frozen=True)
class Series:
    """The wanted fields of one topic in file order.

    receive: (N,) s, when the logger wrote it; header: (N,) s, the message's own stamp, None where it has none;
    fields: dotted path to (N,) values; read, dropped: messages decoded and messages that could not be, by reason.
    """

    topic: str
    type: str
    receive: FloatArray
    header: FloatArray | None
    fields: Mapping[str, FloatArray]
    read: int
    dropped: Mapping[str, int] = field(default_factory=dict)


class RawLog(Protocol):
    """A log file of any format."""

    def topics(self) -> Sequence[Topic]:
        """What is inside."""
        ...

    def series(self, wanted: Mapping[str, Sequence[str]]) -> Mapping[str, Series]:
        """Read the wanted dotted fields by topic, message by message, in bounded memory.

        Raises UsageError (file, offset or row, reason, remedy) at damage; a log opened for salvage returns what was
        readable instead and counts the rest in `Series.dropped`.
        """
        ...
