"""Effects in words: what a person would say of each."""

from __future__ import annotations

import math
from collections.abc import Mapping

from gpsim.diagnosis.report import Estimate, NamedEffect
from gpsim.effects import FAMILIES

SENTENCES: Mapping[str, str] = {
    "viscous_friction": "viscous friction on {on} with damping {damping} was left out",
    "quadratic_drag": "quadratic drag on {on} of {drag} was left out",
    "stribeck_friction": "Stribeck friction on {on} ({static_force} at rest, {force} sliding, "
    "falling over {stribeck_velocity}) was left out",
    "spring": "a spring on {on} of {stiffness} resting at {rest_position} was left out",
    "constant_force": "a constant force of {force} on {on} was left out",
    "local_friction_patch": "a patch of {on} brakes with a friction of {force}",
    "parameter_offset": "{on} is {ratio} times what the simulator believes",
    "actuator_gain": "{on} acts with {gain} times its commanded size",
    "actuator_bias": "{on} acts with an offset of {bias}",
    "actuator_dead_zone": "{on} does nothing below {width}",
    "actuator_saturation": "{on} saturates at {limit}",
    "actuator_asymmetry": "{on} acts with {gain_positive} times a positive command and {gain_negative} times a "
    "negative one",
    "actuator_delay": "{on} acts {delay} late",
    "actuator_lag": "{on} follows its command with a lag of {time_constant}",
    "actuator_rate_limit": "{on} changes no faster than {rate}",
    "actuator_backlash": "{on} has a backlash of half width {half_width}",
    "battery_sag": "{on} loses {loss_per_second} of its strength (battery sag)",
    "minimum_turning_radius": "the vehicle turns no tighter than a radius of {radius}",
    "understeer": "the vehicle understeers with a gradient of {gradient}",
    "steering_bias": "the steering is off by a curvature of {curvature}",
    "lateral_slip": "the vehicle slips sideways by {slip} times its lateral acceleration",
    "sensor_bias": "the sensor of {on} is off by {offset}",
    "sensor_scale": "the sensor of {on} reads {scale} times the truth",
    "sensor_delay": "the sensor of {on} is {delay} late",
    "marker_offset": "the marker sits {forward} ahead and {left} left of the vehicle's reference point",
    "frame_rotation": "the measured yaw is turned by {angle}",
    "payload": "a payload of {mass} on {on}, at ({x}, {y}, {z}) in its frame, was left out",
    "armature": "rotor inertia of {inertia} on {on} was left out",
    "gravity_tilt": "the base is tilted by a roll of {roll} and a pitch of {pitch}",
    "joint_offset": "the zero of {on} is off by {offset}",
}
"""Of the families that have more to say than that they were left out, in their parameters' names."""


OFF = "{on} is {offset} off what the simulator believes"
"""Of a parameter that may be 0, as a place may."""


def effect_sentence(effect: NamedEffect) -> str:
    """What a person would say of an effect; where its family has no sentence of its own, its name and its numbers."""
    where = "" if effect.recordings is None else f" in {', '.join(effect.recordings)}"
    return f"{_said(effect)}{where}"


def _said(effect: NamedEffect) -> str:
    """The same, wherever it acts."""
    numbers = {name: estimate_text(estimate) for name, estimate in effect.parameters.items()}
    sentence = SENTENCES.get(effect.family, "")
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
    known = FAMILIES[family].noun if family in FAMILIES else ""
    return known or family.replace("_", " ")


def estimate_text(estimate: Estimate) -> str:
    """Four digits and the unit, none behind a plain ratio."""
    return f"{estimate.value:.4g} {estimate.unit}".removesuffix(" 1")
