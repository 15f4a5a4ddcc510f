"""The registry of effects: one line a family."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gpsim.effects.actuator_asymmetry import ActuatorAsymmetry
from gpsim.effects.actuator_backlash import ActuatorBacklash
from gpsim.effects.actuator_bias import ActuatorBias
from gpsim.effects.actuator_dead_zone import ActuatorDeadZone
from gpsim.effects.actuator_delay import ActuatorDelay
from gpsim.effects.actuator_gain import ActuatorGain
from gpsim.effects.actuator_lag import ActuatorLag
from gpsim.effects.actuator_rate_limit import ActuatorRateLimit
from gpsim.effects.actuator_saturation import ActuatorSaturation
from gpsim.effects.armature import Armature
from gpsim.effects.battery_sag import BatterySag
from gpsim.effects.constant_force import ConstantForce
from gpsim.effects.coulomb_friction import CoulombFriction
from gpsim.effects.effect import Effect
from gpsim.effects.frame_rotation import FrameRotation
from gpsim.effects.gravity_tilt import GravityTilt
from gpsim.effects.joint_offset import JointOffset
from gpsim.effects.lateral_slip import LateralSlip
from gpsim.effects.local_friction_patch import LocalFrictionPatch
from gpsim.effects.marker_offset import MarkerOffset
from gpsim.effects.minimum_turning_radius import MinimumTurningRadius
from gpsim.effects.parameter_offset import ParameterOffset
from gpsim.effects.payload import Payload
from gpsim.effects.quadratic_drag import QuadraticDrag
from gpsim.effects.sensor_bias import SensorBias
from gpsim.effects.sensor_delay import SensorDelay
from gpsim.effects.sensor_scale import SensorScale
from gpsim.effects.spring import Spring
from gpsim.effects.steering_bias import SteeringBias
from gpsim.effects.stribeck_friction import StribeckFriction
from gpsim.effects.understeer import Understeer
from gpsim.effects.viscous_friction import ViscousFriction
from gpsim.errors import UsageError


def register(effects: Sequence[Effect]) -> Mapping[str, Effect]:
    """Family -> effect, in order; one that is registered twice, or does not say what its law is of, is an error."""
    out: dict[str, Effect] = {}
    for effect in effects:
        if effect.family in out:
            raise ValueError(f"the family '{effect.family}' is registered twice")
        if not hasattr(effect, "function_of"):
            raise ValueError(f"the family '{effect.family}' does not say what its law is a function_of")
        out[effect.family] = effect
    return out


FAMILIES: Mapping[str, Effect] = register(
    [
        CoulombFriction(),
        ViscousFriction(),
        QuadraticDrag(),
        StribeckFriction(),
        Spring(),
        ConstantForce(),
        LocalFrictionPatch(),
        ParameterOffset(),
        ActuatorGain(),
        ActuatorBias(),
        ActuatorDeadZone(),
        ActuatorSaturation(),
        ActuatorAsymmetry(),
        ActuatorDelay(),
        ActuatorLag(),
        ActuatorRateLimit(),
        ActuatorBacklash(),
        BatterySag(),
        MinimumTurningRadius(),
        Understeer(),
        SteeringBias(),
        LateralSlip(),
        SensorBias(),
        SensorScale(),
        SensorDelay(),
        MarkerOffset(),
        FrameRotation(),
        Payload(),
        Armature(),
        GravityTilt(),
        JointOffset(),
    ]
)


def has_patch(family: str) -> bool:
    """Whether the law in a region of its own coordinate is a family by itself, and the family there is nothing else."""
    return any(effect.patch_of == family for effect in FAMILIES.values())


def effect_of(family: str) -> Effect:
    """The effect of a family; raises UsageError with the alternatives."""
    if family not in FAMILIES:
        raise UsageError(f"unknown effect family '{family}'; there are: {', '.join(FAMILIES)}")
    return FAMILIES[family]
