"""The trace: every decision of a diagnosis in its order, and the rule that took or refused."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Decision:
    """Whether something was taken, and why.

    step: of the diagnosis; candidate: the terms that were looked at; over: those that they would extend or replace;
    rule: that decided;
    gain: nats by which it wins, its price paid (or that it promises, where it was not fitted yet); price: nats that its
    parameters cost; share: the largest part of a channel's remaining variance that it removes.
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
    """The decisions so far; step: what they are made for at present."""

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

    def add(self, decisions: Iterable[Decision]) -> None:
        """Decisions that were made in another process, in their order."""
        self.decisions.extend(decisions)
