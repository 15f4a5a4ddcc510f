"""What every bag container offers, whatever its bytes look like: streams, and messages in file order."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from gpsim.recordings.names import fault_of, one_line
from gpsim.recordings.readers.damage import Ledger

DefinitionFormat = Literal["msg", "idl", "none"]
Message = tuple[int, int, bytes]
"""(stream id, receive time [ns since 1970], serialised message)."""


@dataclass(frozen=True)
class Stream:
    """One publisher of one topic (ROS 1: connection, mcap: channel, sqlite3: topic).

    count: messages the index announces, None without an index; start, end: first and last receive time [ns];
    type: in ROS 2 spelling, as geometry_msgs/msg/PoseStamped; digest: md5 of the definition (ROS 1), else "".
    fault: why it cannot be read, known before any message is looked at; it concerns nobody who wants other topics.
    """

    id: int
    topic: str
    type: str
    definition: str
    format: DefinitionFormat
    encoding: str
    digest: str = ""
    count: int | None = None
    start: int | None = None
    end: int | None = None
    fault: str = ""


LATEST = 2**62
"""A receive time [ns] no message can have: in the year 2116."""


def topic_name(raw: bytes | str) -> tuple[str, str]:
    """(a topic's name, why it is none): a name that cannot be shown in a line stands between quotes, with a fault."""
    try:
        name = raw.decode() if isinstance(raw, bytes) else raw
    except UnicodeDecodeError:
        return f"'{one_line(raw, 60)}'", "its name is no text"
    fault = fault_of(name)
    return (name, "") if not fault else (f"'{one_line(name, 60)}'", f"its name {fault}")


class Container(Protocol):
    """A bag file or folder.

    distro: the ROS 2 distribution it says it was recorded with, known once `streams` was asked for; size: of a file, in
    bytes.
    """

    distro: str | None
    size: int

    @property
    def where(self) -> str:
        """The place being read."""
        ...

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """The streams, from the index where the file has a sound one, else from a walk through the file."""
        ...

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """The messages of the wanted streams in file order, one chunk in memory at a time."""
        ...
