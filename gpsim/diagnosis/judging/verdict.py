"""The verdict: what may be said of an account, by how much of the mismatch it explains.

Whether something is left over is another question: with a real robot, or a clean sensor, something always is. The first
that holds:

1. `none`: no law stands, and nothing is left that chance would not make, or it shows in no channel.
2. `unknown`: the laws surely explain less than `half`, or are no better than the base there.
3. `partial`: they explain less than `nearly_all`, or a measured curve holds a tenth of it, or a headline's size is not
   known, stopped at its bound or is one that no machine has, or none is a claim by itself.
4. `ambiguous`: a rival that lacks a headline effect is within `odds`.
5. `named`.

What curves and the Gaussian process still gain is told as what is left, and is no reason for another name.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence

from gpsim.diagnosis.judging.attribution import Attribution
from gpsim.diagnosis.judging.judgement import Judgement, odds_against
from gpsim.diagnosis.settings import Known, Settings, VerdictSettings
from gpsim.effects import Measured
from gpsim.findings import (
    BlackBox,
    Doubt,
    Estimate,
    Form,
    Role,
    Share,
    Verdict,
    no_size,
    sized,
)


def claimed(
    judgement: Judgement, attribution: Attribution, sizes: Sequence[Mapping[str, Estimate]]
) -> tuple[Role, ...]:
    """The roles, in which an effect of whose size nothing is known is no claim: another could stand for it."""
    terms = judgement.leader.hypothesis.terms
    return tuple(
        "slight" if no_size(t.family, own) else role
        for t, own, role in zip(terms, sizes, attribution.roles, strict=True)
    )


def doubts_of(
    judgement: Judgement,
    attribution: Attribution,
    forms: Sequence[Form],
    sizes: Sequence[Mapping[str, Estimate]],
    box: BlackBox | None,
    settings: Settings,
) -> Iterator[Doubt]:
    """What keeps an account with effects from being named; nothing where it may be."""
    leader, numbers = judgement.leader.hypothesis, settings.verdict
    claims = [i for i, role in enumerate(attribution.roles) if role == "headline"]
    if not leader.terms:
        return
    if misses(judgement, attribution, numbers.nearly_all):
        yield "left"
    if any(forms[i] == "approximate" for i in claims):
        yield "form"
    much_left = _at_most(attribution.share) < 1 - numbers.headline
    if box is not None and _at_least(box.takes_off) > numbers.black_box and much_left:
        yield "black box"
    if any(estimate.at_bound for i in claims for estimate in sizes[i].values()):
        yield "bound"
    if not all(sized(leader.terms[i].family, sizes[i]) for i in claims):
        yield "size"
    if any(leader.times_beyond(i) >= numbers.implausible for i in claims):
        yield "implausible"
    if not claims:
        yield "no claim"
    odds = [odds_against(judgement.ranking, leader, leader.terms[i].identity).nats for i in claims]
    if any(nats is not None and nats < math.log(numbers.odds) for nats in odds):
        yield "odds"


def forms_of(
    judgement: Judgement,
    attribution: Attribution,
    asked: Collection[tuple[str, str]],
    bent: Collection[tuple[str, str]],
    settings: VerdictSettings,
) -> tuple[Form, ...]:
    """Whether laws hold: where a curve of their own input was asked for, and none counts at their place.

    What is usual on a machine is told though it is never quite so; what is not must follow what it is named for.
    asked: place and input of every curve that was; bent: family and place of unusual laws beside which a curve bends.
    """
    terms, out = judgement.leader.hypothesis.terms, list[Form]()
    most = 1.0 - settings.nearly_all
    every = list(zip(terms, attribution.importance, attribution.roles, strict=True))
    curves = [
        (t.on, s.share > most or r == "headline") for t, s, r in every if isinstance(t.effect, Measured)
    ]
    for term in terms:
        tested = (term.on, term.effect.function_of) in asked
        rough = term.identity in bent or (tested and (term.on, True) in curves)
        out.append("approximate" if rough else "holds" if tested else "untested")
    return tuple(out)


def verdict_of(
    judgement: Judgement,
    attribution: Attribution,
    doubts: Collection[Doubt],
    settings: Settings,
    known: Known,
) -> Verdict:
    """By the rules above; whether the account beats the base was asked before."""
    numbers = settings.verdict
    if not judgement.leader.hypothesis.terms:
        something = attribution.explained.counts and (judgement.structured or known.only or known.without)
        return "unknown" if something else "none"
    if misses(judgement, attribution, numbers.half):
        return "unknown"
    both = zip(judgement.leader.hypothesis.terms, attribution.importance, strict=True)
    curves = sum(share.share for term, share in both if isinstance(term.effect, Measured))
    if any(doubt != "odds" for doubt in doubts) or curves > 1.0 - numbers.nearly_all:
        return "partial"
    return "ambiguous" if doubts or _contested(judgement, attribution, numbers.odds) else "named"


def _contested(judgement: Judgement, attribution: Attribution, odds: float) -> bool:
    """Whether a rival within the odds lacks one of the headline effects."""
    leader = judgement.leader.hypothesis
    headlines = {
        (t.family, on)
        for t, role in zip(leader.terms, attribution.roles, strict=True)
        if role == "headline"
        for on in t.places
    }
    own, *others = judgement.probabilities
    return any(
        headlines - rival.hypothesis.claims and p * odds > own
        for rival, p in zip(judgement.rivals, others, strict=True)
    )


def misses(judgement: Judgement, attribution: Attribution, enough: float) -> bool:
    """Whether surely less than `enough` is explained, and there is something to explain."""
    something = attribution.explained.counts or judgement.structured
    return something and _at_most(attribution.share) < enough


def _at_most(share: Share) -> float:
    return share.share if share.high is None else share.high


def _at_least(share: Share) -> float:
    return share.share if share.low is None else share.low
