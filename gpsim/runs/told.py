"""What is told of runs/, as plain data: every field is a text, a number, a mapping or a tuple of such."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from gpsim.files import Json
from gpsim.runs.comparison import Difference

State = Literal["finished", "stale", "broken"]


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
    state: State
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
