"""The verdict in a sentence: how much of the mismatch is explained, and what that allows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.report import JudgedOn, NamedEffect, sized
from gpsim.diagnosis.settings import VerdictSettings
from gpsim.reports.account_effects import claim_name, effect_name
from gpsim.reports.diagnosis_text import listed
from gpsim.reports.quantities import odds_text, share_text

JUDGED: Mapping[JudgedOn, str] = {
    "held-out rollouts": "",
    "cross-fitted rollouts": " (cross-fitted: too little is held out)",
    "fit windows": " (where it learnt: held-out rollouts show none)",
}
"""What a share is of, where that is not what anybody would expect."""


def verdict_sentence(diagnosis: Diagnosis, headline: Sequence[NamedEffect]) -> str:
    """What follows the verdict's name."""
    if diagnosis.verdict == "none":
        return _none(diagnosis)
    if diagnosis.verdict == "unknown":
        return _unknown(diagnosis)
    alone = len(headline) == 1 == len(diagnosis.effects)  # slight effects explain some of it, too
    what = f"{effect_name(headline[0])} explains" if alone else "the effects below explain"
    said = f"{what} {_share(diagnosis)}"
    if diagnosis.verdict == "named" and diagnosis.alternatives:
        return f"{said}; what does as well differs in small corrections alone."
    if diagnosis.verdict == "named":
        return f"{said}; no other explanation does as well."
    if diagnosis.verdict == "ambiguous":
        return f"{said}, but these data cannot tell this from {_others(diagnosis, headline)}."
    return f"{said}{_but(diagnosis, headline)}."


def _but(diagnosis: Diagnosis, headline: Sequence[NamedEffect]) -> str:
    """What keeps a partial account from being named, the weightiest of it; files of earlier versions do not say."""
    doubts = diagnosis.doubts
    measured = [effect_name(effect) for effect in headline if effect.curve is not None]
    bent = [effect_name(e) for e in headline if e.form == "approximate" and e.curve is None]
    if "left" in doubts or _much_is_left(diagnosis) or not (bent or measured or doubts):
        return "; the rest has no name yet: train with it, and mind what is left"
    if bent:
        law = f"the law of {bent[0]}" if len(bent) == 1 else f"{len(bent)} of the laws"
        verb = "holds" if len(bent) == 1 else "hold"
        return f", but {law} {verb} only approximately: trust the curve, not the size"
    if measured:
        them = "it is a curve" if len(headline) == 1 else f"{listed(measured)} is a curve"
        return f"; {them} that no law of the catalogue follows"
    if "black box" in doubts:
        return ", but a black box foresees much more: something has no name yet"
    if "no claim" in doubts:
        return ", but none of them is a claim by itself: others could stand for it"
    strange = [effect_name(e) for e in headline if e.implausible]
    if "implausible" in doubts and strange:
        return f", but no machine of the kind has {strange[0]} of that size: it stands in for something else"
    vague = [effect_name(e) for e in headline if _vague(e)]
    return f", but how large {vague[0] if vague else 'one of them'} is, these data do not say"


def _vague(effect: NamedEffect) -> bool:
    bound = any(size.at_bound for size in effect.parameters.values())
    return bound or not sized(effect.family, effect.parameters)


def _much_is_left(diagnosis: Diagnosis) -> bool:
    """Whether the verdict would be `partial` if all laws held."""
    share = diagnosis.explained.rollout
    return share is not None and share.high is not None and share.high < VerdictSettings().nearly_all


def _share(diagnosis: Diagnosis) -> str:
    found = diagnosis.explained
    if found.rollout is None:  # of an earlier version, or there was nothing to compare
        return "the mismatch"
    return f"{share_text(found.rollout)} of the mismatch{JUDGED[found.judged_on]}"


def _others(diagnosis: Diagnosis, headline: Sequence[NamedEffect]) -> str:
    """How many alternatives; where there is none, the best explanation without the claim whose odds are lowest."""
    count = len(diagnosis.alternatives)
    odds = [e.odds for e in headline if e.odds is not None and e.odds.nats is not None]
    if count or not odds:
        return "another explanation" if count < 2 else f"{count} other explanations"
    lowest = min(odds, key=lambda o: math.inf if o.nats is None else o.nats)
    told = listed([claim_name(*claim) for claim in lowest.against]) or "nothing at all"
    return f"{told} (odds of {odds_text(lowest)})"


def _none(diagnosis: Diagnosis) -> str:
    if diagnosis.remainder.structured:
        return (
            "nothing is missing that matters: what chance does not explain moves no rollout out of the noise."
        )
    return "nothing is missing that this recording could show: simulator and recording differ by noise alone."


def _unknown(diagnosis: Diagnosis) -> str:
    found = diagnosis.explained.rollout
    if found is None or not found.share > 0.0:
        return "something is missing, and no effect that I know explains it on data that it had not seen."
    return f"something is missing; the best that I know explains {share_text(found)} of it, too little to be named."
