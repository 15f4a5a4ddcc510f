"""`--trust`: an option of every command; and what a command line names itself, which is trusted without it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import typer

from gpsim.trust import consent, trust_data

from .everywhere import Flag, Path

NAME = "trust"
OPTION = "--trust"
Trust = Annotated[
    bool,
    typer.Option(OPTION, help="Run Python files and modules that recordings, mappings and diagnoses name."),
]
NAMING = ("system", "model")
"""Words about a raw log that name a simulator."""


def _heard(path: Path) -> None:
    trust_data()


FLAG = Flag(NAME, Trust, _heard)


def named(simulator: str | None, words: Iterable[str] = ()) -> None:
    """The user names this simulator, and those that the words about a raw log name."""
    consent(simulator)
    for word in words:
        key, _, value = word.partition("=")
        if key in NAMING:
            consent(value)


def named_effects(references: Iterable[str] | None) -> tuple[str, ...]:
    """The user names these files of effects."""
    if not references:
        return ()
    from gpsim.effects import consent_to  # it loads NumPy, which `--help` does not wait for

    given = tuple(references or ())
    for reference in given:
        consent_to(reference)
    return given
