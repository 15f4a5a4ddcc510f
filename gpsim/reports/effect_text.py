"""Effects in words: what a person would say of each."""

from __future__ import annotations

import math

from gpsim.diagnosis.report import Estimate, NamedEffect
from gpsim.effects import CURVES, FAMILIES

OFF = "{on} is {offset} off what the simulator believes"
"""Of a parameter that may be 0, as a place may."""


def effect_sentence(effect: NamedEffect) -> str:
    """What a person would say of an effect; where its family has no sentence of its own, its name and its numbers."""
    where = "" if effect.recordings is None else f" in {', '.join(effect.recordings)}"
    return f"{_said(effect)}{where}"


def _said(effect: NamedEffect) -> str:
    """The same, wherever it acts."""
    numbers = {name: estimate_text(estimate) for name, estimate in effect.parameters.items()}
    sentence = FAMILIES[effect.family].sentence if effect.family in FAMILIES else ""
    if effect.family == "parameter_offset" and "offset" in numbers:
        sentence = OFF
    try:
        said = sentence.format(on=effect.place, **numbers)
    except KeyError:  # somebody else's effect of that name: it has other parameters
        said = ""
    if said:
        return said
    told = ", ".join(f"{name} {number}" for name, number in numbers.items())
    return f"{noun(effect.family)} on {effect.place} ({told}) was left out"


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


def noun(family: str) -> str:
    """What people call a family of effects, in the catalogue or not."""
    found = FAMILIES.get(family) or CURVES.get(family)
    known = found.noun if found is not None else ""
    return known or family.replace("_", " ")


def estimate_text(estimate: Estimate) -> str:
    """Four digits and the unit, none behind a plain ratio."""
    return f"{estimate.value:.4g} {estimate.unit}".removesuffix(" 1")
