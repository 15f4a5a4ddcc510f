"""Effects: what may be missing. A class a family, in one file a site, found through one explicit registry."""

from gpsim.effects.bristles import bent, mean_force
from gpsim.effects.brought import (
    INPUTS,
    Brought,
    again,
    bring,
    consent_to,
    installed,
    origins,
    own_effect,
    read_effects,
)
from gpsim.effects.chain import PRE_ROLL, Chain, Scheme
from gpsim.effects.closed_step import BlackBoxStepper, closed
from gpsim.effects.effect import (
    RISE,
    ActuatorEffect,
    BristleEffect,
    DriveEffect,
    Effect,
    ElasticDrive,
    ForceEffect,
    Law,
    ModelEffect,
    ParameterEffect,
    RateEffect,
    SensorEffect,
    Values,
    VehicleEffect,
    arguments,
    declared,
)
from gpsim.effects.elastic import transmitted, turned, twisted
from gpsim.effects.families.actuators import ActuatorLag
from gpsim.effects.families.models import passed_on
from gpsim.effects.families.sensors import SensorLag
from gpsim.effects.forces import bend_key
from gpsim.effects.late import LateEffect, even
from gpsim.effects.measured import Curve, Measured, Shape, shape_of
from gpsim.effects.place import EffectParameter, Place, times_beyond
from gpsim.effects.registry import CATALOGUE, CURVES, FAMILIES, effect_of, has_patch
from gpsim.effects.template import template
from gpsim.effects.term import (
    EPISODE,
    FROM,
    IN_EPISODE,
    TO,
    Gate,
    Moment,
    Term,
    base_name,
    from_json,
    own_name,
    own_values,
    owner_of,
    to_json,
)
from gpsim.effects.trying import PLACE, Check, check, tried
