"""What happens when a file is not what it should be: stop with one line, or go on and count."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.recordings.names import one_line as one_line  # the readers' messages are made here

# Largest piece of a file that is ever held in memory at once [bytes]: a chunk after decompression, a message, a
# definition. Recorders write chunks of about 1 MB; a file that declares more than this is damaged or hostile.
MAX_CHUNK = 256 << 20
MAX_MESSAGE = 64 << 20
MAX_DEFINITION = 256 << 10
MAX_HEADER = 1 << 20
# Largest effort for a file: damaged places that salvage walks around.
MAX_PLACES = 10_000


class DamageError(Exception):
    """A piece of a file cannot be read: `reason` says why. Never leaves this package."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Ledger:
    """Counts what was lost, or refuses at the first loss.

    salvage: False raises UsageError(file, where, reason, remedy) at the first call of `lost`; True counts by reason.
    """

    def __init__(self, path: Path, *, salvage: bool) -> None:
        self.path = path
        self.salvage = salvage
        self.file: Counter[str] = Counter()
        self.topics: dict[str, Counter[str]] = {}
        self._readings: list[Ledger] = []
        self._places = 0

    def lost(self, reason: str, where: str, topic: str | None = None, count: int = 1) -> None:
        """Record that `count` messages of `topic` (None: a piece of the file) are lost."""
        if not self.salvage:
            place = f"{where}, topic {topic}" if topic else where
            raise UsageError(
                f"{self.path}: {place}: {one_line(reason)}; "
                "copy the file again, or import what is readable with --salvage"
            )
        key = one_line(reason)
        self._places += 1
        if topic is None:
            self.file[key] += count
        else:
            self.topics.setdefault(topic, Counter())[key] += count

    @property
    def exhausted(self) -> bool:
        """Whether the file is damaged in so many places that the search for more of it is to end."""
        return self._places > MAX_PLACES

    def same(self) -> Ledger:
        """A fresh ledger of the same kind, for one reading of the file."""
        fresh = Ledger(self.path, salvage=self.salvage)
        self._readings.append(fresh)
        return fresh

    def pieces(self) -> dict[str, int]:
        """Pieces of the file that were lost, by reason; a piece that several readings miss is lost once."""
        found: Counter[str] = Counter()
        for reading in self._readings:
            found |= reading.file
        return dict(self.file + found)

    def silent(self) -> Ledger:
        """A ledger for a second look at the same file: never refuses, and what it counts is not kept."""
        return Ledger(self.path, salvage=True)

    def of(self, topic: str) -> dict[str, int]:
        """Messages of `topic` that were lost, by reason."""
        return dict(self.topics.get(topic, Counter()))


def refusal(path: Path, where: str, reason: str) -> UsageError:
    """The error for damage that nothing can be read behind."""
    return UsageError(f"{path}: {where}: {one_line(reason)}; copy the file again or record anew")


def wrong_kind(path: Path, kind: str, why: str) -> UsageError:
    """The error for a file that is not what its name promises."""
    return UsageError(
        f"{path}: byte 0: not {kind} ({why}); name the file by its kind, or export the log again"
    )


def regular_file(path: Path) -> int:
    """Size [bytes] of an ordinary, readable, non-empty file; UsageError for anything else."""
    try:
        if not path.is_file():
            what = (
                "is a folder"
                if path.is_dir()
                else "is not an ordinary file"
                if path.exists()
                else "does not exist"
            )
            raise UsageError(f"{path}: {what}; name a log file or a ROS 2 bag folder")
        size = path.stat().st_size
        with path.open("rb"):
            pass
    except (OSError, ValueError) as error:
        raise UsageError(
            f"{one_line(path)}: cannot be opened: {one_line(error)}; check the path and its rights"
        ) from error
    if size == 0:
        raise UsageError(f"{path}: the file is empty; copy it again")
    return size
