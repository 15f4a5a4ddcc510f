"""The ranking: every hypothesis that was fitted, the best first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, scores
from gpsim.diagnosis.judgement.rivals import Rivalry
from gpsim.diagnosis.report import RankedHypothesis
from gpsim.effects import Gate, Moment


@dataclass(frozen=True)
class Ranked:
    """A hypothesis and how many nats it is behind the best; on all training windows, or on the search's alone.

    idle: it is near the answer or ahead of it, and of no use. in_all: nats behind the answer once held-out windows
    count, too; None where nobody asked.
    """

    hypothesis: Hypothesis
    behind: float
    everything: bool
    idle: bool = False
    in_all: float | None = None

    @property
    def entry(self) -> RankedHypothesis:
        """As it is reported. gates: for each effect `time`, the channel of its region, or nothing."""
        terms = self.hypothesis.terms
        return RankedHypothesis(
            nats_behind=round(self.behind, 2),
            effects=tuple((t.family, t.on) for t in terms),
            gates=tuple(_limited_in(t.gate) for t in terms),
            scheme=self.hypothesis.scheme,
            windows="all" if self.everything else "search",
        )


def ranked(
    everything: tuple[Problem, Sequence[Fit]],
    searched: tuple[Problem, Sequence[Fit]],
    rivalry: Rivalry,
) -> list[Ranked]:
    """Those fitted on all windows, then those that the search alone has fitted, on its own."""
    out: list[Ranked] = []
    for (problem, fits), whole in ((everything, True), (searched, False)):
        known = {_key(r.hypothesis) for r in out}
        nats = scores(problem, list(fits))
        for i in (-nats).argsort():
            hypothesis = fits[int(i)].hypothesis
            if _key(hypothesis) not in known:
                known.add(_key(hypothesis))
                fit = fits[int(i)]
                idle = any(fit is f for f in rivalry.idle)
                in_all = next((by for f, by in rivalry.behind if f is fit), None)
                out.append(Ranked(hypothesis, float(nats.max() - nats[i]), whole, idle, in_all))
    return out


def _limited_in(gate: Gate) -> str:
    if not gate:
        return ""
    at = gate.looks_at
    return "time" if at is None else at.value if isinstance(at, Moment) else at


def _key(hypothesis: Hypothesis) -> object:
    return hypothesis.scheme, frozenset((t.identity, bool(t.gate), t.gate.looks_at) for t in hypothesis.terms)
