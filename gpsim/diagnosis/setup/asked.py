"""Which candidates inverse dynamics can size besides rows: bodies, motors, growing friction, laws that surely act."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.diagnosis.fitting import Candidate
from gpsim.diagnosis.setup.force_parts import GAIN, HELD, MASS, STIFF
from gpsim.effects import RISE, ForceEffect, Term, declared, effect_of

LATE, STRIBECK = "actuator_delay", "stribeck_friction"


def is_structure(candidate: Candidate) -> bool:
    """Whether it is a body or a motor that is off: a payload, a mass, a gain, gravity that a controller holds."""
    if candidate.variant:
        return False
    family, on = candidate.family, candidate.place.on
    return family in ("payload", GAIN, HELD) or (family == "parameter_offset" and on.endswith((MASS, STIFF)))


def rise_of(candidate: Candidate) -> Candidate | None:
    """By how much a joint's dry friction grows as it slows, where its Stribeck friction may be asked."""
    if candidate.family != STRIBECK or candidate.variant:
        return None
    place = candidate.place
    return replace(candidate, variant=RISE, declared=declared(effect_of(STRIBECK), place, RISE))


def is_law(term: Term) -> bool:
    """Whether it is a force by position and speed, everywhere: what it does along a motion is known without a row."""
    effect, one = term.effect, np.zeros(1)
    if not isinstance(effect, ForceEffect) or term.gate or term.owners:
        return False
    values = {name: np.full(1, value) for name, value in term.values.items()}
    return effect.force(one, one, values) is not None
