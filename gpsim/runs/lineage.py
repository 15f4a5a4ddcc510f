"""What rests on what, which artifact a person means, and what may go: never what something that stays needs.

Equal contents are one parent: where two artifacts are twins, either will do.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from gpsim.artifacts import Leftover, erase, hide, sweep_all, unneeded
from gpsim.errors import UsageError
from gpsim.runs.catalogue import Catalogue, Entry, Need, read_catalogue, size_of

SHOWN = 5
"""Names that a message lists."""


def parents(catalogue: Catalogue, entry: Entry) -> list[tuple[Need, Entry | None]]:
    """What an artifact was made from, and where that is now: the one it was made from, else a twin, else None.

    A recording that was given by its folder is only told where it is an artifact.
    """
    found = []
    for need in entry.needs:
        twins = catalogue.providers(need)
        used = next((twin for twin in twins if str(twin.path) == need.path), None)
        parent = used or max(twins, key=lambda twin: twin.age_key, default=None)
        if parent is not None or need.digest is not None:
            found.append((need, parent))
    return found


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

    def loses(entry: Entry) -> bool:
        twins = [catalogue.providers(need) for need in entry.needs]
        return any(some and all(twin.path in without for twin in some) for some in twins)

    while losing := [e for e in catalogue.entries if e.path not in without and loses(e)]:
        without |= {e.path for e in losing}
    return [e for e in catalogue.entries if e.path in without - given]


def ancestry(catalogue: Catalogue, kept: Iterable[Entry]) -> set[Path]:
    """These artifacts and, at any distance, what they were made from: of twins one that is in it, or the newest."""
    ahead = list(kept)
    found = {entry.path for entry in ahead}
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


def named(catalogue: Catalogue, word: str) -> Entry:
    """The artifact: a folder's path, `cartpole/fit-gp/v0003`, or `fit-gp/v3` where one experiment has that.

    What lies elsewhere is found where the catalogue was read beside it. Raises UsageError for none, and for several.
    """
    path = Path(word)
    for entry in catalogue.entries:
        if entry.name == word.rstrip("/") or _same(entry.path, path):
            return entry
    wanted = re.sub(r"(^|/)v(\d{1,3})$", lambda m: f"{m[1]}v{int(m[2]):04d}", word.rstrip("/"))  # v3 as v0003
    found = [entry for entry in catalogue.entries if f"/{entry.name}".endswith(f"/{wanted}")]
    if len(found) == 1:
        return found[0]
    if found:
        raise UsageError(f"{word}: several: {_listed(found)}; name one")
    near = [e for e in catalogue.entries if e.stage in word] or list(catalogue.entries)
    there = f"there are {_listed(near[::-1])}" if near else f"{catalogue.root} holds none"
    raise UsageError(f"{word}: no such artifact; {there} (gpsim runs list)")


def _same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except (OSError, ValueError):
        return False


def _listed(entries: Sequence[Entry]) -> str:
    more = f" and {len(entries) - SHOWN} more" if len(entries) > SHOWN else ""
    return ", ".join(entry.name for entry in entries[:SHOWN]) + more


@dataclass(frozen=True)
class Removal:
    """What is to go: artifacts, each before what it was made from, and leftovers; bytes: of all of it."""

    entries: tuple[Entry, ...]
    leftovers: tuple[Leftover, ...] = ()

    @property
    def bytes(self) -> int:
        """How much it takes on the disk."""
        return sum(e.bytes for e in self.entries) + sum(size_of(left.path) for left in self.leftovers)


def removal_of(catalogue: Catalogue, asked: Sequence[Entry], with_dependents: bool = False) -> Removal:
    """These artifacts and, if asked for, all that needs them; else a UsageError names what does.

    What is broken cannot be read by what needs it, and may go: made again, it is the same.
    """
    chosen = {entry.path: entry for entry in asked}
    needing = dependents(catalogue, chosen)
    if needing and not with_dependents:
        raise UsageError(
            f"{', '.join(e.name for e in asked)}: needed by {_listed(needing)}; remove those first, or use "
            "--with-dependents"
        )
    chosen |= {entry.path: entry for entry in needing}
    return Removal(tuple(children_first(catalogue, chosen.values())))


def garbage(catalogue: Catalogue, keep: int | None = None, spare: Collection[Path] = ()) -> Removal:
    """What processes left that are no more; with `keep`, also versions beyond the newest so many of their stage.

    A version stays while something that stays needs it, at any distance; so does what is broken, what lies elsewhere
    than in a version's folder, and `spare`.
    """
    left = tuple(leftover for leftover in catalogue.leftovers if leftover.kind in ("unfinished", "removing"))
    if keep is None:
        return Removal((), left)
    shelves: dict[tuple[str | None, str], list[Entry]] = {}
    staying = [e for e in catalogue.entries if e.number is None or not e.whole or e.path in spare]
    for entry in catalogue.entries:
        if entry.number is not None and entry.whole:
            shelves.setdefault((entry.experiment, entry.stage), []).append(entry)
    for shelf in shelves.values():
        shelf.sort(key=lambda entry: entry.age_key)
        staying += shelf[max(len(shelf) - keep, 0) :]
    kept = ancestry(catalogue, staying)
    going = [entry for entry in catalogue.entries if entry.path not in kept]
    return Removal(tuple(children_first(catalogue, going)), left)


def remove(catalogue: Catalogue, removal: Removal, beside: Sequence[Path] = ()) -> Removal:
    """Remove all of it, or nothing: raises UsageError where something is being made of it, or was made meanwhile."""
    paths = [entry.path for entry in removal.entries]
    with unneeded(paths) as mine:
        busy = [entry.name for entry in removal.entries if entry.path not in mine and entry.path.exists()]
        if busy:
            raise UsageError(f"{busy[0]}: a process is using it; wait for that process, or end it")
        now = read_catalogue(catalogue.root, beside)
        if needing := dependents(now, paths):
            raise UsageError(f"{_listed(needing)}: now needed by others; see gpsim runs list")
        hidden = hide([path for path in paths if path in mine])
    for path in hidden:
        erase(path)
    return removal


def collect_garbage(root: Path, keep: int | None = None, beside: Sequence[Path] = ()) -> Removal:
    """Remove what `garbage` says, without what something is being made of; returns what went."""
    first = garbage(read_catalogue(root, beside), keep)
    with unneeded(entry.path for entry in first.entries) as mine:
        now, spare = read_catalogue(root, beside), set[Path]()
        while True:  # what cannot be had stays, and so does what it needs
            going = garbage(now, keep, spare)
            lacking = {entry.path for entry in going.entries} - mine
            if not lacking:
                break
            spare |= lacking
        hidden = hide([entry.path for entry in going.entries])
    for path in hidden:
        erase(path)
    for shelf in dict.fromkeys(leftover.path.parent for leftover in going.leftovers):
        sweep_all(shelf)
    return going
