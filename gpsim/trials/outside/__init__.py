"""Physics outside the catalogue: kinds that no family of `gpsim.effects` described when they were written.

A kind that has become a word since says so (`family`): who names it is right.

A kind is one class: its docstring says the law, its methods are the law, `strength` draws its parameters, `since` is
the first seed whose worlds may hold it (None: those of every seed may). Files go by the site where kinds act. A new
kind is one class; `since` must be a seed of which no world has been drawn yet, or published proofs could not be
repeated. Twenty kinds a measurement: ten for every seed, ten that are new to it.

Random laws of one input (CURVES) are drawn for worlds of their own, which prove measured curves.

Laws here are never shared with `gpsim.effects`.
"""

from gpsim.trials.outside.kind import (
    Actuator,
    CoupledForce,
    Distortion,
    Force,
    HiddenForce,
    HiddenTwist,
    Inertia,
    SensorWithMemory,
    Twist,
)
from gpsim.trials.outside.registry import CURVES, EVERY_KIND, KINDS, at_site, drawn, nuisances

__all__ = [
    "CURVES",
    "EVERY_KIND",
    "KINDS",
    "Actuator",
    "CoupledForce",
    "Distortion",
    "Force",
    "HiddenForce",
    "HiddenTwist",
    "Inertia",
    "SensorWithMemory",
    "Twist",
    "at_site",
    "drawn",
    "nuisances",
]
