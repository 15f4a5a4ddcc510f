"""What a machine of each class has that its bare simulator lacks, in sizes that are known of real ones.

Sources of the sizes:

- axis: the EMPS benchmark (Janot, Gautier and Brunot 2019), a ball-screw slide of 95.1 kg: 20.4 N of Coulomb friction,
  203.5 N s/m of viscous, -3.2 N of offset, at 0.1 to 0.3 m/s and about 1 m/s^2; that is 20, 50 and 3 % of the force
  that accelerates it. Stribeck velocities and static friction: Armstrong-Helouvry, Dupont and Canudas de Wit (1994).
- rig: Quanser's IP02 cart (0.57 kg): 5.4 N s/m, and 0.0024 N m s/rad in the pivot of a pole of 0.23 kg and 0.33 m half
  length; a gear motor with some tenths of a volt of dead zone.
- servo: the torque-limited pendulum of DFKI (Wiebe et al. 2022): 0.573 kg, 0.5 m, 0.1 N m s/rad, 0.093 N m, 2.0 N m at
  the most; that is 4 % of the weight's torque a rad/s, and 3 % of it.
- car: AgileX's Limo, of which the turning radius is 0.46 m at the least; delays and lags of small cars with a speed
  controller are 50 to 400 ms (Lyons et al. 2024, the DART car).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gpsim.trials.worlds import TrueEffect, rounded

GRAVITY = 9.81


@dataclass(frozen=True)
class Sizes:
    """Draws sizes. p: the base simulator's parameters; dt: s."""

    rng: np.random.Generator
    p: Mapping[str, float]
    dt: float

    def size(self, low: float, high: float) -> float:
        """Evenly in the logarithm."""
        return rounded(float(np.exp(self.rng.uniform(np.log(low), np.log(high)))))

    def signed(self, low: float, high: float) -> float:
        """The same to either side."""
        return self.size(low, high) * (1.0 if self.rng.random() < 0.5 else -1.0)

    def factor(self, low: float, high: float) -> float:
        """A factor between, at least 5 % off."""
        found = float(self.rng.uniform(low, high))
        return rounded(found if abs(found - 1.0) > 0.05 else 1.0 + np.copysign(0.05, found - 1.0))

    def late(self, low: float, high: float) -> float:
        """A delay of so many samples, in whole milliseconds."""
        return max(round(float(self.rng.uniform(low, high)) * self.dt, 3), 0.001)


Draw = Callable[[Sizes], Mapping[str, float]]


class Part(NamedTuple):
    """One effect that a class of machines may have: how often, and which others it excludes by a common `group`."""

    family: str
    on: str
    chance: float
    draw: Draw
    group: str = ""


def _one(name: str, draw: Callable[[Sizes], float]) -> Draw:
    return lambda s: {name: rounded(draw(s))}


def _stribeck(low: float, high: float, scale: Callable[[Sizes], float], speed: float) -> Draw:
    def drawn(s: Sizes) -> Mapping[str, float]:
        sliding = scale(s) * s.size(low, high)
        return {
            "force": rounded(sliding),
            "static_force": rounded(sliding * s.rng.uniform(1.3, 1.9)),
            "stribeck_velocity": rounded(speed * s.size(0.03, 0.15)),
        }

    return drawn


def _drive(s: Sizes) -> float:
    """N: what accelerates an axis of the nominal mass as its references do."""
    return 1.2 * s.p["mass"]


def _weight(s: Sizes) -> float:
    """N m: a pendulum's weight held level."""
    return s.p["mass"] * s.p["gravity"] * s.p["length"]


def _pivot(s: Sizes) -> float:
    """N m s/rad that lets a free pole's swing fall to a third within 3 to 15 s."""
    inertia = 4.0 / 3.0 * s.p["pole_mass"] * s.p["pole_half_length"] ** 2
    return 2.0 * inertia / s.size(3.0, 15.0)


def _tilt(s: Sizes) -> float:
    """N: a track that is 0.3 to 1.5 degrees off level."""
    return (s.p["cart_mass"] + s.p["pole_mass"]) * GRAVITY * s.signed(0.005, 0.026)


AXIS = (
    Part(
        "parameter_offset",
        "mass",
        0.6,
        _one("ratio", lambda s: s.factor(1.1, 1.6) if s.rng.random() < 0.75 else s.factor(0.65, 0.9)),
        "scale",
    ),
    Part("actuator_gain", "force", 1.0, _one("gain", lambda s: s.factor(0.7, 1.3)), "scale"),
    Part("stribeck_friction", "q", 0.25, _stribeck(0.15, 0.5, _drive, 0.3), "dry"),
    Part("coulomb_friction", "q", 1.0, _one("force", lambda s: _drive(s) * s.size(0.15, 0.6)), "dry"),
    Part("viscous_friction", "q", 1.0, _one("damping", lambda s: _drive(s) / 0.3 * s.size(0.15, 0.6))),
    Part("constant_force", "q", 0.6, _one("force", lambda s: _drive(s) * s.signed(0.03, 0.2)), "push"),
    Part("actuator_bias", "force", 0.5, _one("bias", lambda s: _drive(s) * s.signed(0.03, 0.2)), "push"),
    Part("actuator_delay", "force", 0.7, _one("delay", lambda s: s.late(1.0, 2.0))),
    Part("actuator_lag", "force", 0.45, _one("time_constant", lambda s: s.size(0.005, 0.02))),
    Part("actuator_dead_zone", "force", 0.2, _one("width", lambda s: _drive(s) * s.size(0.05, 0.15)), "gap"),
    Part(
        "actuator_backlash",
        "force",
        0.2,
        _one("half_width", lambda s: _drive(s) * s.size(0.04, 0.12)),
        "gap",
    ),
)
RIG = (
    Part("actuator_gain", "force", 0.6, _one("gain", lambda s: s.factor(0.75, 1.25)), "scale"),
    Part("parameter_offset", "cart_mass", 1.0, _one("ratio", lambda s: s.factor(0.8, 1.5)), "scale"),
    Part("parameter_offset", "pole_half_length", 0.35, _one("ratio", lambda s: s.factor(0.88, 1.12))),
    Part("coulomb_friction", "x", 1.0, _one("force", lambda s: s.size(0.3, 1.5))),
    Part("viscous_friction", "x", 1.0, _one("damping", lambda s: s.size(0.6, 5.0))),
    Part("viscous_friction", "theta", 0.8, _one("damping", _pivot)),
    Part("actuator_dead_zone", "force", 0.35, _one("width", lambda s: s.size(0.2, 0.6))),
    Part("actuator_delay", "force", 0.65, _one("delay", lambda s: s.late(1.0, 2.0))),
    Part("actuator_lag", "force", 0.3, _one("time_constant", lambda s: s.size(0.008, 0.03))),
    Part("sensor_bias", "theta", 0.5, _one("offset", lambda s: s.signed(0.01, 0.05))),
    Part("constant_force", "x", 0.45, _one("force", _tilt)),
)
SERVO = (
    Part("actuator_gain", "torque", 0.55, _one("gain", lambda s: s.factor(0.75, 1.25)), "scale"),
    Part("parameter_offset", "mass", 1.0, _one("ratio", lambda s: s.factor(1.1, 1.6)), "scale"),
    Part("parameter_offset", "length", 0.35, _one("ratio", lambda s: s.factor(0.88, 1.15))),
    Part("stribeck_friction", "theta", 0.2, _stribeck(0.03, 0.15, _weight, 2.0), "dry"),
    Part("coulomb_friction", "theta", 1.0, _one("force", lambda s: _weight(s) * s.size(0.03, 0.2)), "dry"),
    Part("viscous_friction", "theta", 1.0, _one("damping", lambda s: _weight(s) * s.size(0.02, 0.08))),
    Part("sensor_bias", "theta", 0.55, _one("offset", lambda s: s.signed(0.01, 0.08))),
    Part("actuator_bias", "torque", 0.25, _one("bias", lambda s: _weight(s) * s.signed(0.02, 0.1))),
    Part("actuator_delay", "torque", 0.6, _one("delay", lambda s: s.late(1.0, 2.0))),
    Part("actuator_lag", "torque", 0.4, _one("time_constant", lambda s: s.size(0.005, 0.03))),
    Part(
        "actuator_saturation",
        "torque",
        0.25,
        _one("limit", lambda s: _weight(s) * s.size(0.5, 0.8)),
    ),
)
CAR = (
    Part("actuator_gain", "v_cmd", 0.75, _one("gain", lambda s: s.factor(0.8, 1.12))),
    Part("actuator_gain", "w_cmd", 0.65, _one("gain", lambda s: s.factor(0.75, 1.2))),
    Part("actuator_lag", "v_cmd", 1.0, _one("time_constant", lambda s: s.size(0.1, 0.4))),
    Part("actuator_delay", "v_cmd", 0.6, _one("delay", lambda s: round(s.size(0.05, 0.15), 3))),
    Part("actuator_lag", "w_cmd", 0.5, _one("time_constant", lambda s: s.size(0.06, 0.25))),
    Part("actuator_delay", "w_cmd", 0.5, _one("delay", lambda s: round(s.size(0.05, 0.15), 3))),
    Part("steering_bias", "vehicle", 0.6, _one("curvature", lambda s: s.signed(0.03, 0.25))),
    Part("understeer", "vehicle", 0.4, _one("gradient", lambda s: s.size(0.1, 0.8))),
    Part("cornering_drag", "vehicle", 0.3, _one("drag", lambda s: s.size(0.03, 0.3))),
    Part("minimum_turning_radius", "vehicle", 0.3, _one("radius", lambda s: s.size(0.35, 0.7))),
    Part(
        "marker_offset",
        "pose",
        0.5,
        lambda s: {"forward": rounded(s.signed(0.03, 0.15)), "left": rounded(s.signed(0.005, 0.03))},
    ),
)
PARTS: Mapping[str, tuple[str, tuple[Part, ...]]] = {
    "axis": ("slider", AXIS),
    "rig": ("cartpole", RIG),
    "servo": ("pendulum", SERVO),
    "car": ("unicycle", CAR),
}
"""Class -> the system that is believed, and what a machine has besides. The first of a group that is drawn excludes
the others: of a mass and a gain, say, a log of commands and positions shows the ratio alone."""
FEWEST, MOST = 4, 8


def parts_of(kind: str, s: Sizes) -> tuple[TrueEffect, ...]:
    """The effects of one machine, four to eight of them."""
    while True:
        chosen: list[Part] = []
        for part in PARTS[kind][1]:
            taken = {other.group for other in chosen if other.group}
            if part.group not in taken and s.rng.random() < part.chance:
                chosen.append(part)
        if FEWEST <= len(chosen) <= MOST:
            return tuple(TrueEffect(part.family, part.on, part.draw(s)) for part in chosen)
