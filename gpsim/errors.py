"""The exceptions that end a command: bad input, in one line, and being asked to end."""

import difflib
import signal
from collections.abc import Iterable
from pathlib import Path


class UsageError(Exception):
    """Bad input: the message is one line that says what is wrong, where, and what to do.

    table: lines that the command line prints above it, where there is something to choose from.

    The command line turns it into `error: <message>` and exit code 2, without a traceback. Names in it are from files:
    line breaks in them become blanks, other control characters `?`.
    """

    def __init__(self, message: object = "", *, table: Iterable[str] = ()) -> None:
        super().__init__(message)
        self.table = tuple(table)
        if self.table:
            self.add_note("\n".join(self.table))  # which Python shows below the message

    def __str__(self) -> str:
        line = " ".join(super().__str__().splitlines())
        return line if line.isprintable() else "".join(c if c.isprintable() else "?" for c in line)


class NoDiagnosis(UsageError):  # noqa: N818  # what happened is no error of the recording's
    """A sound recording of which no diagnosis is possible: too short, or nothing moves in it.

    The command line ends with exit code 3: nothing is to be corrected, another recording is to be made.
    """


def nearest(name: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Which of the known names was meant; None where none is like it."""
    return next(iter(difflib.get_close_matches(name, list(known), n=1, cutoff=cutoff)), None)


def near(name: str, known: Iterable[str]) -> str:
    """What was meant, in parentheses behind a name that is not among those known; empty where none is like it."""
    names = list(known)
    heads = {k[: len(name)]: k for k in names}  # also of a name that was but begun
    found = nearest(name, names) or heads.get(nearest(name, heads, 0.8) or "")
    return f" (did you mean '{found}'?)" if found else ""


def near_path(path: Path) -> str:
    """The same behind a path that is not there, by what lies in its folder."""
    try:
        found = nearest(path.name, [p.name for p in path.parent.iterdir()])
    except OSError:
        return ""
    return f" (did you mean {path.parent / found}?)" if found else ""


CODE = 128 + signal.SIGTERM
"""The exit code of a process that ended because it was asked to."""


class Terminated(SystemExit):
    """The process is asked to end: it cleans up as after Ctrl-C."""

    def __init__(self) -> None:
        super().__init__(CODE)
