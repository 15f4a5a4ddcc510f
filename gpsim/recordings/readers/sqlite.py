"""ROS 2 sqlite3 storage (.db3): read with Python's sqlite3, in file order, nothing sorted and nothing written.

rosbags' reader asks sqlite to sort all messages by time; here rows stream in the order in which they were written.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from gpsim.recordings.readers.damage import (
    MAX_MESSAGE,
    DamageError,
    Ledger,
    one_line,
    refusal,
    regular_file,
    wrong_kind,
)
from gpsim.recordings.readers.source import LATEST, Catalogue, DefinitionFormat, Message, Stream, topic_name

_MAGIC = b"SQLite format 3\x00"
_FORMATS: dict[str, DefinitionFormat] = {"ros2msg": "msg", "ros2idl": "idl"}
_TOPICS = ("id", "name", "type", "serialization_format")
_MESSAGES = ("topic_id", "timestamp", "data")
_SINGLE_STEPS = 50
_SMALLEST_ROW = 8
_LAST_ROW = 2**62
_FAULTS = (sqlite3.Error, DamageError, OverflowError, MemoryError)


@dataclass
class Sqlite:
    """One .db3 file. `where` is the row being read."""

    path: Path
    distro: str | None = None
    _row: int = 0

    def __post_init__(self) -> None:
        self.size = regular_file(self.path)

    @property
    def where(self) -> str:
        """The row being read."""
        return f"row {self._row}"

    @contextmanager
    def _open(self, *, salvage: bool) -> Iterator[sqlite3.Connection]:
        with self.path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise wrong_kind(self.path, "a sqlite3 file", "it does not begin with SQLite format 3")
        # immutable: no journal, no lock, no write; a write-ahead log beside the file is looked for in `streams`.
        uri = f"{self.path.resolve().as_uri()}?immutable=1"
        with closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as base:
            base.text_factory = bytes
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_MESSAGE)
            base.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
            base.execute("PRAGMA trusted_schema=OFF")
            if salvage:
                # sqlite's own recovery mode: the only way it opens a file that is shorter than its header says.
                base.execute("PRAGMA writable_schema=ON")
            # A page tree can be bent so that one page counts a billion times: no honest file needs more steps.
            left = [100 + self.size // 20_000]

            def spend() -> int:
                left[0] -= 1
                return int(left[0] < 0)

            base.set_progress_handler(spend, 100_000)
            yield base

    def streams(self, ledger: Ledger) -> Sequence[Stream]:
        """The rows of the table `topics`, counted in the table `messages`."""
        unwritten = self.path.with_name(f"{self.path.name}-wal")
        if unwritten.is_file() and unwritten.stat().st_size:
            what = f"messages in {unwritten.name} were never written into the bag (sqlite3 would do it)"
            ledger.lost(what, "byte 0")
        streams: list[Stream] = []
        try:
            with self._open(salvage=ledger.salvage) as base:
                self._check_tables(base)
                known = _definitions(base, ledger)
                rows = base.execute(f"SELECT {', '.join(_TOPICS)} FROM topics ORDER BY +id").fetchall()
        except _FAULTS as error:
            reason = f"sqlite3 bag cannot be read: {one_line(error)}"
            ledger.lost(reason, "table topics")
            # Salvage has nothing to offer where the schema or the topics cannot be read.
            raise refusal(self.path, "table topics", reason) from error
        for row in rows:
            try:
                streams.append(_stream(row, known))
            except DamageError as error:
                ledger.lost(error.reason, "table topics")
        found = Catalogue({s.id: s for s in streams})
        try:
            with self._open(salvage=ledger.salvage) as base:
                query = "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY +topic_id"
                for topic, count, start, end in base.execute(query).fetchall():
                    found.tally(topic, count, _time(start), _time(end))
        except _FAULTS as error:
            ledger.lost(f"messages cannot be counted: {one_line(error)}", "table messages")
            found.tallies.clear()
            for topic, stamp, _ in self._rows(None, ledger.silent()):
                found.tally(topic, 1, stamp, stamp)
        orphans = sum(tally[0] for topic, tally in found.tallies.items() if topic not in found.streams)
        if orphans:
            ledger.lost(f"{orphans} messages belong to no topic", "table messages")
        return found.result()

    def _check_tables(self, base: sqlite3.Connection) -> None:
        names = base.execute("SELECT name FROM sqlite_master WHERE type='table'")
        tables = {_text(name) for (name,) in names}
        for table, columns in (("topics", _TOPICS), ("messages", _MESSAGES)):
            if table not in tables or not set(columns) <= _columns(base, table):
                what = f"it has no table {table} with {', '.join(columns)}"
                raise wrong_kind(self.path, "a ROS 2 bag", what)

    def messages(self, wanted: Collection[int], ledger: Ledger) -> Iterator[Message]:
        """Messages of the wanted topics in file order."""
        return self._rows(sorted(wanted), ledger)

    def _rows(self, wanted: Sequence[int] | None, ledger: Ledger) -> Iterator[Message]:
        """Rows in order of their numbers; behind a damaged page the search goes on (salvage only)."""
        chosen = "" if wanted is None else f"AND +topic_id IN ({', '.join(str(int(i)) for i in wanted)})"
        query = (
            f"SELECT rowid, topic_id, timestamp, data FROM messages WHERE rowid > ? {chosen} ORDER BY rowid"
        )
        last, failures, left = -1, 0, 100 + self.size // _SMALLEST_ROW
        with self._open(salvage=ledger.salvage) as base:
            while last < _LAST_ROW:
                try:
                    for row, topic, stamp, data in base.execute(query, (last,)):
                        left -= 1
                        if row <= last or left < 0:
                            raise sqlite3.DatabaseError(f"row {row} comes behind row {last}")
                        self._row = last = row
                        failures = 0
                        if isinstance(data, bytes) and isinstance(stamp, int) and 0 <= stamp < LATEST:
                            yield topic, stamp, data
                        else:
                            ledger.lost("a message's time or data are no time or no data", self.where)
                    return
                except (sqlite3.Error, OverflowError, MemoryError) as error:
                    if failures == 0:
                        ledger.lost(f"rows cannot be read: {one_line(error)}", f"behind row {last}")
                    failures += 1
                    # Rows of a damaged page are few and close together; a damaged branch of the tree is wide.
                    last += 1 if failures < _SINGLE_STEPS else 2 ** (failures - _SINGLE_STEPS)


def _columns(base: sqlite3.Connection, table: str) -> set[str]:
    return {_text(row[1]) for row in base.execute(f"PRAGMA table_xinfo({table})") if row[6] == 0}


def _stream(row: tuple[object, ...], known: dict[str, tuple[str, DefinitionFormat]]) -> Stream:
    identity, name, kind, encoding = row
    if not isinstance(identity, int) or not 0 <= identity < 2**31:
        raise DamageError(f"a topic's number is {one_line(identity, 40)!r}")
    topic, fault = topic_name(name if isinstance(name, bytes) else b"")
    try:
        spelled, encoded = _text(kind), _text(encoding)
    except DamageError as error:
        return Stream(identity, topic, "unknown", "", "none", "", fault=fault or error.reason)
    definition, form = known.get(spelled, ("", "none"))
    return Stream(identity, topic, spelled, definition, form, encoded, fault=fault)


def _definitions(base: sqlite3.Connection, ledger: Ledger) -> dict[str, tuple[str, DefinitionFormat]]:
    """Definitions by type, which bags hold since ROS 2 Iron; empty in older ones."""
    names = ("topic_type", "encoding", "encoded_message_definition")
    if not set(names) <= _columns(base, "message_definitions"):
        return {}
    known: dict[str, tuple[str, DefinitionFormat]] = {}
    try:
        for row in base.execute(f"SELECT {', '.join(names)} FROM message_definitions"):
            try:
                kind, form, definition = (_text(value) for value in row)
            except DamageError:  # concerns the topics of this type only: they have no definition
                continue
            if form in _FORMATS and definition:
                known[kind] = (definition, _FORMATS[form])
    except sqlite3.Error as error:
        ledger.lost(f"definitions cannot be read: {one_line(error)}", "table message_definitions")
    return known


def _text(value: object) -> str:
    if not isinstance(value, bytes):
        raise DamageError(f"text expected, found {one_line(value, 40)!r}")
    try:
        return value.decode()
    except UnicodeDecodeError as error:
        raise DamageError(f"text expected, found {one_line(value[:40])}") from error


def _time(value: object) -> int:
    """A receive time [ns since 1970]."""
    if not isinstance(value, int) or not 0 <= value < LATEST:
        raise DamageError(f"a message's time is {one_line(value, 40)!r}")
    return value
