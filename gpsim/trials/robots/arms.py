"""Arms of four and of six joints as whole machines: friction of several joints, a payload, armature, a late command.

Sizes are those of robots' other worlds (`strengths`), from the upper half of their dials: friction of 15 to 50 % of the
torque that moves a joint, as drives with harmonic or cycloidal gears have it (Bittencourt and Gunnarsson 2012).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.trials.robots.draws import STRENGTHS, RobotScales, bare_world, places_of
from gpsim.trials.robots.models import ROBOTS, layout_of
from gpsim.trials.robots.running import run
from gpsim.trials.worlds import Dial, Machine, Session, TrueEffect, World

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
    world = bare_world(seed, number, attempt, "machines", robot, places, rng)
    only = Session(world.excitation, world.posture, world.episodes, world.steps)
    world = replace(world, machine=Machine("arm", world.velocities is None, (only,)))
    scales = RobotScales(world, run(world, ())[0])
    made = tuple(
        TrueEffect(family, on, STRENGTHS[family](scales, on, Dial(rng, float(rng.uniform(*PLAIN)))))
        for family, on in places
    )
    return replace(world, effects=made)


def arms_places(name: str, rng: np.random.Generator) -> list[tuple[str, str]]:
    """Families and what they act on, four to seven."""
    joints = layout_of(name).joints
    dry, viscous = (
        rng.choice(joints, rng.integers(low, high + 1), replace=False) for low, high in (DRY, VISCOUS)
    )
    out = [("coulomb_friction", str(j)) for j in dry] + [("viscous_friction", str(j)) for j in viscous]
    others = ["payload", *(family for family, chance in SOMETIMES.items() if rng.random() < chance)]
    return out + [(family, str(rng.choice(places_of(family, ROBOTS[name])))) for family in others]
