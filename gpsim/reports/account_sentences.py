"""The sentences of an account: the verdict, its rivals, what is left, what to do next."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence

from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.settings import VerdictSettings
from gpsim.findings import BlackBox, Claims, Estimate, JudgedOn, Leads, NamedEffect, sized
from gpsim.mjcf import is_mujoco
from gpsim.reports.account_effects import beyond, claim_name, effect_name, told_effects
from gpsim.reports.diagnosis_text import combination_texts, listed, parameters_of
from gpsim.reports.quantities import certainty_text, is_open, percent, share_text, spelled
from gpsim.simulators import lives_here

JUDGED: Mapping[JudgedOn, str] = {
    "held-out rollouts": "",
    "cross-fitted rollouts": " (cross-fitted: too little is held out)",
    "fit windows": " (on its own training data: held-out rollouts show no mismatch)",
}
"""What a share is of, where that is not what anybody would expect."""


def verdict_sentence(diagnosis: Diagnosis, headline: Sequence[NamedEffect]) -> str:
    """What follows the verdict's name."""
    if diagnosis.verdict == "none" and diagnosis.remainder.structured:
        return (
            "nothing that matters is missing: what is left is not chance, but rollouts stay within the noise."
        )
    if diagnosis.verdict == "none":
        return (
            "nothing is missing that this recording could show: simulator and recording differ by noise only."
        )
    if diagnosis.verdict == "unknown":
        return _unknown(diagnosis)
    alone = len(headline) == 1 == len(diagnosis.effects)  # slight effects explain some of it, too
    what = f"{effect_name(headline[0])} explains" if alone else "the effects below explain"
    said = f"{what} {_share(diagnosis)}"
    if diagnosis.verdict == "named" and diagnosis.alternatives:
        return f"{said}; other explanations that fit as well differ in small corrections only."
    if diagnosis.verdict == "named":
        return f"{said}; no other explanation does as well."
    if diagnosis.verdict == "ambiguous":
        return f"{said}, but these data cannot tell it apart from {_others(diagnosis, headline)}."
    return f"{said}{_but(diagnosis, headline)}."


def _but(diagnosis: Diagnosis, headline: Sequence[NamedEffect]) -> str:
    """What keeps a partial account from being named, the weightiest of it; files of earlier versions do not say."""
    doubts = diagnosis.doubts
    measured = [effect_name(effect) for effect in headline if effect.curve is not None]
    bent = [effect_name(e) for e in headline if e.form == "approximate" and e.curve is None]
    share = diagnosis.explained.rollout  # much is left: the verdict would be `partial` if all laws held
    much = share is not None and share.high is not None and share.high < VerdictSettings().nearly_all
    if "left" in doubts or much or not (bent or measured or doubts):
        return "; the rest is unexplained: the corrected simulator helps, but is not complete"
    strange = [effect_name(e) for e in headline if e.implausible]
    if "implausible" in doubts and strange:
        return f", but the size of {strange[0]} is implausible: it probably stands in for something else"
    if bent:
        law = f"the law of {bent[0]}" if len(bent) == 1 else f"{len(bent)} of the laws"
        verb = "holds" if len(bent) == 1 else "hold"
        return f", but {law} {verb} only approximately: trust its curve in the report more than its size"
    if measured:
        them = "it is a curve" if len(headline) == 1 else f"{listed(measured)} is a curve"
        return f"; {them} that no law of the catalogue follows"
    if "black box" in doubts:
        return ", but a black-box model predicts much better: some physics is still missing"
    if "no claim" in doubts:
        return ", but each of them could be replaced by another effect"
    vague = [effect_name(e) for e in headline if _held(e) or not sized(e.family, e.parameters)]
    return f", but these data do not determine how large {vague[0] if vague else 'one of them'} is"


def _held(effect: NamedEffect) -> bool:
    return any(size.at_bound for size in effect.parameters.values())


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
    return told if is_open(lowest) else f"{told} (odds of {certainty_text(lowest)})"


def _unknown(diagnosis: Diagnosis) -> str:
    found = diagnosis.explained.rollout
    if found is None or not found.share > 0.0:
        return "something is missing, and no effect of the catalogue explains it on held-out data."
    said = share_text(found)
    return f"something is missing; the best explanation covers {said} of it, too little to name it."


POOR = 0.5  # of a rate's mismatch one step ahead: an account that explains less of it says so
MOST_FACTS = 3  # of the log, and of parameters that only act together: further ones are in diagnosis.json


def left(diagnosis: Diagnosis) -> Iterator[str]:
    """The sentences, the one that matters most first."""
    yield _amount(diagnosis)
    if "black box" in diagnosis.doubts and diagnosis.fit.black_box is not None:
        yield _foreseen(diagnosis, diagnosis.fit.black_box)
    if diagnosis.verdict not in ("unknown", "none"):
        yield from (effect.implausible for effect in diagnosis.effects if effect.implausible)
    if diagnosis.log_facts:
        yield f"the log: {listed(diagnosis.log_facts, MOST_FACTS)}"
    yield from combination_texts(diagnosis.combinations[:MOST_FACTS])
    steps = diagnosis.explained.one_step.items()
    poor = [f"{percent(found.share)} % of {spelled(rate)}" for rate, found in steps if found.share < POOR]
    if poor and diagnosis.verdict not in ("unknown", "none"):
        yield f"one step ahead only {listed(poor)} is explained"
    gp = diagnosis.remainder.gp
    if gp is not None and gp.used and diagnosis.verdict != "none":
        alone = diagnosis.verdict == "unknown"
        use = "the errors after include it" if alone else "simulate with it for smaller errors"
        yield f"a Gaussian process has learned it: {use}"


def box_name(diagnosis: Diagnosis) -> str:
    """The model that names nothing and foresees most."""
    box = diagnosis.fit.black_box
    if box is None:
        return "a black box"
    if box.model == "curve":
        return f"a free curve of {box.of}"
    return "a Gaussian process alone" if box.model == "gp" else "a Gaussian process on top of them"


def _foreseen(diagnosis: Diagnosis, box: BlackBox) -> str:
    text = f"{box_name(diagnosis)} removes {share_text(box.takes_off)} of the remaining held-out error"
    inputs = listed([spelled(name) for name in box.depends_on])
    return f"{text}; it uses {inputs}" if inputs else text


def left_share(diagnosis: Diagnosis) -> float | None:
    """Of the mismatch what is left; None of an earlier version."""
    found = diagnosis.explained.rollout
    given = diagnosis.remainder.share
    return given if given is not None else None if found is None else max(0.0, 1.0 - found.share)


def _amount(diagnosis: Diagnosis) -> str:
    share, remainder = left_share(diagnosis), diagnosis.remainder
    if diagnosis.verdict == "none" and not remainder.structured:
        return "nothing but noise"
    amount = "something" if share is None else f"{percent(share)} % of the mismatch"
    if not remainder.structured:
        return "nothing but noise" if share is None else f"{amount}, no more than noise would leave"
    text = "something that is not noise" if share is None else f"{amount} is unexplained"
    if remainder.rate:
        text += f"{', most of it' if share is not None else ''} in {spelled(remainder.rate)}"
    if remainder.depends_on:
        text += f"; it changes with {listed([spelled(name) for name in remainder.depends_on])}"
    return text


# Simulators in which gpsim trains policies, and which experiment does.
TRAINED: Mapping[str, str] = {"cartpole": "", "unicycle": "experiment=limo "}
VAGUE = 0.25  # half an interval over its value: a size that is known less well is worth another recording


def following(diagnosis: Diagnosis, headline: Sequence[NamedEffect]) -> list[str]:
    """The advice that would help most, first what only another recording can decide."""
    if diagnosis.verdict == "none":
        return ["train in the simulator as it is: it needs no correction"]
    held = [effect_name(e) for e in headline if _held(e)]
    named = diagnosis.verdict == "named"
    if diagnosis.tell_apart and diagnosis.alternatives and not named:
        return [diagnosis.tell_apart]
    measured = [e.curve for e in headline if e.curve is not None]
    if measured and not diagnosis.remainder.structured:
        return [beyond(measured[0])]
    if not named and (diagnosis.remainder.structured or diagnosis.verdict in ("unknown", "partial")):
        return [_where_it_moves(diagnosis)]
    if diagnosis.combinations:
        of = parameters_of(diagnosis.combinations[0])
        return [f"measure {of} on its own: motion alone fixes only a combination"]
    if held:
        return [f"record more of what {held[0]} does: its size is at the limit of the search"]
    vague = max(headline, key=_vagueness, default=None)
    if vague is not None and _vagueness(vague) > VAGUE:
        return [f"record more of what {effect_name(vague)} does: its size is known least well"]
    return ["use it: no further recording would change this account"]


def command(diagnosis: Diagnosis, folder: str, simulator: str | None = None) -> str | None:
    """How to train in the corrected simulator; None where nothing corrects it.

    simulator: the base's name, None where nobody knows it. gpsim has policies for two; a MuJoCo model is written out
    again with its effects; of all others Python reads it.
    """
    gp, effects = diagnosis.remainder.gp, any(told_effects(diagnosis))
    learnt = gp is not None and gp.used
    if diagnosis.verdict == "none" or not (learnt or effects):
        return None
    if simulator is not None and effects and is_mujoco(simulator):
        return f"gpsim export model {shlex.quote(folder)} --out robot_corrected.xml"
    if simulator is not None and simulator not in TRAINED:
        base = ", simulator" if lives_here(simulator) else ""
        return f"python: gpsim.Diagnosis.load({folder!r}{base}).corrected({'gp=True' if learnt else ''})"
    words = TRAINED.get(simulator or "", "")
    given = shlex.quote(f"diagnosis={folder}")
    return f"gpsim train-gp-policy {words}{given}{' correction=effects+gp' if learnt else ''}"


def _where_it_moves(diagnosis: Diagnosis) -> str:
    """A recording that shows more of what is left: where what it depends on moves."""
    inputs = diagnosis.remainder.depends_on
    if inputs:
        names = listed(list(map(spelled, inputs)))
        its, it = ("its", "it") if len(inputs) == 1 else ("their", "them")
        return (
            f"record {names} over {its} whole range, in one slow sweep and one fast sweep: what is missing changes "
            f"with {it}"
        )
    if diagnosis.explained.judged_on != "held-out rollouts":
        return "record for longer: there was too little held-out data to judge what is left"
    return "record slow and fast sweeps of every command: no measured channel predicts what is left"


def _vagueness(effect: NamedEffect) -> float:
    """Half the interval's width over the value, the largest of its sizes."""
    return max(map(_relative, effect.parameters.values()), default=0.0)


def _relative(size: Estimate) -> float:
    if size.low is None or size.high is None or not math.isfinite(size.value):
        return math.inf
    width = abs(size.high - size.low) / 2
    if not size.value:
        return math.inf if width else 0.0
    return width / abs(size.value)


LEADS: Mapping[Leads, str] = {
    "likeliest": "the table shows the likeliest",
    "simplest": "the table shows the simplest of those within odds of 10 to 1",
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
    shared = [claim for claim in certain if claim in claimed]  # what is slight is no claim, whoever shares it
    if shared:
        yield f"in every explanation: {_said(shared)}"
    first, further = open_[: 1 + MOST], len(open_) - 1 - MOST
    more = f" or {further} more in diagnosis.json" if further > 0 else ""
    yield f"either {' or '.join(first)}{more}; {LEADS[diagnosis.leads]}"


def _claims(effects: Sequence[NamedEffect]) -> Claims:
    return tuple((effect.family, effect.place) for effect in effects)


def _said(claims: Sequence[tuple[str, str]]) -> str:
    return listed([claim_name(family, place) for family, place in claims]) or "nothing more"
