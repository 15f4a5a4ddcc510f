"""Effects: what may be missing. One small file a family, found through one explicit registry."""

from gpsim.effects.chain import PRE_ROLL, Chain, Scheme
from gpsim.effects.closed_step import ClosedStep, closed
from gpsim.effects.effect import (
    ActuatorEffect,
    DriveEffect,
    Effect,
    ForceEffect,
    FunctionOf,
    ModelEffect,
    ParameterEffect,
    RateEffect,
    SensorEffect,
    Values,
    VehicleEffect,
    changed,
)
from gpsim.effects.elapsed import even
from gpsim.effects.own import base_name, own_name, own_values, owner_of
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.effects.plausible import declared, implausibility, times_beyond
from gpsim.effects.registry import FAMILIES, effect_of, has_patch
from gpsim.effects.term import EPISODE, FROM, IN_EPISODE, TO, Gate, LooksAt, Moment, Term, from_json, to_json

__all__ = [
    "EPISODE",
    "FAMILIES",
    "FROM",
    "IN_EPISODE",
    "PRE_ROLL",
    "TO",
    "ActuatorEffect",
    "Chain",
    "ClosedStep",
    "DriveEffect",
    "Effect",
    "EffectParameter",
    "ForceEffect",
    "FunctionOf",
    "Gate",
    "LooksAt",
    "ModelEffect",
    "Moment",
    "ParameterEffect",
    "Place",
    "Plausible",
    "RateEffect",
    "Scheme",
    "SensorEffect",
    "Term",
    "Values",
    "VehicleEffect",
    "base_name",
    "changed",
    "closed",
    "declared",
    "effect_of",
    "even",
    "from_json",
    "has_patch",
    "implausibility",
    "own_name",
    "own_values",
    "owner_of",
    "times_beyond",
    "to_json",
]
