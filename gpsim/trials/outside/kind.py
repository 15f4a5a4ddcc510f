"""What a kind of physics outside the catalogue is, and a generation: ten that run for the first time together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from gpsim.channels import FloatArray
from gpsim.trials.catalogue.actuators import Actuator
from gpsim.trials.outside.hidden import Hidden, HiddenTwist, Values

Force = Callable[[Values, FloatArray, FloatArray, FloatArray], FloatArray]
"""f(values, q, v, wall time) -> (B,) on its own coordinate."""
Inertia = Callable[[Values, FloatArray], tuple[FloatArray, FloatArray]]
"""f(values, q) -> (B,) by how much its coordinate's inertia differs from the base's, and (B,) that one's slope in q."""
Coupled = Callable[[Values, FloatArray], FloatArray]
"""f(values, state) -> (B, C) on all coordinates."""
Twist = Callable[[Values, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""f(values, v, w, state) -> (v, w)."""
Bent = Callable[[Values, FloatArray], FloatArray]
"""f(values, y) -> what is read; (E,) of a channel, (E, 2) of a pose's place."""
Recalled = Callable[[Values, FloatArray, float], FloatArray]
"""f(values, past, h) -> (E,) what is read of a channel; past: (K, E) all its true values every h s, the last is now."""

MECHANICAL = ("cartpole", "slider", "pendulum")
EVERY = (*MECHANICAL, "unicycle")
VEHICLE = ("unicycle",)


@dataclass(frozen=True)
class Kind:
    """One kind: where it acts and on which systems. places: what it acts on where the site does not say it."""

    site: Literal["force", "hidden", "coupled", "inertia", "actuator", "twist", "sensor"]
    systems: tuple[str, ...]
    text: str
    places: tuple[str, ...] = ()


@dataclass(frozen=True)
class Generation:
    """Kinds that the same seeds draw, and their laws. since: the first of these seeds, until a newer one's first."""

    since: int
    kinds: Mapping[str, Kind]
    forces: Mapping[str, Force] = field(default_factory=dict)
    hidden: Mapping[str, Hidden] = field(default_factory=dict)
    inertia: Mapping[str, Inertia] = field(default_factory=dict)
    coupled: Mapping[str, Coupled] = field(default_factory=dict)
    actuators: Mapping[str, Callable[[Values], Actuator]] = field(default_factory=dict)
    twist: Mapping[str, Twist] = field(default_factory=dict)
    hidden_twist: Mapping[str, HiddenTwist] = field(default_factory=dict)
    bent: Mapping[str, Bent] = field(default_factory=dict)
    recalled: Mapping[str, Recalled] = field(default_factory=dict)
