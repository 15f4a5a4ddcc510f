"""Whole robots: friction, rotors, loads, offsets and late commands at once, as a robot's identification finds them.

Sizes go by the torque T and the speed at most of each joint's drive:

- dry friction of 1 to 6 % of T: Franka's Panda has 0.3 to 1.3 N m below its 87 N m and 1 to 3.5 % at its wrists (Gaz et
  al. 2019), the URDF files of Unitree's Z1 and UFACTORY's xArm7 have 2 to 5 %;
- viscous friction of 2 to 12 % of T at full speed: 10 % in the Z1's file, 60 % in the xArm7's;
- a rotor behind its gears that T spins up at 60 to 600 rad/s^2: Franka says 0.61, 0.46 and 0.21 kg m^2 for the FR3,
  which is 58 to 188 rad/s^2; drives of legs have gears of six and spin up at thousands (Go2: 0.004 kg m^2);
- a body's mass off by 10 to 40 %, as of CAD models (Armstrong, Khatib and Burdick 1986), a payload that asks a few per
  cent of T, an offset of 0.5 to 3 % of T as of drifting torque sensors and currents, commands late by 0.3 to 1.5
  samples.

Half are driven by position servos. In half only positions are read, by encoders of 14 to 18 bits that lose packets. At
the end: what each effect asks of its joints' torques along the motion that was recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.drawing import digits
from gpsim.trials.robots.driving import FOURIER, bare_torques
from gpsim.trials.robots.models import ROBOTS, SERVOED, SERVOS, WHOLE, Robot, layout_of, robot_of, spec_of
from gpsim.trials.robots.moving import changed_model, step_of
from gpsim.trials.worlds import FROM, Rough, Run, TrueEffect, World, log_even, numbered, rounded

Rng = np.random.Generator
DRY, VISCOUS, OFFSET = (0.01, 0.06), (0.02, 0.12), (0.005, 0.03)  # of the torque
LOAD, ARM = (0.03, 0.15), 0.5 * 9.81  # of the torque, by a payload this far out (m) in the earth's gravity
MASS = (0.1, 0.4)  # by which a body's mass is off
LATE = (0.3, 1.5)  # samples
TWO, LATE_CHANCE = 0.5, 0.5  # of two bodies that are off, of late commands
TRANSITIONS, SECONDS, FEWEST = (3000, 5000), (6.0, 12.0), 5  # in all; of an episode; episodes
POSITIONS, SPEEDS = (1e-4, 5e-4), (2e-3, 1e-2)  # noise, rad and rad/s (m and m/s)
BITS, DROPPED = (14, 18), (0.005, 0.03)  # of an encoder; share of the rows
ROWS = ("viscous_friction", "coulomb_friction", "armature")
"""Families that every joint of a whole robot has a row of."""
OF_BODIES = ("mass", "inertia", "com_x", "com_y", "com_z")


def dealt(seed: int, rank: int) -> tuple[str, bool]:
    """The robot of a world, and whether its log is an encoder's; each robot once in every cycle."""
    cycle, place = divmod(rank, len(WHOLE))
    rng = np.random.default_rng([seed, FROM["whole"], cycle])
    robots = [WHOLE[i] for i in rng.permutation(len(WHOLE))]
    own = sum(robot_of(name).ways == ("servo",) for name in ROBOTS)  # has servos whatever is dealt
    servos = set(rng.choice(SERVOED, len(WHOLE) // 2 - own, replace=False))
    encoders = set(rng.choice(robots, len(WHOLE) // 2, replace=False))
    name = robots[place]
    return name + SERVOS * (name in servos), name in encoders


def draw_whole(seed: int, number: int, attempt: int = 0) -> World:
    """The world of a trial; `attempt` counts worlds that could not be run."""
    name, encoder = dealt(seed, numbered(number)[1] - 1)
    robot, layout = robot_of(name), layout_of(name)
    rng = np.random.default_rng([seed, number, attempt, 0])
    way = next((w for w in robot.ways if w != "balance"), robot.ways[0])
    dt = float(rng.choice(robot.steps))
    seconds, wanted = float(rng.uniform(*SECONDS)), log_even(rng, *TRANSITIONS)
    steps, rough = round(seconds / dt), None
    if encoder:  # its noise is a third of a step; speeds are the controller's alone
        bits = {j: digits(2.0 * np.pi / 2 ** int(rng.integers(BITS[0], BITS[1] + 1))) for j in layout.joints}
        noise = {name: sd for j in bits for name, sd in ((j, 0.3 * bits[j]), (f"{j}_dot", SPEEDS[0]))}
        rough = Rough(quantum=bits, dropped=digits(rng.uniform(*DROPPED)))
    else:
        noise = {
            n: digits(rng.uniform(*(SPEEDS if i % 2 else POSITIONS))) for i, n in enumerate(layout.names)
        }
    return World(
        seed=seed, number=number, attempt=attempt, stratum="whole", system=name, dt=dt, engine="mujoco",
        effects=_effects(robot, dt, rng), episodes=max(round(wanted / steps), FEWEST), steps=steps,
        excitation=FOURIER if way in ("servo", "torque") else "sines", posture=way, noise=noise,
        noise_known=bool(rng.random() < 0.5), velocities=None if encoder else "measured", rough=rough,
    )  # fmt: skip


def _effects(robot: Robot, dt: float, rng: Rng) -> tuple[TrueEffect, ...]:
    """A row of friction and one of a rotor in every joint; bodies, offsets, late commands."""
    layout, drives, h = layout_of(robot.name), robot.drives, step_of(robot.name)
    torque = dict(zip(layout.joints, drives.torque, strict=True))
    made = []
    for joint, most in torque.items():
        made += [
            TrueEffect("viscous_friction", joint, {"damping": most / drives.speed * log_even(rng, *VISCOUS)}),
            TrueEffect("coulomb_friction", joint, {"force": most * log_even(rng, *DRY)}),
            TrueEffect("armature", joint, {"inertia": most / log_even(rng, *drives.spin)}),
        ]
    made += _bodies(robot, rng)
    moved = [layout.driven[a] for a in layout.action]
    for joint in rng.choice(moved, rng.integers(0, max(len(moved) // 2, 1) + 1), replace=False):
        force = torque[str(joint)] * log_even(rng, *OFFSET) * rng.choice([-1.0, 1.0])
        made.append(TrueEffect("constant_force", str(joint), {"force": force}))
    late = []
    if rng.random() < LATE_CHANCE:
        delay = round(max(round(dt * rng.uniform(*LATE) / h), 1) * h, 9)
        late = [TrueEffect("actuator_delay", action, {"delay": delay}) for action in layout.action]
    readable = (TrueEffect(e.family, e.on, {k: rounded(float(v)) for k, v in e.values.items()}) for e in made)
    return (*readable, *late)


def _bodies(robot: Robot, rng: Rng) -> list[TrueEffect]:
    """One or two that are off: a payload, a mass, or both."""
    body = str(rng.choice(robot.masses))
    ratio = 1.0 + log_even(rng, *MASS) * rng.choice([-1.0, 1.0])
    mass = TrueEffect("parameter_offset", f"{body}.mass", {"ratio": ratio})
    carrier = str(rng.choice(robot.carriers))
    model = spec_of(robot.name).compile()
    b = model.body(carrier).id
    far = float(np.sqrt(model.body_inertia[b].max() / model.body_mass[b]))
    at: FloatArray = np.asarray(model.body_ipos[b]) + 0.7 * far * rng.uniform(-1.0, 1.0, 3)
    weight = log_even(rng, *LOAD) * max(robot.drives.torque) / ARM
    load = TrueEffect("payload", carrier, {"mass": weight, **dict(zip("xyz", map(float, at), strict=True))})
    both = rng.random() < TWO and body != carrier
    return [mass, load] if both else [load if rng.random() < 0.5 else mass]


class Motion(NamedTuple):
    """(N, C) positions, velocities and accelerations of the joints, from the samples of all episodes."""

    q: FloatArray
    v: FloatArray
    a: FloatArray


def motion_of(world: World, truth: Run, kept: FloatArray) -> Motion:
    """The motion of what was kept; kept: (E,) samples of every episode."""
    parts = [truth.fine[: int(kept[e]), e] for e in np.flatnonzero(kept)]
    rates = [np.gradient(p[:, 1::2], world.dt, axis=0) for p in parts]
    states = np.concatenate(parts)
    return Motion(states[:, 0::2], states[:, 1::2], np.concatenate(rates))


def of_body(family: str, on: str) -> bool:
    """Whether an effect changes a body's mass, its centre or its inertia."""
    return family == "payload" or (family == "parameter_offset" and on.rpartition(".")[2] in OF_BODIES)


def body_torques(robot: str, effects: Sequence[TrueEffect], motion: Motion) -> FloatArray:
    """(N, C) what changed bodies ask for more than those that are believed."""
    bodies = [e for e in effects if of_body(e.family, e.on)]
    more, bare = (bare_torques(changed_model(robot, es), *motion) for es in (bodies, ()))
    return np.asarray(more - bare)


def joint_torques(world: World, motion: Motion) -> FloatArray:
    """(C,) root mean square of the torque that moves a joint; of one without an actuator, of its weight's."""
    layout, bodies = layout_of(world.system), [e for e in world.effects if of_body(e.family, e.on)]
    total = bare_torques(changed_model(world.system, bodies), *motion)
    weight = bare_torques(changed_model(world.system, ()), motion.q, motion.v, np.zeros_like(motion.a))
    for e in world.effects:
        if e.family in (*ROWS, "constant_force"):
            j = layout.joints.index(e.on)
            total[:, j] += _of_joint(e, motion, j)
    moved = [joint in layout.driven.values() for joint in layout.joints]
    return np.asarray(np.where(moved, _rms(total), _rms(weight)))


def shares_of(world: World, motion: Motion) -> list[float | None]:
    """Of every effect the share of its joint's torque, of a body the largest; None of commands."""
    layout, whole = layout_of(world.system), np.maximum(joint_torques(world, motion), 1e-12)

    def share(e: TrueEffect) -> float | None:
        if of_body(e.family, e.on):
            return float((_rms(body_torques(world.system, [e], motion)) / whole).max())
        if e.on not in layout.joints:
            return None
        j = layout.joints.index(e.on)
        return float(_rms(_of_joint(e, motion, j)) / whole[j])

    return list(map(share, world.effects))


def _of_joint(effect: TrueEffect, motion: Motion, j: int) -> FloatArray:
    """(N,) what a row asks for, or an offset."""
    v, values = motion.v[:, j], effect.values
    match effect.family:
        case "viscous_friction":
            return np.asarray(values["damping"] * v)
        case "coulomb_friction":
            return np.asarray(values["force"] * np.sign(v))
        case "armature":
            return np.asarray(values["inertia"] * motion.a[:, j])
        case _:
            return np.full(len(v), -values["force"])


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
