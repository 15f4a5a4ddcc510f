"""Rivals in a line or two: what all explanations share, and between what the data cannot decide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.report import Claims, Leads, NamedEffect
from gpsim.reports.account_effects import claim_name, told_effects
from gpsim.reports.diagnosis_text import listed
from gpsim.reports.quantities import percent

LEADS: Mapping[Leads, str] = {
    "likeliest": "told is the likeliest",
    "simplest": "told is the simplest within odds of 10:1",
}
MOST = 2  # rivals that are told, the likeliest; further ones are in diagnosis.json


def rivals(diagnosis: Diagnosis) -> Iterator[str]:
    """Nothing where one explanation stands alone, or all others claim the same."""
    if diagnosis.verdict == "named" or not diagnosis.alternatives or not any(told_effects(diagnosis)):
        return
    every = [_claims(diagnosis.effects), *(_claims(rival.effects) for rival in diagnosis.alternatives)]
    certain = [claim for claim in every[0] if all(claim in claims for claims in every)]
    chances = [diagnosis.effects[0].probability, *(rival.probability for rival in diagnosis.alternatives)]
    open_ = [
        f"{_said([claim for claim in claims if claim not in certain])} ({percent(p)} %)"
        for claims, p in zip(every, chances, strict=True)
    ]
    claimed = _claims([effect for effect in diagnosis.effects if effect.role == "headline"])
    if shared := [
        claim for claim in certain if claim in claimed
    ]:  # what is slight is no claim, whoever shares it
        yield f"certain, as all explanations share it: {_said(shared)}"
    first, further = open_[: 1 + MOST], len(open_) - 1 - MOST
    more = f", or {further} more in diagnosis.json" if further > 0 else ""
    yield f"undecided: {', or '.join(first)}{more}; {LEADS[diagnosis.leads]}"


def _claims(effects: Sequence[NamedEffect]) -> Claims:
    return tuple((effect.family, effect.place) for effect in effects)


def _said(claims: Sequence[tuple[str, str]]) -> str:
    return listed([claim_name(family, place) for family, place in claims]) or "nothing more"
