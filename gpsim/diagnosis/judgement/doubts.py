"""Doubts: what keeps an account that explains nearly all of the mismatch from being named."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from gpsim.diagnosis.attribution import Attribution
from gpsim.diagnosis.fitting import FEWEST_JOINTS, is_row
from gpsim.diagnosis.judgement.judgement import Judgement
from gpsim.diagnosis.judgement.odds import odds_against
from gpsim.diagnosis.judgement.verdict import misses, surely_below
from gpsim.diagnosis.report import BlackBox, Doubt, Estimate, Form, no_size, sized
from gpsim.diagnosis.settings import Settings

JOINTS = 2  # whose friction, or rotor, is known, beside which another's of unknown size is no claim


def claimed(
    judgement: Judgement, attribution: Attribution, sizes: Sequence[Mapping[str, Estimate]]
) -> Attribution:
    """The attribution in which an effect of whose size nothing is known is no claim: another could stand for it.

    Nor is the friction of one joint, or its rotor, of whose size too little is known beside that of other joints; of a
    robot with several such joints nothing is.
    """
    terms = judgement.leader.hypothesis.terms
    known = [
        role == "headline" and sized(t.family, own)
        for t, own, role in zip(terms, sizes, attribution.roles, strict=True)
    ]
    rows = Counter(t.family for t, told in zip(terms, known, strict=True) if told and is_row(t.effect))

    def nothing_known(i: int) -> bool:
        of_one_joint = rows[terms[i].family] >= JOINTS or max(rows.values(), default=0) >= FEWEST_JOINTS
        return (of_one_joint and not known[i]) or no_size(terms[i].family, sizes[i])

    roles = tuple("slight" if nothing_known(i) else role for i, role in enumerate(attribution.roles))
    return replace(attribution, roles=roles)


def without_claims(attribution: Attribution) -> Attribution:
    """The attribution of an account that is too little to be told: it claims nothing."""
    return replace(attribution, roles=tuple("slight" for _ in attribution.roles))


def doubts_of(
    judgement: Judgement,
    attribution: Attribution,
    forms: Iterable[Form],
    sizes: Sequence[Mapping[str, Estimate]],
    box: BlackBox | None,
    settings: Settings,
) -> tuple[Doubt, ...]:
    """Of an account with effects; none where it may be named. attribution: with the roles that it claims."""
    return tuple(_doubts(judgement, attribution, forms, sizes, box, settings))


def _doubts(
    judgement: Judgement,
    attribution: Attribution,
    forms: Iterable[Form],
    sizes: Sequence[Mapping[str, Estimate]],
    box: BlackBox | None,
    settings: Settings,
) -> Iterator[Doubt]:
    leader = judgement.leader.hypothesis
    claims = [i for i, role in enumerate(attribution.roles) if role == "headline"]
    told = list(forms)
    if not leader.terms:
        return
    if misses(judgement, attribution, settings.verdict.nearly_all) or _misses_a_channel(
        attribution, settings
    ):
        yield "left"
    if any(told[i] == "approximate" for i in claims):
        yield "form"
    if box is not None and foresees_more(box, settings):
        yield "black box"
    if any(estimate.at_bound for i in claims for estimate in sizes[i].values()):
        yield "bound"
    if not all(sized(leader.terms[i].family, sizes[i]) for i in claims):
        yield "size"
    if any(leader.times_beyond(i) >= settings.verdict.implausible for i in claims):
        yield "implausible"
    if not claims:
        yield "no claim"
    odds = [odds_against(judgement.ranking, leader, leader.terms[i].identity).nats for i in claims]
    if any(nats is not None and nats < math.log(settings.verdict.odds) for nats in odds):
        yield "odds"


def _misses_a_channel(attribution: Attribution, settings: Settings) -> bool:
    """Whether hardly anything of one channel's mismatch is explained, or its error grows, whatever the others say.

    Where none stands out of the noise in rollouts, a channel's excess may be the noise's own.
    """
    channels = attribution.explained.channels.values()
    return attribution.explained.counts and any(
        surely_below(share, settings.verdict.half) for share in channels
    )


def foresees_more(box: BlackBox, settings: Settings) -> bool:
    """Whether a model that names nothing surely takes a good part off the account's error."""
    share = box.takes_off
    return (share.share if share.low is None else share.low) > settings.black_box.more
