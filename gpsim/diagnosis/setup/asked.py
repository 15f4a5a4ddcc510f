"""Which candidates inverse dynamics can size besides rows: bodies, motors, growing friction, laws that surely act."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gpsim.diagnosis.fitting import Candidate
from gpsim.diagnosis.setup.force_parts import GAIN, HELD, MASS, STIFF
from gpsim.effects import FAMILIES, RISE, ForceEffect, Term, declared, effect_of
from gpsim.simulators import Simulator

LATE = "actuator_delay"


def is_structure(candidate: Candidate) -> bool:
    """Whether it is a body or a motor that is off: a payload, a mass, a gain, gravity that a controller holds."""
    if candidate.variant:
        return False
    family, on = candidate.family, candidate.place.on
    return family in ("payload", GAIN, HELD) or (family == "parameter_offset" and on.endswith((MASS, STIFF)))


def rises_of(simulator: Simulator, offers: Iterable[Candidate]) -> list[Candidate]:
    """By how much a joint's dry friction grows as it slows, and with what its motor gives, where friction is asked."""
    grows = [effect for effect in FAMILIES.values() if RISE in effect.variants]
    joints = [c.place for c in offers if effect_of(c.family) in grows and not c.variant]
    return [
        Candidate(effect.family, place, RISE, declared(effect, place, RISE))
        for effect in grows
        for place in joints
        if place.on in simulator.served or not getattr(effect, "loaded_by_command", False)
    ]


def is_law(term: Term) -> bool:
    """Whether it is a force by position and speed, everywhere: what it does along a motion is known without a row."""
    effect, one = term.effect, np.zeros(1)
    if not isinstance(effect, ForceEffect) or term.gate or term.owners:
        return False
    values = {name: np.full(1, value) for name, value in term.values.items()}
    return effect.force(one, one, values) is not None
