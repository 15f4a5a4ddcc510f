"""Drawing whole machines: a class, its effects, one to three recordings, and sensors and nuisances as of rough worlds.

What a machine of each class has that its bare simulator lacks, in sizes that are known of real ones:

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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gpsim.trials.drawing import digits, noise_of
from gpsim.trials.driving import CLOSED_LOOP, FREE, REFERENCES
from gpsim.trials.rough import calibrated, nuisances, rough_log, shares_of
from gpsim.trials.shares import Shares
from gpsim.trials.worlds import (
    FROM,
    SYSTEMS,
    Machine,
    Session,
    TrueEffect,
    Values,
    World,
    log_even,
    numbered,
    rounded,
)

Rng = np.random.Generator
STEPS = {"axis": (0.005, 0.01, 0.02), "rig": (0.01, 0.02), "servo": (0.01, 0.02), "car": (0.05, 0.1)}
"""s between samples."""
TRANSITIONS, LENGTH = (2500, 6000), (6.0, 20.0)  # in all; s of an episode
POSITIONS_ONLY = 0.5  # of the machines that have velocities
SEVERAL = 1 / 3  # of the machines, that have two or three recordings
DIFFERS = 0.4  # of those, in which a payload or a friction is another one
LEVELS = {"light": 0.5, "normal": 0.5}  # of noise: laboratory's sensors
NUISANCES, LARGEST = (1, 2, 3), 0.03  # how many, and the share of the mismatch of the largest
WITH_NUISANCES = 8  # attempts; a pole that hardly stands may fall with any, and then goes without
LARGE, SEEN = 0.05, 0.01  # of the mismatch, that an effect makes which is large, and which counts
BEYOND = 1.0  # standard deviations of the noise, by which one counts, too
FEWEST_LARGE, FEWEST_SEEN = 2, 4
DRIVEN = {
    "axis": REFERENCES,
    "rig": (*CLOSED_LOOP, "trapezoid", "multisine"),
    "servo": (*REFERENCES, "sines"),
    "car": ("tracking", "sweep", "sines", "controller"),
}
"""How a machine may be driven when it has one recording."""
BESIDES = {"axis": (), "rig": (FREE,), "servo": (FREE,), "car": ()}
"""And how in its other recordings, too."""
CHANGING = ("coulomb_friction", "viscous_friction", "parameter_offset")
"""Families of which one may be another in another recording: friction warms up, payloads are changed."""
SENSING = ("sensor_bias",)
"""Families that are another in every recording: zeros are set anew when a sensor is switched on."""


@dataclass(frozen=True)
class Sizes:
    """Draws sizes. p: the base simulator's parameters; dt: s."""

    rng: Rng
    p: Values
    dt: float

    def size(self, low: float, high: float) -> float:
        """Evenly in the logarithm."""
        return rounded(log_even(self.rng, low, high))

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


Draw = Callable[[Sizes], Values]


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
    def drawn(s: Sizes) -> Values:
        sliding = scale(s) * s.size(low, high)
        static = rounded(sliding * s.rng.uniform(1.3, 1.9))
        slow = rounded(speed * s.size(0.03, 0.15))
        return {"force": rounded(sliding), "static_force": static, "stribeck_velocity": slow}

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
    return (s.p["cart_mass"] + s.p["pole_mass"]) * 9.81 * s.signed(0.005, 0.026)


def _loaded(s: Sizes) -> float:
    return s.factor(1.1, 1.6) if s.rng.random() < 0.75 else s.factor(0.65, 0.9)


PARTS: Mapping[str, tuple[str, tuple[Part, ...]]] = {
    "axis": ("slider", (
        Part("parameter_offset", "mass", 0.6, _one("ratio", _loaded), "scale"),
        Part("actuator_gain", "force", 1.0, _one("gain", lambda s: s.factor(0.7, 1.3)), "scale"),
        Part("stribeck_friction", "q", 0.25, _stribeck(0.15, 0.5, _drive, 0.3), "dry"),
        Part("coulomb_friction", "q", 1.0, _one("force", lambda s: _drive(s) * s.size(0.15, 0.6)), "dry"),
        Part("viscous_friction", "q", 1.0, _one("damping", lambda s: _drive(s) / 0.3 * s.size(0.15, 0.6))),
        Part("constant_force", "q", 0.6, _one("force", lambda s: _drive(s) * s.signed(0.03, 0.2)), "push"),
        Part("actuator_bias", "force", 0.5, _one("bias", lambda s: _drive(s) * s.signed(0.03, 0.2)), "push"),
        Part("actuator_delay", "force", 0.7, _one("delay", lambda s: s.late(1.0, 2.0))),
        Part("actuator_lag", "force", 0.45, _one("time_constant", lambda s: s.size(0.005, 0.02))),
        Part("actuator_dead_zone", "force", 0.2, _one("width", lambda s: _drive(s) * s.size(0.05, 0.15)), "gap"),
        Part("actuator_backlash", "force", 0.2, _one("half_width", lambda s: _drive(s) * s.size(0.04, 0.12)), "gap"),
    )),
    "rig": ("cartpole", (
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
    )),
    "servo": ("pendulum", (
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
        Part("actuator_saturation", "torque", 0.25, _one("limit", lambda s: _weight(s) * s.size(0.5, 0.8))),
    )),
    "car": ("unicycle", (
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
            "marker_offset", "pose", 0.5,
            lambda s: {"forward": rounded(s.signed(0.03, 0.15)), "left": rounded(s.signed(0.005, 0.03))},
        ),
    )),
}  # fmt: skip
"""Class -> the system that is believed, and what a machine has besides. The first of a group that is drawn excludes
the others: of a mass and a gain, say, a log of commands and positions shows the ratio alone."""
FEWEST, MOST = 4, 8  # effects of a machine
ARM = "arm"
KINDS = (*PARTS, ARM)
"""Classes in turn; an arm needs MuJoCo, and is drawn by `robots`."""


def kind_of(number: int) -> str:
    """The class of a machine."""
    return KINDS[(numbered(number)[1] - 1) % len(KINDS)]


def draw_machine(seed: int, number: int, attempt: int = 0) -> World | None:
    """The world of a machine; None where the attempt gave none with as many effects that count."""
    rng = np.random.default_rng([seed, number, attempt, 0])
    kind = kind_of(number)
    system = SYSTEMS[PARTS[kind][0]]
    turn = np.random.default_rng([seed, number, FROM["machines"]])  # the same in every attempt
    several, positions_only = turn.random() < SEVERAL, turn.random() < POSITIONS_ONLY
    upright = kind == "rig" and turn.random() < 0.5
    dt = float(rng.choice(STEPS[kind]))
    parameters = {n: digits(rng.uniform(*r)) for n, r in system.parameters.items()}
    effects = parts_of(kind, Sizes(rng, parameters, dt))
    sessions = _sessions(kind, dt, effects, several, upright, rng)
    level = str(rng.choice(list(LEVELS), p=list(LEVELS.values())))
    first = sessions[0]
    world = World(
        seed=seed, number=number, attempt=attempt, stratum="machines", system=system.name, parameters=parameters,
        dt=dt, effects=effects, episodes=first.episodes, steps=first.steps, clock="session",
        excitation=first.excitation, posture=first.posture, noise_level=level,
        noise=noise_of(system, level, rng), noise_known=bool(rng.random() < 0.3),
        velocities=None if system.vehicle else "differentiated" if positions_only else "measured",
        smoothing=str(rng.choice(["central", "savgol"])), wrapped=bool(rng.random() < 0.5),
    )  # fmt: skip
    bare = positions_only and not system.vehicle and bool(rng.random() < 0.5)
    world = replace(world, machine=Machine(kind, bare, sessions))
    log = rough_log(world, world.effects, rng)
    if not system.vehicle:  # only a car is seen by a camera, which swaps markers
        log = replace(log, swapped=0.0, leap={})
    world = replace(world, rough=log)
    if not counts(shares_of(world), world.effects):
        return None
    fewest = NUISANCES[0] if attempt < WITH_NUISANCES else 0
    return calibrated(world, nuisances(seed, world, NUISANCES, LARGEST, rng), fewest)


def counts(shares: Shares | None, effects: Sequence[TrueEffect]) -> bool:
    """Whether as many effects make a share of the mismatch that counts, and as many a large one."""
    if shares is None or not shares.counts.any():
        return False
    own = [e for e in effects if not e.out_of_catalogue]
    made = np.array([shares.of(e) for e in own])
    seen = (made >= SEEN) | (np.array([shares.beyond(e) for e in own]) >= BEYOND)
    return bool(seen.sum() >= FEWEST_SEEN and (made >= LARGE).sum() >= FEWEST_LARGE)


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


def _sessions(
    kind: str, dt: float, effects: tuple[TrueEffect, ...], several: bool, upright: bool, rng: Rng
) -> tuple[Session, ...]:
    """One recording, or two or three, each driven in another way if there is one."""
    count = int(rng.integers(2, 4)) if several else 1
    # Who balances does it by the controller that is there for it.
    ways = [str(rng.choice([*CLOSED_LOOP] if upright else [*DRIVEN[kind]]))]
    while len(ways) < count:
        others = [w for w in (*DRIVEN[kind], *BESIDES[kind]) if w not in ways]
        ways.append(str(rng.choice(others)))
    changed = None
    if several and rng.random() < DIFFERS:
        names = [e.name for e in effects if e.family in CHANGING]
        changed = str(rng.choice(names)) if names else None
    free = {"axis": "q", "rig": "x"}.get(kind)  # a position on whose zero nothing depends
    out = []
    for i, way in enumerate(ways):
        steps = int(rng.uniform(*LENGTH) / dt)
        wanted = log_even(rng, *TRANSITIONS)
        balances = upright and way in CLOSED_LOOP
        posture = ("upright" if balances else "hanging") if kind == "rig" else ""
        changes = _changes(effects, changed, rng) if i else {}
        clock = round(float(rng.uniform(0.0, 500.0)), 3) if several else 0.0
        zeros = {free: digits(rng.uniform(-0.2, 0.2))} if several and free else {}
        episodes = max(round(wanted / steps), 5)
        out.append(Session(way, posture, episodes, max(int(wanted / episodes), 60), clock, zeros, changes))
    return tuple(out)


def _changes(effects: tuple[TrueEffect, ...], changed: str | None, rng: Rng) -> dict[str, Values]:
    """What differs in another recording than the first."""
    out: dict[str, Values] = {}
    for e in effects:
        if e.name == changed:
            factor = float(rng.uniform(1.15, 1.4) if rng.random() < 0.5 else rng.uniform(0.7, 0.87))
            out[e.name] = {k: rounded(v * factor) for k, v in e.values.items()}
        elif e.family in SENSING:
            out[e.name] = {k: rounded(v + rng.uniform(-0.04, 0.04)) for k, v in e.values.items()}
    return out
