"""The prior of sizes: what an explanation pays for those that no machine of its kind has."""

from __future__ import annotations

from collections.abc import Sequence

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.effects import EffectParameter, Term, base_name, implausibility

NATS_OF_DOUBLE_SIZE = 5.0
"""That a size costs a factor of two outside of the usual range, four times that a factor of four [nats] (by reason:
odds of a hundred and fifty against a mass of eight times, none against one of four times)."""
MOST_UNUSUAL = 50.0  # that a size costs at most: physics that is sure enough may be unusual [nats]


def size_prior(hypothesis: Hypothesis) -> float:
    """Nats that a hypothesis loses by the rare laws and the sizes it needs; none of them where all are usual.

    What is as unusual in several recordings of one machine costs once, as much as the least usual of them.
    """
    terms = zip(hypothesis.terms, hypothesis.declared, strict=True)
    return sum(term.effect.rare + _of_term(term, declared) for term, declared in terms)


def _of_term(term: Term, declared: Sequence[EffectParameter]) -> float:
    costs: dict[str, float] = {}
    for p in declared:
        cost = min(implausibility(p, term.values[p.name], NATS_OF_DOUBLE_SIZE), MOST_UNUSUAL)
        costs[base_name(p.name)] = max(cost, costs.get(base_name(p.name), 0.0))
    return sum(costs.values())
