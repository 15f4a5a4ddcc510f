"""A run: what one diagnosis carries along: settings, what the user knows, threads, and the trace of its decisions.

Nothing of it is global: two may run side by side.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from gpsim.diagnosis.settings import NOTHING_KNOWN, Known, Settings


@dataclass(frozen=True)
class Decision:
    """Whether something was taken, and why.

    step: the rung; candidate: the laws that were looked at; over: those that they would extend or replace; rule: that
    decided; gain: nats by which it wins, its price paid; price: nats that its parameters cost; share: of what was left,
    that it takes off.
    """

    step: str
    candidate: tuple[str, ...]
    over: tuple[str, ...]
    taken: bool
    rule: str
    gain: float | None = None
    price: float | None = None
    share: float | None = None


@dataclass
class Trace:
    """The decisions so far; step: the rung they are made on at present."""

    step: str = ""
    decisions: list[Decision] = field(default_factory=list)

    def note(
        self,
        candidate: tuple[str, ...],
        over: tuple[str, ...],
        taken: bool,
        rule: str,
        *,
        gain: float | None = None,
        price: float | None = None,
        share: float | None = None,
    ) -> None:
        """Write a decision down."""
        self.decisions.append(Decision(self.step, candidate, over, taken, rule, gain, price, share))


@dataclass(frozen=True)
class Run:
    """Settings, what the user knows, and how many threads simulate."""

    settings: Settings = field(default_factory=Settings)
    known: Known = NOTHING_KNOWN
    threads: int = 1
    trace: Trace = field(default_factory=Trace)
