"""The registry of effects: every family that has a class in `families`, in the catalogue's order."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from inspect import isabstract

from gpsim.effects import families
from gpsim.effects.effect import Effect
from gpsim.effects.measured import ActuatorCurve, ForceCurve, RateCurve, SensorCurve
from gpsim.errors import UsageError, near

ORDER = (
    "coulomb_friction", "viscous_friction", "quadratic_drag", "stribeck_friction", "spring", "constant_force",
    "local_friction_patch", "parameter_offset", "actuator_gain", "actuator_bias", "actuator_dead_zone",
    "actuator_saturation", "actuator_asymmetry", "actuator_delay", "actuator_lag", "actuator_rate_limit",
    "actuator_backlash", "battery_sag", "minimum_turning_radius", "understeer", "steering_bias", "lateral_slip",
    "sensor_bias", "sensor_scale", "sensor_delay", "marker_offset", "frame_rotation", "payload", "armature",
    "gravity_tilt", "joint_offset",
)  # fmt: skip
"""Families that come first, in this order: of two that explain the same, the first one leads. Others follow by name."""


def register(effects: Sequence[Effect]) -> Mapping[str, Effect]:
    """Family -> effect, in order; one that is registered twice, or does not say what its law is of, is an error."""
    out: dict[str, Effect] = {}
    for effect in effects:
        if effect.family in out:
            raise ValueError(f"the family '{effect.family}' is registered twice")
        if not hasattr(effect, "function_of"):
            raise ValueError(f"the family '{effect.family}' does not define function_of for its law")
        out[effect.family] = effect
    return out


def _written() -> Iterator[Effect]:
    """One of each class in these files that names a family."""
    for file in pkgutil.iter_modules(families.__path__):
        module = import_module(f"{families.__name__}.{file.name}")
        for found in vars(module).values():
            own = (
                isinstance(found, type) and issubclass(found, Effect) and found.__module__ == module.__name__
            )
            if own and "family" in vars(found) and not isabstract(found):
                yield found()


def _ordered(effects: Iterable[Effect]) -> list[Effect]:
    place = {family: i for i, family in enumerate(ORDER)}
    return sorted(effects, key=lambda effect: (place.get(effect.family, len(ORDER)), effect.family))


CATALOGUE: Mapping[str, Effect] = register(_ordered(_written()))
"""The families that gpsim has."""
FAMILIES: dict[str, Effect] = dict(CATALOGUE)
"""All that are asked: the catalogue's, and those that a user brings (see `gpsim.effects.brought`)."""


CURVES: Mapping[str, Effect] = register([ForceCurve(), ActuatorCurve(), SensorCurve(), RateCurve()])
"""Measured curves, for what no family of the catalogue is near to: a search offers none of them."""


def has_patch(family: str) -> bool:
    """Whether the law in a region of its own coordinate is a family by itself, and the family there is nothing else."""
    return any(effect.patch_of == family for effect in FAMILIES.values())


def effect_of(family: str) -> Effect:
    """The effect of a family; raises UsageError with the nearest."""
    found = FAMILIES.get(family) or CURVES.get(family)
    if found is None:
        meant = near(family, [*FAMILIES, *CURVES])
        raise UsageError(f"unknown effect family '{family}'{meant}; `gpsim effects list` names all")
    return found
