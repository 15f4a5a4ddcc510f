"""The sentences that diagnosis.json holds: what a person would say of each effect, and what to record next."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from gpsim.diagnosis import Diagnosis
from gpsim.effects import FAMILIES
from gpsim.findings import Claims, Discrimination, Estimate, NamedEffect, NoGp, Shape
from gpsim.reports.account_effects import curve_sentence
from gpsim.reports.diagnosis_text import fixed_text, log_fact_text, noun, open_text, with_sentences

OFF = "{on} is {offset} off its value in the simulator"
"""Of a parameter that may be 0, such as a position."""
EXCITATIONS: Mapping[Shape, str] = {
    "constant": "a constant {action} of {size:.3g}",
    "slow wave": "a slow wave of {action} with amplitude {size:.3g}",
    "fast wave": "a fast wave of {action} with amplitude {size:.3g}",
    "random levels": "random levels of {action} up to {size:.3g}",
}
NOBODY_TELLS_APART = (
    "{who} predict the same for every tested excitation: no recording of these channels separates them; measure one "
    "of the quantities directly (weigh it, or measure the acting force or command)"
)
UNSEEN = "unseen training data"
NO_GP = {
    "no structure": "it has no structure",
    "not fitted": "it could not be fitted",
    "not written": "it could not be written down",
    "explains nothing": f"it would explain nothing of {UNSEEN}",
    "harms": f"it would multiply the error in {{channel}} {{when}} by {{times:.2g}} on {UNSEEN}",
    "strays": "it would multiply the error in {channel} by {times:.2g} in free runs of {seconds:.3g} s",
}


def worded(diagnosis: Diagnosis) -> Diagnosis:
    """The diagnosis with every sentence that diagnosis.json holds; those that it has already stay as they are."""
    advice, gp = diagnosis.discrimination, diagnosis.remainder.gp
    if gp is not None and gp.refused is not None and not gp.why_not:
        gp = replace(gp, why_not=no_gp_text(gp.refused))
    return replace(
        diagnosis,
        effects=_with_sentences(diagnosis.effects),
        alternatives=tuple(replace(a, effects=_with_sentences(a.effects)) for a in diagnosis.alternatives),
        tell_apart=tell_apart_text(advice) if advice and not diagnosis.tell_apart else diagnosis.tell_apart,
        remainder=replace(diagnosis.remainder, gp=gp),
        combinations=tuple(
            replace(c, fixed=c.fixed or fixed_text(c), open=c.open or open_text(c))
            for c in diagnosis.combinations
        ),
        log_facts=diagnosis.log_facts or tuple(log_fact_text(fact) for fact in diagnosis.facts),
        kinematics=with_sentences(diagnosis.kinematics),
    )


def _with_sentences(effects: Sequence[NamedEffect]) -> tuple[NamedEffect, ...]:
    return tuple(
        replace(
            e,
            sentence=e.sentence or (curve_sentence(e) if e.curve is not None else effect_sentence(e)),
            implausible=e.implausible or implausible_text(e),
        )
        for e in effects
    )


def effect_sentence(effect: NamedEffect) -> str:
    """What a person would say of an effect; where its family has no sentence of its own, its name and its numbers."""
    numbers = {name: estimate_text(estimate) for name, estimate in effect.parameters.items()}
    sentence = FAMILIES[effect.family].sentence if effect.family in FAMILIES else ""
    if effect.family == "parameter_offset" and "offset" in numbers:
        sentence = OFF
    try:
        said = sentence.format(on=effect.place, **numbers)
    except KeyError:  # somebody else's effect of that name: it has other parameters
        said = ""
    if not said:
        told = ", ".join(f"{name} {number}" for name, number in numbers.items())
        said = f"{noun(effect.family)} on {effect.place} ({told}) is missing"
    return said + ("" if effect.recordings is None else f" in {', '.join(effect.recordings)}")


def implausible_text(effect: NamedEffect) -> str | None:
    """What is to be said of sizes that no machine of the kind has; None where all are usual."""
    everywhere = [("", effect.parameters)] if effect.recordings is None else []
    alone = [(f" in {recording}", sizes) for recording, sizes in (effect.own or {}).items()]
    said = [
        f"{name.replace('_', ' ')} {estimate_text(size)}{where}, usual {_range(size)}"
        for where, sizes in [*everywhere, *alone]
        for name, size in sizes.items()
        if size.usual is not None
    ]
    return f"{noun(effect.family)} on {effect.place} is implausible: {'; '.join(said)}" if said else None


def _range(size: Estimate) -> str:
    """`up to 5 s^2/m^2`, `0.25 to 4`."""
    low, high = size.usual or (0.0, math.inf)
    if not math.isfinite(high):
        text = f"at least {low:.3g}"
    else:
        text = f"up to {high:.3g}" if low <= 0.0 else f"{low:.3g} to {high:.3g}"
    return f"{text} {size.unit}".removesuffix(" 1")


def estimate_text(estimate: Estimate) -> str:
    """Four digits and the unit, none behind a plain ratio."""
    return f"{estimate.value:.4g} {estimate.unit}".removesuffix(" 1")


def tell_apart_text(advice: Discrimination) -> str:
    """What to record next; of the rivals that no recording separates, what to do instead."""
    said = []
    for found in advice.recordings:
        drive = found.excitation
        said.append(
            f"record {EXCITATIONS[drive.shape].format(action=drive.action, size=drive.size)}: "
            f"{_both(found.explanations)} then differ by up to {found.difference:.3g} standard deviations of the "
            f"noise in {found.channel}"
        )
    if advice.inseparable:
        said.append(NOBODY_TELLS_APART.format(who=", ".join(_both(pair) for pair in advice.inseparable)))
    return "; ".join(said)


def _both(explanations: Sequence[Claims]) -> str:
    """What each says beyond what all of them say."""
    shared = [claim for claim in explanations[0] if all(claim in claims for claims in explanations)]
    own = [[f"{noun(c[0])} on {c[1]}" for c in claims if c not in shared] for claims in explanations]
    return " and ".join(" with ".join(names) or "neither of them" for names in own)


def no_gp_text(why: NoGp) -> str:
    """Why no Gaussian process models what is left."""
    when = "after a rollout" if why.rollout else "one step ahead"
    facts = {"channel": why.channel, "when": when, "times": why.times, "seconds": why.seconds}
    return NO_GP[why.reason].format(**facts)
