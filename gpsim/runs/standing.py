"""How it stands with what a configuration asks for, as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from gpsim.runs.comparison import Difference

State = Literal["there", "to make", "waits", "refused"]


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
    state: State
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

    def count(self, *states: State) -> int:
        """How many artifacts are in one of these states."""
        return sum(standing.state in states for standing in self.standings)
