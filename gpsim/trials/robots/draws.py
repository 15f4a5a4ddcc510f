"""Drawing robots with one or two effects, and arms as machines: which world a number is, and how strong effects are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue
from gpsim.trials.bodies import mujoco
from gpsim.trials.catalogue import Draw
from gpsim.trials.drawing import combined, digits
from gpsim.trials.robots.driving import SIGNALS, run
from gpsim.trials.robots.models import ROBOTS, Robot, layout_of, spec_of
from gpsim.trials.worlds import (
    FROM,
    Dial,
    Machine,
    Scales,
    Session,
    Stratum,
    TrueEffect,
    World,
    log_even,
    numbered,
    rounded,
)

Rng = np.random.Generator
DECK: tuple[Stratum, ...] = (
    "single", "none", "pair", "single", "single", "pair", "none", "single", "single", "pair", "none", "single",
)  # fmt: skip
SIZE = {"single": 1, "pair": 2, "none": 0}
POSITIONS, SPEEDS = (5e-4, 1e-3), (4e-3, 1.2e-2)  # noise, rad and rad/s (m and m/s)
TRANSITIONS, LENGTH = (2200, 6000), (160, 400)
GRADED = {"actuator_dead_zone", "actuator_saturation", "actuator_backlash", "actuator_asymmetry"}
"""Families that need commands of many values."""
UNSTABLE = {"actuator_delay", "actuator_lag", "actuator_dead_zone", "actuator_backlash"}
"""Families that let a pole fall: where a robot can hang, it does."""
ALIKE: tuple[frozenset[str], ...] = (
    frozenset({"coulomb_friction", "stribeck_friction"}),
    frozenset({
        "actuator_gain", "actuator_asymmetry", "parameter_offset", "actuator_saturation", "actuator_dead_zone"
    }),
    frozenset({"constant_force", "actuator_bias", "sensor_bias", "joint_offset", "spring", "gravity_tilt"}),
    frozenset({"actuator_delay", "actuator_lag", "sensor_delay"}),
    frozenset({"parameter_offset", "payload", "armature"}),
    frozenset({"actuator_dead_zone", "actuator_backlash"}),
)  # fmt: skip
"""Two of a group do the same thing to a robot with other numbers: they never share a world, whatever they act on."""


@dataclass(frozen=True)
class RobotScales(Scales):
    """How large things are in a run of the robot as it is believed."""

    @cached_property
    def model(self) -> Any:
        """The model as published."""
        return spec_of(self.world.system).compile()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """State channels in column order."""
        return layout_of(self.world.system).names

    @cached_property
    def actions(self) -> tuple[str, ...]:
        """Commands in column order."""
        return tuple(layout_of(self.world.system).action)

    def force(self, coordinate: str) -> float:
        """Root mean square of the force that would move the joint alone as it moved."""
        speeds = self.pilot.fine[:: self.pilot.per_sample, :, self.names.index(coordinate) + 1]
        acceleration = np.diff(speeds, axis=0) / self.world.dt
        return self.inertia(coordinate) * float(np.sqrt(np.mean(acceleration**2)))

    def inertia(self, coordinate: str) -> float:
        """What a force on a joint alone has to move, the others free, where the robot began."""
        model, mj = self.model, mujoco()
        data, c = mj.MjData(model), layout_of(self.world.system).joints.index(coordinate)
        data.qpos[:] = self.pilot.fine[0, 0, 0::2]
        mj.mj_forward(model, data)
        pushed, column = np.eye(model.nv)[c : c + 1], np.zeros((1, model.nv))
        mj.mj_solveM(model, data, column, pushed)
        return float(1.0 / column[0, c])


def _payload(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """A twentieth to half of what carries it, within its reach of the carrier's centre of mass."""
    assert isinstance(s, RobotScales)
    b = s.model.body(on).id
    mass, centre = float(s.model.body_mass[b]), np.asarray(s.model.body_ipos[b])
    size = float(np.sqrt(s.model.body_inertia[b].max() / mass))
    at: FloatArray = centre + size * np.array([d.any(-0.7, 0.7) for _ in range(3)])
    places = {a: rounded(float(x)) for a, x in zip("xyz", at, strict=True)}
    return {"mass": rounded(d.size(0.08, 0.6) * mass), **places}


def _zero(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {"offset": rounded(d.sign() * d.size(0.02, 0.12))}


def _in_fine_steps(draw: Draw) -> Draw:
    """A delay is a whole number of the truth's steps."""

    def drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
        h = s.pilot.h
        return {k: round(max(round(v / h), 1) * h, 9) for k, v in draw(s, on, d).items()}

    return drawn


AS_EVERYWHERE = (
    "coulomb_friction", "viscous_friction", "quadratic_drag", "stribeck_friction", "spring", "constant_force",
    "actuator_gain", "actuator_bias", "actuator_dead_zone", "actuator_saturation", "actuator_asymmetry", "actuator_lag",
    "actuator_backlash",
)  # fmt: skip
STRENGTHS: Mapping[str, Draw] = {
    **{family: catalogue.STRENGTHS[family] for family in AS_EVERYWHERE},
    "actuator_delay": _in_fine_steps(catalogue.STRENGTHS["actuator_delay"]),
    "sensor_delay": _in_fine_steps(catalogue.STRENGTHS["sensor_delay"]),
    "sensor_bias": _zero,
    "joint_offset": _zero,
    "payload": _payload,
    "armature": lambda s, on, d: {"inertia": rounded(d.size(0.08, 0.8) * s.inertia(on))},
    "gravity_tilt": lambda s, on, d: {
        axis: rounded(d.sign() * d.size(0.02, 0.15) * d.any(0.7, 1.3)) for axis in ("roll", "pitch")
    },
    "parameter_offset": lambda s, on, d: {
        "ratio": d.ratio(0.08, 0.4) if on.endswith(".mass") else d.ratio(0.05, 0.35)
    },
}
"""Every family that robots are given."""


def stratum_of(rank: int) -> tuple[Stratum, int]:
    """Stratum of a robot's world, and its rank among those of its stratum."""
    deck, place = divmod(rank - 1, len(DECK))
    stratum = DECK[place]
    return stratum, deck * DECK.count(stratum) + DECK[:place].count(stratum)


def draw_robot(seed: int, number: int, attempt: int = 0) -> World:
    """The world of a trial; `attempt` counts worlds that could not be run, or in which an effect did not show."""
    world, effects, rng = planned(seed, number, attempt)
    scales = RobotScales(world, run(world, ()))
    # What did not show is drawn stronger.
    dials = [Dial(rng, float(rng.uniform(min(0.15 * attempt, 0.6), 1.0))) for _ in effects]
    made = tuple(
        TrueEffect(name, on, STRENGTHS[name](scales, on, dial), strength=dial.level)
        for (name, on), dial in zip(effects, dials, strict=True)
    )
    return replace(world, effects=made)


def planned(seed: int, number: int, attempt: int = 0) -> tuple[World, list[tuple[str, str]], Rng]:
    """A trial's world without its effects, their families and places, and what their strengths are drawn with."""
    stratum, among = stratum_of(numbered(number)[1])
    turn = np.random.default_rng([seed, FROM["robots"], SIZE[stratum], among // len(STRENGTHS)])
    family = None if stratum == "none" else str(turn.permutation(sorted(STRENGTHS))[among % len(STRENGTHS)])
    able = [r for r in ROBOTS.values() if family is None or places_of(family, r)]
    # The number's alone, so that a world that cannot be run leaves no robot less often.
    robot = able[int(np.random.default_rng([seed, number, 5]).integers(len(able)))]
    if family is None:
        robot = able[(seed + among) % len(able)]
    rng = np.random.default_rng([seed, number, attempt, 0])
    effects = combined(family, SIZE[stratum], sorted(STRENGTHS), ALIKE, lambda f: places_of(f, robot), rng)
    return _bare_world(seed, number, attempt, stratum, robot, effects, rng), effects, rng


def places_of(family: str, robot: Robot) -> list[str]:
    """What a family can act on in a robot, so that a recording can show it."""
    layout = layout_of(robot.name)
    servoed = [layout.driven[a] for a in layout.servos]
    found: dict[str, tuple[str, ...] | list[str]] = {
        "payload": robot.carriers,
        "armature": layout.joints,
        "gravity_tilt": ("gravity",) if robot.tilts else (),
        "joint_offset": robot.zeros,
        # Of a joint without a servo it is an encoder's zero.
        "sensor_bias": [j for j in robot.zeros if j in servoed] or servoed,
        "sensor_delay": layout.joints,
        "parameter_offset": [
            *(f"{body}.mass" for body in robot.masses),
            *(f"{servo}.{gain}" for servo in layout.servos for gain in ("kp", "kv")),
        ],
    }
    return list(found.get(family, layout.action if family in catalogue.ACTUATORS else layout.joints))


def _bare_world(
    seed: int, number: int, attempt: int, stratum: Stratum, robot: Robot, effects: list[tuple[str, str]], rng: Rng
) -> World:  # fmt: skip
    """Everything but the effects' strengths."""
    layout, families = layout_of(robot.name), {f for f, _ in effects}
    wanted = log_even(rng, *TRANSITIONS)
    steps = int(rng.uniform(*LENGTH))
    way = str(rng.choice(robot.ways))
    if len(robot.ways) > 1 and (attempt > 1 or families & UNSTABLE):
        way = next(w for w in robot.ways if w != "balance")
    signals = ["sines"] if families & GRADED else list(SIGNALS)
    sizes = {name: POSITIONS if name in layout.joints else SPEEDS for name in layout.names}
    noise = {name: digits(rng.uniform(*size)) for name, size in sizes.items()}
    return World(
        seed=seed, number=number, attempt=attempt, stratum=stratum, system=robot.name, integrator="kutta3",
        dt=float(rng.choice(robot.steps)), engine="mujoco", episodes=max(int(np.ceil(wanted / steps)), 6),
        steps=steps, excitation=str(rng.choice(signals)), posture=way, noise=noise,
        noise_known=bool(rng.random() < 0.5), velocities="measured" if rng.random() < 0.5 else None,
    )  # fmt: skip


# Arms as whole machines: friction of several joints, a payload, armature, a late command. Sizes are from the upper half
# of the dials: friction of 15 to 50 % of the torque that moves a joint, as drives with harmonic or cycloidal gears have
# it (Bittencourt and Gunnarsson 2012).
ARMS = ("arm", "ur5")
DRY, VISCOUS = (2, 3), (1, 2)  # on how many joints
SOMETIMES = {"armature": 0.5, "actuator_delay": 0.7}  # how often each besides
PLAIN = (0.5, 1.0)  # of the dial


def draw_arm(seed: int, number: int, attempt: int = 0) -> World:
    """The world of an arm; `attempt` counts worlds that could not be run, or of which too little shows."""
    turn = np.random.default_rng([seed, number, 5])  # the same in every attempt
    robot = ROBOTS[str(turn.choice(ARMS))]
    rng = np.random.default_rng([seed, number, attempt, 0])
    places = arms_places(robot.name, rng)
    world = _bare_world(seed, number, attempt, "machines", robot, places, rng)
    only = Session(world.excitation, world.posture, world.episodes, world.steps)
    world = replace(world, machine=Machine("arm", world.velocities is None, (only,)))
    scales = RobotScales(world, run(world, ()))
    made = tuple(
        TrueEffect(family, on, STRENGTHS[family](scales, on, Dial(rng, float(rng.uniform(*PLAIN)))))
        for family, on in places
    )
    return replace(world, effects=made)


def arms_places(name: str, rng: Rng) -> list[tuple[str, str]]:
    """Families and what they act on, four to seven."""
    joints = layout_of(name).joints
    dry, viscous = (
        rng.choice(joints, rng.integers(low, high + 1), replace=False) for low, high in (DRY, VISCOUS)
    )
    out = [("coulomb_friction", str(j)) for j in dry] + [("viscous_friction", str(j)) for j in viscous]
    others = ["payload", *(family for family, chance in SOMETIMES.items() if rng.random() < chance)]
    return out + [(family, str(rng.choice(places_of(family, ROBOTS[name])))) for family in others]
