"""What is told of runs/ and of what a configuration asks for: texts, numbers, mappings and tuples of such."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from gpsim.files import Json
from gpsim.runs.comparison import Difference


@dataclass(frozen=True)
class Listed:
    """An artifact in a list.

    state: `broken`, of which `damage` says what; `stale`, which today's gpsim would make anew, `why` says of what other
    code it is or which parent is gone; `finished`. says: its result in a word; made: ISO 8601; seconds: of its making.
    """

    name: str
    path: str
    experiment: str | None
    stage: str
    state: Literal["finished", "stale", "broken"]
    says: str
    made: str | None
    seconds: float | None
    bytes: int
    seeds: Json
    why: tuple[Difference, ...] = ()
    damage: str | None = None


@dataclass(frozen=True)
class Beside:
    """What lies between artifacts: `making`, `claimed`, `unfinished` or `removing`."""

    path: str
    kind: str
    bytes: int


@dataclass(frozen=True)
class Listing:
    """What is in a runs folder; bytes: of all that is listed."""

    runs_dir: str
    artifacts: tuple[Listed, ...]
    beside: tuple[Beside, ...]

    @property
    def bytes(self) -> int:
        """Disk use."""
        return sum(artifact.bytes for artifact in self.artifacts) + sum(left.bytes for left in self.beside)


@dataclass(frozen=True)
class Parent:
    """What an artifact was made from; name: where that is now, None where it is gone."""

    role: str
    stage: str | None
    sha256: str | None
    name: str | None


@dataclass(frozen=True)
class Shown:
    """One artifact, every byte of it looked at; dependents: how many artifacts need it, at any distance."""

    artifact: Listed
    sha256: str | None
    config: Json
    parents: tuple[Parent, ...]
    children: tuple[str, ...]
    dependents: int
    figures: Mapping[str, Any]
    packages: Mapping[str, str]
    commit: str | None
    files: Mapping[str, int]


@dataclass(frozen=True)
class Compared:
    """How two artifacts differ."""

    old: str
    new: str
    differences: tuple[Difference, ...]


@dataclass(frozen=True)
class Removed:
    """What went or, if it was only looked (`dry_run`), would go: artifacts in the order of their going."""

    artifacts: tuple[Listed, ...]
    beside: tuple[Beside, ...]
    bytes: int
    dry_run: bool


@dataclass(frozen=True)
class Standing:
    """How it stands with one artifact of the configuration.

    state: `there`, nothing is to be done; `to make`, at once; `waits` for parents that are not made; `refused`: what
    the command would say is in `refusal`. path: of the artifact that is there, or that `--out` names; nearest: the
    newest artifact of the stage with the fewest differing keys, and `differences` from it to what is asked for, as far
    as is known before the parents are made; None and () where there is none. waits_for: jobs or stages,
    make_first: what makes the first of them; command: what makes it.
    """

    job: str
    stage: str
    state: Literal["there", "to make", "waits", "refused"]
    command: str
    path: str | None = None
    nearest: str | None = None
    differences: tuple[Difference, ...] = ()
    waits_for: tuple[str, ...] = ()
    make_first: str | None = None
    refusal: str | None = None


@dataclass(frozen=True)
class LoopStatus:
    """How it stands with every artifact of a loop, in the order of their making; command: what makes them all."""

    experiment: str
    runs_dir: str
    seeds: tuple[int, ...]
    standings: tuple[Standing, ...]
    command: str

    def count(self, *states: str) -> int:
        """How many artifacts are in one of these states."""
        return sum(standing.state in states for standing in self.standings)
