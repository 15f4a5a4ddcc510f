"""Which families and systems have a compiled form, under which number, and the order of their values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gpsim.effects import (
    CATALOGUE,
    ActuatorEffect,
    BristleEffect,
    DriveEffect,
    ElasticDrive,
    ForceEffect,
    VehicleEffect,
)
from gpsim.kernels import codes
from gpsim.simulators import Ackermann, CartPole, Pendulum, ServoJoint, Simulator, Slider, Unicycle

Law = tuple[int, tuple[str, ...]]

SYSTEMS: Mapping[type[Simulator], int] = {
    CartPole: codes.CARTPOLE,
    Pendulum: codes.PENDULUM,
    Slider: codes.SLIDER,
    Unicycle: codes.UNICYCLE,
    Ackermann: codes.ACKERMANN,
    ServoJoint: codes.SERVO_JOINT,
}

OWN: Mapping[str, int] = {
    family: codes.OWN + i
    for i, family in enumerate(
        f
        for f, e in CATALOGUE.items()
        if type(e).law is not None or (isinstance(e, ForceEffect) and type(e).dry_law is not None)
    )
}
"""The number of every family that writes its law as one formula: compiled code takes it from there."""


def _own(site: type[Any], *, dry: bool = False) -> dict[str, Law]:
    """Those of a site, with what they read."""
    return {
        family: (number, tuple(CATALOGUE[family].takes))
        for family, number in OWN.items()
        if isinstance(effect := CATALOGUE[family], site)
        and (not isinstance(effect, ForceEffect) or effect.dry == dry)
    }


OWN_FORCES, OWN_DRY = _own(ForceEffect), _own(ForceEffect, dry=True)
OWN_DRIVES, OWN_ACTUATORS, OWN_TWISTS = _own(DriveEffect), _own(ActuatorEffect), _own(VehicleEffect)
DRIVES: Mapping[str, Law] = {
    **OWN_DRIVES,
    **{f: (codes.ELASTIC, tuple(e.takes)) for f, e in CATALOGUE.items() if isinstance(e, ElasticDrive)},
}
FORCES: Mapping[str, Law] = {
    **OWN_FORCES,
    "viscous_friction": (codes.VISCOUS, ("damping",)),
    "quadratic_drag": (codes.QUADRATIC, ("drag",)),
    "spring": (codes.SPRING, ("stiffness", "rest_position")),
    "constant_force": (codes.CONSTANT, ("force",)),
}
DRY: Mapping[str, Law] = {
    **OWN_DRY,
    **{f: (codes.BRISTLES, tuple(e.takes)) for f, e in CATALOGUE.items() if isinstance(e, BristleEffect)},
    "coulomb_friction": (codes.COULOMB, ("force",)),
    "local_friction_patch": (codes.COULOMB, ("force",)),
    "stribeck_friction": (codes.STRIBECK, ("force", "static_force", "stribeck_velocity")),
}
BY_LOAD: Mapping[str, Law] = {"coulomb_friction": (codes.COEFFICIENT, ("coefficient",))}
RISES: Mapping[str, Law] = {"stribeck_friction": (codes.STRIBECK, ("force", "rise", "stribeck_velocity"))}
"""By how much friction grows, beside what slides: of no sliding force. Others' laws are the same by themselves."""
PARAMETERS: Mapping[str, Law] = {"parameter_offset": (codes.RATIO, ("ratio",))}
DIFFERENCES: Mapping[str, Law] = {"parameter_offset": (codes.DIFFERENCE, ("offset",))}
"""The same of parameters that may be 0."""
TWISTS: Mapping[str, Law] = {
    **OWN_TWISTS,
    "minimum_turning_radius": (codes.RADIUS, ("radius",)),
    "understeer": (codes.UNDERSTEER, ("gradient",)),
    "steering_bias": (codes.STEERING, ("curvature",)),
    "lateral_slip": (codes.SLIP, ("slip",)),
}
ACTUATORS: Mapping[str, Law] = {
    **OWN_ACTUATORS,
    **{f: (codes.DELAY, tuple(e.takes)) for f, e in CATALOGUE.items() if "delay" in e.takes},
    "actuator_dead_zone": (codes.DEAD_ZONE, ("width",)),
    "actuator_saturation": (codes.SATURATION, ("limit",)),
    "actuator_gain": (codes.GAIN, ("gain",)),
    "actuator_asymmetry": (codes.ASYMMETRY, ("gain_positive", "gain_negative")),
    "battery_sag": (codes.SAG, ("loss_per_second",)),
    "actuator_bias": (codes.BIAS, ("bias",)),
    "actuator_backlash": (codes.BACKLASH, ("half_width",)),
    "actuator_rate_limit": (codes.RATE_LIMIT, ("rate",)),
    "actuator_lag": (codes.LAG, ("time_constant",)),
}
CURVES: Mapping[str, int] = {
    "force": codes.FORCE_CURVE,
    "grip": codes.GRIP_CURVE,
    "turn": codes.TURN_CURVE,
    "slip": codes.SLIP_CURVE,
    "rate": codes.RATE_CURVE,
    "drive": codes.DRIVE_CURVE,
}


@dataclass(frozen=True)
class Hat:
    """A gate that opens and closes gradually along a channel: 1 at the knot of a place, 0 at its neighbours."""

    along: str
    knots: tuple[float, ...]
    place: int
