"""What a diagnosis of a MuJoCo model asks of that model, and where in it each effect goes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.report import Estimate, NamedEffect
from gpsim.mjcf import Correction, MjcfSimulator, planned
from gpsim.reports.account_effects import claim_name

DIGITS, STEP = 4, 12
"""Of what is told, and of a control step that was taken from a log's stamps."""


def correction_of(plant: EffectsPlant, simulator: MjcfSimulator) -> Correction:
    """The corrected simulator as a change of its model."""
    dt = float(f"{plant.dt:.{STEP}g}")
    return Correction(simulator, plant.parameters, plant.terms, dt, plant.substeps, plant.youngest)


def where_effects_go(plant: EffectsPlant, effects: Iterable[NamedEffect]) -> list[str]:
    """A line an effect, if the simulator is a MuJoCo model; none of any other."""
    if not isinstance(plant.simulator, MjcfSimulator) or not plant.terms:
        return []
    return [went(e) for e in planned(correction_of(plant, plant.simulator), sentences(effects))]


def sentences(effects: Iterable[NamedEffect]) -> dict[tuple[str, str], str]:
    """Of each effect, by family and place, its numbers and their intervals."""
    return {(effect.family, effect.place): said_of(effect) for effect in effects}


def went(effect: Mapping[str, Any]) -> str:
    """An effect of patch.json, and the attributes it went to."""
    there = "; ".join(effect["attributes"]) or "wrapper"
    if effect["where"] == "attribute and wrapper":
        there += "; wrapper"
    reason = f" ({effect['why']})" if effect["why"] else ""
    return f"{effect['said']} -> {'left out' if effect['where'] == 'left out' else there}{reason}"


def said_of(effect: NamedEffect) -> str:
    """An effect with its numbers and their intervals, for a comment."""
    numbers = (f"{name} {_estimate(estimate)}" for name, estimate in effect.parameters.items())
    return f"{claim_name(effect.family, effect.place)}: {', '.join(numbers)}"


def _estimate(estimate: Estimate) -> str:
    """A value, its unit, and its 90 % interval."""
    value = f"{estimate.value:.{DIGITS}g} {estimate.unit}".removesuffix(" 1")
    if estimate.low is None or estimate.high is None:
        return value
    return f"{value} ({estimate.low:.{DIGITS}g} to {estimate.high:.{DIGITS}g})"
