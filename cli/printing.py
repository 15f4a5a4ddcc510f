"""What the commands print: every text letter by letter."""

from __future__ import annotations

import sys

import typer
from rich.console import Console

from gpsim.reports.sheets import printable

from .answers import asked
from .progress import QUIET

PLAIN = str.maketrans(
    dict.fromkeys("█▉▊▋▌", "#") | dict.fromkeys("▍▎▏", ".") | dict(zip("–…·²³→±", "-.-23>~", strict=True))
)
"""For a terminal that has ASCII alone: a letter for a letter, so that tables stay tables."""


def say(line: object = "") -> None:
    """Print one line, or several, without control characters: with --json to stderr, and then not if --quiet."""
    if _nobody_reads():
        return
    text = printable(line)
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(PLAIN).encode(encoding, "replace").decode(encoding)
    typer.echo(text)


def console(width: int | None = None, *, highlight: bool = True) -> Console:
    """Where tables are printed, as `say` prints lines."""
    return Console(width=width, highlight=highlight, quiet=_nobody_reads())


def _nobody_reads() -> bool:
    return asked() and QUIET.get()
