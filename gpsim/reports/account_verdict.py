"""The verdict in a sentence: how much of the mismatch is explained, and what that allows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.report import JudgedOn, NamedEffect
from gpsim.diagnosis.settings import VerdictSettings
from gpsim.reports.account_effects import effect_name
from gpsim.reports.quantities import share_text

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
        return f"{said}, but these data cannot tell this from {_others(len(diagnosis.alternatives))}."
    bent = [effect_name(effect) for effect in headline if effect.form == "approximate"]
    if not bent or _much_is_left(diagnosis):
        return f"{said}; the rest has no name yet: train with it, and mind what is left."
    law = f"the law of {bent[0]}" if len(bent) == 1 else f"{len(bent)} of the laws"
    verb = "holds" if len(bent) == 1 else "hold"
    return f"{said}, but {law} {verb} only approximately: trust the curve, not the size."


def _much_is_left(diagnosis: Diagnosis) -> bool:
    """Whether the verdict would be `partial` if all laws held."""
    share = diagnosis.explained.rollout
    return share is not None and share.high is not None and share.high < VerdictSettings().nearly_all


def _share(diagnosis: Diagnosis) -> str:
    found = diagnosis.explained
    if found.rollout is None:  # of an earlier version, or there was nothing to compare
        return "the mismatch"
    return f"{share_text(found.rollout)} of the mismatch{JUDGED[found.judged_on]}"


def _others(count: int) -> str:
    return "another explanation" if count < 2 else f"{count} other explanations"


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
