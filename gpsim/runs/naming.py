"""The artifact that a person means: by its path, or by the end of its name below runs/."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.runs.catalogue import Catalogue, Entry

SHOWN = 5
"""Names that a message lists."""


def named(catalogue: Catalogue, word: str) -> Entry:
    """The artifact: a folder's path, `cartpole/fit-gp/v0003`, or `fit-gp/v3` where one experiment has that.

    What lies elsewhere is found where the catalogue was read beside it. Raises UsageError for none, and for several.
    """
    path = Path(word)
    for entry in catalogue.entries:
        if entry.name == word.rstrip("/") or _same(entry.path, path):
            return entry
    wanted = _padded(word)
    found = [entry for entry in catalogue.entries if f"/{entry.name}".endswith(f"/{wanted}")]
    if len(found) == 1:
        return found[0]
    if found:
        raise UsageError(f"{word}: several: {listed(found)}; name one")
    near = [e for e in catalogue.entries if e.stage in word] or list(catalogue.entries)
    there = f"there are {listed(near[::-1])}" if near else f"{catalogue.root} holds none"
    raise UsageError(f"{word}: no such artifact; {there} (gpsim runs list)")


def _padded(word: str) -> str:
    """fit-gp/v3 as fit-gp/v0003."""
    return re.sub(r"(^|/)v(\d{1,3})$", lambda m: f"{m[1]}v{int(m[2]):04d}", word.rstrip("/"))


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except (OSError, ValueError):
        return False


def listed(entries: Sequence[Entry]) -> str:
    """The names of the first few, and how many more there are."""
    more = f" and {len(entries) - SHOWN} more" if len(entries) > SHOWN else ""
    return ", ".join(entry.name for entry in entries[:SHOWN]) + more
