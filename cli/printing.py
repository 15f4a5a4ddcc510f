"""What the commands print: every text letter by letter."""

from __future__ import annotations

import typer

from gpsim.reports.printable import printable


def say(line: object = "") -> None:
    """Print one line, or several, without control characters."""
    typer.echo(printable(line))
