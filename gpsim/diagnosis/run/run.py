"""A run: what one diagnosis carries along from step to step. Nothing of it is global: two may run side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from gpsim.diagnosis.run.budget import Budget
from gpsim.diagnosis.run.memo import Memo
from gpsim.diagnosis.run.pool import Workers
from gpsim.diagnosis.run.trace import Decision, Trace
from gpsim.diagnosis.settings import NOTHING_KNOWN, Known, Settings

ANSWERS_REMEMBERED = 6
"""Answers to a function's questions that are kept (a leader's is asked for again after a few rivals')."""

Result = TypeVar("Result")


@dataclass(frozen=True)
class Run:
    """Settings, what the user knows, workers to share the work with, what was spent, kept answers, decisions.

    In a worker process it begins anew, alone: what it spent and decided there is added here when the result comes back.
    """

    workers: Workers = field(default_factory=Workers)
    settings: Settings = field(default_factory=Settings)
    trace: Trace = field(default_factory=Trace)
    known: Known = NOTHING_KNOWN
    budget: Budget = field(init=False)
    memo: Memo = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "budget", Budget())
        object.__setattr__(self, "memo", Memo(ANSWERS_REMEMBERED))

    def __reduce__(self) -> tuple[Callable[[Settings, str, Known], Run], tuple[Settings, str, Known]]:
        return _begun_elsewhere, (self.settings, self.trace.step, self.known)

    def knowing(self, known: Known) -> Run:
        """The same run, going on with something else known: its workers, what it spent and decided are its own."""
        other = object.__new__(Run)
        vars(other).update(vars(self), known=known)
        return other

    def side_by_side(
        self, function: Callable[..., Result], calls: Sequence[tuple[Any, ...]], until: float = math.inf
    ) -> list[Result]:
        """What a module's `function` makes of the arguments of every call, in their order; raises what it raises.

        until: what may be spent before no further call counts, whether or not another process has begun it already.
        """
        results: list[Result] = []
        begun = self.workers.submit(_counted, [(self, function, call) for call in calls])
        for i, call in enumerate(calls):
            if self.budget.spent >= until:
                break
            if not begun:
                results.append(function(*call))
                continue
            result, spent, decisions = begun[i].result()
            self.budget.add(spent)
            self.trace.add(decisions)
            results.append(result)
        for late in begun[len(results) :]:
            late.cancel()
        return results


def _begun_elsewhere(settings: Settings, step: str, known: Known) -> Run:
    return Run(settings=settings, trace=Trace(step), known=known)


def _counted(
    run: Run, function: Callable[..., Result], call: tuple[Any, ...]
) -> tuple[Result, float, list[Decision]]:
    """What a function makes of its arguments, what that has spent in this process, and what was decided.

    The arguments came together with the run, so what they carry is this very one.
    """
    return function(*call), run.budget.spent, run.trace.decisions
