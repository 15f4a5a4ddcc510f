"""The ranking: every hypothesis that was fitted, the best first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, scores
from gpsim.diagnosis.report import RankedHypothesis
from gpsim.effects import Gate, Moment


@dataclass(frozen=True)
class Ranked:
    """A hypothesis and how many nats it is behind the best; on all training windows, or on the search's alone.

    mends: it is ahead of the answer, and of no use.
    """

    hypothesis: Hypothesis
    behind: float
    everything: bool
    mends: bool = False

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
    mending: Sequence[Fit] = (),
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
                mends = any(fits[int(i)] is f for f in mending)
                out.append(Ranked(hypothesis, float(nats.max() - nats[i]), whole, mends))
    return out


def _limited_in(gate: Gate) -> str:
    if not gate:
        return ""
    at = gate.looks_at
    return "time" if at is None else at.value if isinstance(at, Moment) else at


def _key(hypothesis: Hypothesis) -> object:
    return hypothesis.scheme, frozenset((t.identity, bool(t.gate), t.gate.looks_at) for t in hypothesis.terms)
