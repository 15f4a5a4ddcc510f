"""What may go, and its removal: never what something that stays needs, never what something is being made of."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from gpsim.artifacts import Leftover, erase, hide, sweep_all, unneeded
from gpsim.errors import UsageError
from gpsim.runs.catalogue import Catalogue, Entry, read_catalogue, size_of
from gpsim.runs.lineage import ancestry, children_first, dependents
from gpsim.runs.naming import listed


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
            f"{', '.join(e.name for e in asked)}: needed by {listed(needing)}; remove those first, or all of it with "
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
        if busy := [
            entry.name for entry in removal.entries if entry.path not in mine and entry.path.exists()
        ]:
            raise UsageError(f"{busy[0]}: something is being made of it right now; wait for that, or end it")
        now = read_catalogue(catalogue.root, beside)
        if needing := dependents(now, paths):
            raise UsageError(f"{listed(needing)}: made of it meanwhile; look again: gpsim runs list")
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
