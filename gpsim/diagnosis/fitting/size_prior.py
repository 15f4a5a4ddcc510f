"""The prior of sizes: what an explanation pays for those that no machine of its kind has."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.settings import EvidenceSettings
from gpsim.effects import EffectParameter, Term, base_name, implausibility


def size_prior(hypothesis: Hypothesis, settings: EvidenceSettings) -> float:
    """Nats that a hypothesis loses by the rare laws and the sizes it needs; none of them where all are usual.

    What is as unusual in several recordings of one machine costs once, as much as the least usual of them.
    """
    terms = zip(hypothesis.terms, hypothesis.declared, strict=True)
    return sum(term.effect.rare + _of_term(term, declared, settings) for term, declared in terms)


def _of_term(term: Term, declared: Sequence[EffectParameter], settings: EvidenceSettings) -> float:
    costs: dict[str, float] = {}
    for p in declared:
        cost = min(implausibility(p, term.values[p.name], settings.doubled), settings.most_unusual)
        costs[base_name(p.name)] = max(cost, costs.get(base_name(p.name), 0.0))
    return sum(costs.values())
