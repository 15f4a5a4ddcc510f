"""What a ground and a peer are, and what a peer answers: the one thing that the grounds and the command share.

A ground is data with a split; a peer is a function that fits on the training part and is scored on the test part. The
command (peers.py) runs every cell, a (ground, peer, seed), in a process of its own, measures its processor seconds with
those of its children, and keeps what `Answer` says as one JSON file. A cell that has its file is not run again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Score:
    """A number of a table, with its interval where it has one."""

    value: float | None  # None: it ran away, or could not be asked
    unit: str = ""
    low: float | None = None
    high: float | None = None
    level: float = 0.9  # of the interval


@dataclass(frozen=True)
class Parameter:
    """A physical number that a peer yields, with its interval where it yields one."""

    name: str
    value: float
    unit: str = ""
    low: float | None = None
    high: float | None = None
    level: float = 0.9
    known: float | None = None  # what is true or published of it


@dataclass(frozen=True)
class Answer:
    """What a peer says of a ground: its scores by name, what it names, and what effort it got."""

    scores: dict[str, Score]
    names: tuple[str, ...] = ()  # the physics it says is missing, in its own words; () if it cannot name
    parameters: tuple[Parameter, ...] = ()
    tuned: str = ""  # the effort: grid, and on what it was chosen
    notes: str = ""  # what went wrong or has to be known: a warning, a grid point that crashed
    details: dict[str, Any] = field(default_factory=dict)  # anything else that is JSON, small


@dataclass(frozen=True)
class Task:
    """What a peer is given: a seed, and a folder of its own that outlives a run that was stopped."""

    seed: int
    folder: Path


@dataclass(frozen=True)
class Peer:
    """One who answers. `run` is called in a process of its own; what it raises is said as a crash."""

    name: str  # also the word of --peer: lower case, digits, hyphens
    title: str
    run: Callable[[Task], Answer]
    kind: str  # "parameters", "black box" or "gpsim"
    needs: tuple[str, ...] = ()  # modules to import; where one is absent the cell says so
    limit_s: float = 3600.0  # by the clock; then it is stopped, and the cell says so
    what: str = ""  # one sentence for the page: recipe, source


@dataclass(frozen=True)
class Published:
    """A figure of someone else, who ran it."""

    value: float
    unit: str
    what: str
    source: str


@dataclass(frozen=True)
class Ground:
    """Data, its split, its scores and who plays."""

    name: str  # also the word of --ground
    title: str
    split: str  # one sentence: what trains, what tests
    headline: str  # the score of the figure and of the first column
    columns: tuple[str, ...]  # the scores of the table, in order; headline among them
    peers: tuple[Peer, ...]
    more_is_better: bool = False  # of the headline
    seeds: tuple[int, ...] = (0,)  # a cell each
    absent: Callable[[], str] = lambda: ""  # why it cannot run here (no recordings ...), "" if it can
    published: tuple[Published, ...] = ()
    remarks: Callable[[Sequence[dict[str, Any]]], str] | None = None  # words of the page, from its cells


def as_cell(answer: Answer) -> dict[str, Any]:
    """The answer's part of a cell; what is not finite becomes null."""

    def finite(value: Any) -> Any:
        if isinstance(value, float) and value - value != 0.0:
            return None
        if isinstance(value, dict):
            return {str(name): finite(one) for name, one in value.items()}
        return [finite(one) for one in value] if isinstance(value, list | tuple) else value

    found: dict[str, Any] = finite(asdict(answer))
    json.dumps(found)  # fails here, where the peer is, and not where the cell is written
    return found
