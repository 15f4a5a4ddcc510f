"""`--quiet`, `-q`: an option of every command, before it or behind it."""

from __future__ import annotations

from typing import Annotated

import typer

from .everywhere import Flag, Path
from .progress import QUIET

NAME = "quiet"
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="No progress and no notes on stderr: results and errors alone.")
]


def _heard(path: Path) -> None:
    QUIET.set(True)


FLAG = Flag(NAME, Quiet, _heard)
