"""What a recording could not be asked, a line each."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.report import NotAsked

MOST_NAMED = 4
"""Families that are named in a line; of more their number is said."""


def not_asked_lines(entries: Sequence[NotAsked]) -> list[str]:
    """One line each: what never changed, was not measured or was settled, and what is left out for it."""
    return [_line(entry) for entry in entries]


def _line(entry: NotAsked) -> str:
    name, value = entry.channel, f"{entry.value:g} {entry.unit}" if entry.value is not None else ""
    said = {
        "no command": f"{name} was not recorded and is taken as 0 {entry.unit}",
        "constant command": f"{name} never changes ({value})",
        "constant": f"{name} never changes: it says little",
        "held": f"{name} never changes ({value}): it is taken as held still from outside",
        "not needed": f"{name} was not measured, and nothing that was depends on it: it is left out",
        "estimated": f"{name} was not measured and is estimated",
        "known": f"{name} is known ({value})",
        "asked": "left out as you said",
        "does nothing": f"{name} is required and does nothing here: it is left out",
    }[entry.because]
    return said + (f"; not asked: {_families(entry.families)}" if entry.families else "")


def _families(families: Sequence[str]) -> str:
    names = [family.replace("_", " ") for family in families]
    if len(names) > MOST_NAMED:
        return f"{', '.join(names[:MOST_NAMED])} and {len(names) - MOST_NAMED} more families"
    return ", ".join(names)
