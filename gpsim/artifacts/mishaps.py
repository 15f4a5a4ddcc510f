"""What goes wrong beside a result that is there already: said and written down, and no reason to lose the result."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.files import FULL, REFUSED, read_json, tells_of_full_disk, write_json

WARNINGS = "warnings.json"
"""A file of an artifact, there only where something went wrong: a list of lines."""


class Mishaps:
    """Lines about what went wrong, in the order in which it did."""

    def __init__(self, lines: Iterable[str] = ()) -> None:
        self.lines = list(lines)

    @contextmanager
    def contained(self, what: str) -> Iterator[None]:
        """An error within the block becomes the line "WHAT: error".

        What is the user's to mend, bad input or a disk that is full, ends the program as ever.
        """
        try:
            yield
        except UsageError:
            raise
        except Exception as error:  # drawing, and fitting what comes beside the result, may raise anything
            if isinstance(error, OSError) and (
                error.errno in (*FULL, *REFUSED) or tells_of_full_disk(str(error))
            ):
                raise
            self.lines.append(f"{what}: {in_short(error)}")

    def write(self, folder: Path) -> None:
        """To the artifact's folder, if there are any."""
        if self.lines:
            write_json(folder / WARNINGS, self.lines)


def read_warnings(folder: Path) -> list[str]:
    """What went wrong when a finished artifact was made."""
    path = folder / WARNINGS
    if not path.is_file():
        return []
    lines = read_json(path)
    return [str(line) for line in lines] if isinstance(lines, list) else []


def in_short(error: BaseException) -> str:
    """An error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:160]}".removesuffix(": ")
