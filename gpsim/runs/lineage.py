"""What rests on what. Equal contents are one parent: where two artifacts are twins, either will do."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path

from gpsim.runs.catalogue import Catalogue, Entry, Need


def parents(catalogue: Catalogue, entry: Entry) -> list[tuple[Need, Entry | None]]:
    """What an artifact was made from, and where that is now: the one it was made from, else a twin, else None.

    A recording that was given by its folder is only told where it is an artifact.
    """
    found = [(need, _nearest(catalogue.providers(need), need.path)) for need in entry.needs]
    return [(need, parent) for need, parent in found if parent is not None or need.digest is not None]


def missing_parents(catalogue: Catalogue, entry: Entry) -> list[Need]:
    """Parents that are gone or broken."""
    return [need for need, parent in parents(catalogue, entry) if parent is None]


def children(catalogue: Catalogue, entry: Entry) -> list[Entry]:
    """Artifacts that were made from this one or a twin of it."""
    return [
        other for other in catalogue.entries if other is not entry and any(map(entry.serves, other.needs))
    ]


def dependents(catalogue: Catalogue, gone: Iterable[Path]) -> list[Entry]:
    """What would lose a parent, at any distance, if these artifacts went; they themselves are left out.

    What has lost it already loses nothing.
    """
    without = set(gone)
    given = frozenset(without)
    while True:
        losing = [e for e in catalogue.entries if e.path not in without and _loses(catalogue, e, without)]
        if not losing:
            return [e for e in catalogue.entries if e.path in without - given]
        without |= {e.path for e in losing}


def ancestry(catalogue: Catalogue, kept: Iterable[Entry]) -> set[Path]:
    """These artifacts and, at any distance, what they were made from: of twins one that is in it, or the newest."""
    found: set[Path] = set()
    ahead = list(kept)
    found |= {entry.path for entry in ahead}
    while ahead:
        for need in ahead.pop().needs:
            twins = catalogue.providers(need)
            if twins and not any(twin.path in found for twin in twins):
                newest = max(twins, key=lambda twin: twin.age_key)
                found.add(newest.path)
                ahead.append(newest)
    return found


def children_first(catalogue: Catalogue, entries: Iterable[Entry]) -> list[Entry]:
    """The same artifacts, each before what it was made from: in this order they can go one by one."""
    ordered: list[Entry] = []
    left = {entry.path: entry for entry in entries}
    below = {
        path: {p.path for need in entry.needs for p in catalogue.providers(need)} & left.keys()
        for path, entry in left.items()
    }
    while left:
        needed = set().union(*(below[path] for path in left))
        free = [path for path in left if path not in needed] or list(left)  # a circle cannot be: digests
        ordered += [left.pop(path) for path in free]
    return ordered


def _loses(catalogue: Catalogue, entry: Entry, gone: Collection[Path]) -> bool:
    twins = [catalogue.providers(need) for need in entry.needs]
    return any(some and all(twin.path in gone for twin in some) for some in twins)


def _nearest(twins: tuple[Entry, ...], path: str | None) -> Entry | None:
    """The one that was used, if it is there yet; else the newest."""
    used = next((twin for twin in twins if path is not None and str(twin.path) == path), None)
    return used or max(twins, key=lambda twin: twin.age_key, default=None)
