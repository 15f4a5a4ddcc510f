"""Effects: what may be missing. One small file a family, found through one explicit registry."""

from gpsim.effects.bristles import bent, mean_force
from gpsim.effects.brought import (
    Brought,
    again,
    bring,
    brought_of,
    consent_to,
    installed,
    origins,
    own_effect,
    read_effects,
    sources,
    stand,
    standing,
)
from gpsim.effects.chain import PRE_ROLL, Chain, Scheme
from gpsim.effects.closed_step import ClosedStep, closed
from gpsim.effects.effect import (
    RISE,
    ActuatorEffect,
    BristleEffect,
    DriveEffect,
    Effect,
    ElasticDrive,
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
from gpsim.effects.elastic import transmitted, turned, twisted
from gpsim.effects.forces import bend_key
from gpsim.effects.measured import Measured, Shape, shape_of
from gpsim.effects.own import base_name, own_name, own_values, owner_of
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.effects.plain import INPUTS, RETURNS
from gpsim.effects.plausible import declared, times_beyond
from gpsim.effects.registry import CATALOGUE, CURVES, FAMILIES, effect_of, has_patch
from gpsim.effects.tabled import Axis, Curve, corners, tabled
from gpsim.effects.template import template
from gpsim.effects.term import EPISODE, FROM, IN_EPISODE, TO, Gate, LooksAt, Moment, Term, from_json, to_json
from gpsim.effects.trying import PLACE, Check, check, tried

__all__ = [
    "CATALOGUE",
    "CURVES",
    "EPISODE",
    "FAMILIES",
    "FROM",
    "INPUTS",
    "IN_EPISODE",
    "PLACE",
    "PRE_ROLL",
    "RETURNS",
    "RISE",
    "TO",
    "ActuatorEffect",
    "Axis",
    "BristleEffect",
    "Brought",
    "Chain",
    "Check",
    "ClosedStep",
    "Curve",
    "DriveEffect",
    "Effect",
    "EffectParameter",
    "ElasticDrive",
    "ForceEffect",
    "FunctionOf",
    "Gate",
    "LooksAt",
    "Measured",
    "ModelEffect",
    "Moment",
    "ParameterEffect",
    "Place",
    "Plausible",
    "RateEffect",
    "Scheme",
    "SensorEffect",
    "Shape",
    "Term",
    "Values",
    "VehicleEffect",
    "again",
    "base_name",
    "bend_key",
    "bent",
    "bring",
    "brought_of",
    "changed",
    "check",
    "closed",
    "consent_to",
    "corners",
    "declared",
    "effect_of",
    "even",
    "from_json",
    "has_patch",
    "installed",
    "mean_force",
    "origins",
    "own_effect",
    "own_name",
    "own_values",
    "owner_of",
    "read_effects",
    "shape_of",
    "sources",
    "stand",
    "standing",
    "tabled",
    "template",
    "times_beyond",
    "to_json",
    "transmitted",
    "tried",
    "turned",
    "twisted",
]
