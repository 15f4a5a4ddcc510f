"""Drawing worlds for plans: a machine on a spring that was recorded under slow waves, which leave something open.

Viscous friction and a spring or gravity bring it back to rest. One more effect is of those that slow motion hides
behind another. Their numbers begin behind PLANS_FROM, so that all other worlds of a seed stay what they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.drawing.draws import NOISE
from gpsim.trials.worlds import PLAYED, SYSTEMS, Dial, TrueEffect, World, rounded

PLANS_FROM = 500_000
KINDS = ("slider", "pendulum")
DT, SECONDS = 0.02, 40.0  # of the first recording
LEVELS = ("light", "normal", "heavy")  # of noise
SWAY = {"slider": 0.8, "pendulum": 0.7}  # m and rad: how far slow waves move it
DAMPING = (0.15, 0.5)  # of the critical one
Size = Callable[[float, float, Dial], dict[str, float]]
"""size(largest command, largest speed, dial) -> parameters."""
HIDDEN: Mapping[str, Size] = {
    "actuator_delay": lambda push, speed, d: {"delay": round(d.size(0.02, 0.1), 3)},
    "actuator_lag": lambda push, speed, d: {"time_constant": d.size(0.02, 0.12)},
    "sensor_delay": lambda push, speed, d: {"delay": round(d.size(0.02, 0.08), 3)},
    "coulomb_friction": lambda push, speed, d: {"force": rounded(d.size(0.02, 0.15) * push)},
    "quadratic_drag": lambda push, speed, d: {"drag": rounded(d.size(0.1, 0.8) * push / speed**2)},
    "actuator_dead_zone": lambda push, speed, d: {"width": rounded(d.size(0.03, 0.15) * push)},
    "actuator_gain": lambda push, speed, d: {"gain": d.ratio(0.05, 0.25)},
    "parameter_offset": lambda push, speed, d: {"ratio": d.ratio(0.05, 0.25)},
}


def plan_rank(number: int) -> int | None:
    """Which of the worlds for plans a trial is, from 0; None where it is none."""
    return number - PLANS_FROM - 1 if number > PLANS_FROM else None


def draw_plan(seed: int, number: int) -> World:
    """The world: every kind of machine and every hidden effect in turn, in an order of the seed's own."""
    rank, rng = plan_rank(number) or 0, np.random.default_rng([seed, number, 0])
    system = SYSTEMS[KINDS[rank % len(KINDS)]]
    cycle, place = divmod(rank // len(KINDS), len(HIDDEN))
    order = np.random.default_rng([seed, PLANS_FROM, cycle]).permutation(len(HIDDEN))
    family = list(HIDDEN)[order[(place + rank % len(KINDS) * 3) % len(HIDDEN)]]
    parameters = {n: float(f"{rng.uniform(*r):.3g}") for n, r in system.parameters.items()}
    level = str(rng.choice(LEVELS))
    noise = {n: float(f"{sd * NOISE[level] * rng.uniform(0.5, 2.0):.3g}") for n, sd in system.sensors.items()}
    world = World(
        seed=seed, number=number, attempt=0, stratum="plans", long=False, system=system.name, parameters=parameters,
        integrator="rk4", dt=DT, engine="rk4", effects=(), episodes=1, steps=round(SECONDS / DT), clock="episode",
        excitation=PLAYED, posture="", noise_level=level, noise=noise, noise_known=bool(rng.random() < 0.5),
        velocities="measured", smoothing="central", wrapped=False, held_out=None,
    )  # fmt: skip
    (on,), (command,) = system.coordinates, system.action
    stiffness = rounded(parameters["mass"] * rng.uniform(1.0, 6.0))
    push, speed = slow_push(world, stiffness), SWAY[system.name] * _frequency(world, stiffness)
    damping = rounded(2.0 * rng.uniform(*DAMPING) * _inertia(world) * _frequency(world, stiffness))
    effects = [TrueEffect("viscous_friction", on, {"damping": damping})]
    if system.name == "slider":
        spring = {"stiffness": stiffness, "rest_position": 0.0}
        effects.append(TrueEffect("spring", on, spring))
    dial = Dial(rng, float(rng.uniform()))
    place_of = {"parameter_offset": "mass", "sensor_delay": on}
    where = place_of.get(family, command if family.startswith("actuator") else on)
    effects.append(TrueEffect(family, where, HIDDEN[family](push, speed, dial), strength=dial.level))
    return replace(world, effects=tuple(effects))


def slow_push(world: World, stiffness: float) -> float:
    """The largest command of the first recording."""
    if world.system == "slider":
        return stiffness * SWAY["slider"]
    p = world.parameters
    return p["mass"] * p["gravity"] * p["length"] * float(np.sin(SWAY["pendulum"]))


def slow_waves(world: World) -> FloatArray:
    """(K, A) what the first recording was driven by."""
    rng, t = world.generator(1), 2.0 * np.pi * world.dt * np.arange(world.steps)
    slow, slower = rng.uniform(0.03, 0.06), rng.uniform(0.01, 0.025)
    wave = np.sin(slow * t + rng.uniform(0, 6)) + 0.5 * np.sin(slower * t + rng.uniform(0, 6))
    fade = np.minimum(t / t[100], 1.0)  # from rest
    push = slow_push(world, _stiffness(world))
    return np.asarray((push * fade * wave / np.abs(wave).max())[:, None])


def box_of(world: World) -> dict[str, list[float]]:
    """What a person states: half as far again as the slow waves go, and as fast as it swings then."""
    position, velocity = SYSTEMS[world.system].names
    far = 1.5 * SWAY[world.system]
    fast = far * _frequency(world, _stiffness(world))
    return {position: [-far, far], velocity: [-rounded(fast), rounded(fast)]}


def _stiffness(world: World) -> float:
    return next((e.values["stiffness"] for e in world.effects if e.family == "spring"), 0.0)


def _inertia(world: World) -> float:
    return world.parameters["mass"] * world.parameters.get("length", 1.0) ** 2


def _frequency(world: World, stiffness: float) -> float:
    """[rad/s] at which it swings."""
    if world.system == "slider":
        return float(np.sqrt(stiffness / world.parameters["mass"]))
    return float(np.sqrt(world.parameters["gravity"] / world.parameters["length"]))
