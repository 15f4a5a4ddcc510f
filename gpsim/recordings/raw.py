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
    start, end: receive time of the first and the last message [s], None when empty; has_header: stamps of its own;
    texts: columns of text, read as 0, 1, 2 ... in the order in which their words first appear; fault: why nothing of
    it can be read, empty where it can.
    """

    name: str
    type: str
    count: int
    fields: tuple[str, ...]
    start: float | None
    end: float | None
    has_header: bool
    texts: tuple[str, ...] = ()
    fault: str = ""


@dataclass(frozen=True)
class Series:
    """The wanted fields of one topic in file order.

    receive: (N,) s, when the logger wrote it; header: (N,) s, the message's own stamp, None where it has none;
    fields: dotted path to (N,) values; read, dropped: messages decoded and messages that could not be, by reason;
    absent: by field, the rows whose message has no such element (an array too short, another element selected):
    NaN there is no damage.
    """

    topic: str
    type: str
    receive: FloatArray
    header: FloatArray | None
    fields: Mapping[str, FloatArray]
    read: int
    dropped: Mapping[str, int] = field(default_factory=dict)
    absent: Mapping[str, int] = field(default_factory=dict)


class RawLog(Protocol):
    """A log file of any format.

    epoch_ns: what all its stamps are counted from [ns since 1970]; 0 in tables. losses: pieces of the file that a
    log opened for salvage could not read, by reason.
    """

    epoch_ns: int

    @property
    def losses(self) -> Mapping[str, int]:
        """Pieces of the file that could not be read, by reason."""
        ...

    def topics(self) -> Sequence[Topic]:
        """What is inside."""
        ...

    def series(self, wanted: Mapping[str, Sequence[str]]) -> Mapping[str, Series]:
        """Read the wanted dotted fields by topic, message by message, in bounded memory.

        Raises UsageError (file, offset or row, reason, remedy) at damage; a log opened for salvage returns what was
        readable instead and counts the rest in `Series.dropped`.
        """
        ...
