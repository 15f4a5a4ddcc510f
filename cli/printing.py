"""What the commands print: every text letter by letter."""

from __future__ import annotations

import sys

import typer

from gpsim.reports.printable import printable

PLAIN = str.maketrans(
    dict.fromkeys("█▉▊▋▌", "#") | dict.fromkeys("▍▎▏", ".") | dict(zip("–…·²³→±", "-.-23>~", strict=True))
)
"""For a terminal that has ASCII alone: a letter for a letter, so that tables stay tables."""


def say(line: object = "") -> None:
    """Print one line, or several, without control characters."""
    text = printable(line)
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        text = text.translate(PLAIN).encode(encoding, "replace").decode(encoding)
    typer.echo(text)
