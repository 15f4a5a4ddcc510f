"""Which sensor would tell two explanations apart that no command does."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.effects import Term
from gpsim.posterior import Explanation

SAME = 1e-3  # relative difference of two values that is none


def sensors_for(one: Explanation, other: Explanation, measured: Mapping[str, float]) -> tuple[str, ...]:
    """What to measure beside the motion: each quantity of which the two say something different."""
    first, second = (_by_identity(e) for e in (one, other))
    differing = [
        term
        for mine, theirs in ((first, second), (second, first))
        for identity, term in mine.items()
        if identity not in theirs or not _alike(term, theirs[identity])
    ]
    return tuple(dict.fromkeys(_sensor(term) for term in differing))


def _by_identity(one: Explanation) -> dict[tuple[str, str], Term]:
    return {term.identity: term for term in one.hypothesis.terms}


def _alike(one: Term, other: Term) -> bool:
    return all(abs(v - other.values.get(k, v)) <= SAME * max(abs(v), 1e-12) for k, v in one.values.items())


def _sensor(term: Term) -> str:
    site = term.effect.site
    if site == "actuator":
        return f"what {term.on} delivers (its force, torque, current or speed)"
    if site == "sensor":
        return f"{term.on} by a second sensor"
    if site == "parameter":
        return f"{term.on} itself (weigh it, measure its length)"
    if site == "vehicle":
        return "the wheels' steering angle and speeds"
    return f"the force on {term.on}"
