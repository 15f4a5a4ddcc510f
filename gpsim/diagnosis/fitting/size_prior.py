"""The prior of sizes: what an explanation pays for those that no machine of its kind has."""

from __future__ import annotations

from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.settings import EvidenceSettings
from gpsim.effects import implausibility


def size_prior(hypothesis: Hypothesis, settings: EvidenceSettings) -> float:
    """Nats that a hypothesis loses by the sizes it needs; none of them where all are usual."""
    terms = zip(hypothesis.terms, hypothesis.declared, strict=True)
    sizes = ((p, term.values[p.name]) for term, declared in terms for p in declared)
    return sum(min(implausibility(p, value, settings.doubled), settings.most_unusual) for p, value in sizes)
