"""Drawing worlds for plans: a pendulum that was recorded under slow waves, which leave something open.

Gravity and viscous friction, of which the base knows the first, bring it back to rest. One more effect is of
those that slow motion hides behind another. Their numbers begin behind PLANS_FROM: all other worlds stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.drawing.draws import NOISE
from gpsim.trials.worlds import PLAYED, SYSTEMS, Dial, TrueEffect, World, rounded

PLANS_FROM, PLANS_TO = 500_000, 600_000
DT, SECONDS = 0.02, 30.0  # of the first recording
LEVELS = ("normal", "heavy")  # of noise
SWAY = 0.6  # rad, how far slow waves move it
SLOW, SLOWER = (0.05, 0.12), (0.02, 0.05)  # Hz of the two waves
DAMPING = (0.1, 0.3)  # of the critical one
FAR = 1.5  # times the sway, that it may go
Size = Callable[[float, float, Dial], dict[str, float]]
"""size(largest command, largest speed, dial) -> parameters."""
HIDDEN: Mapping[str, Size] = {
    "actuator_delay": lambda push, speed, d: {"delay": _even(d.size(0.02, 0.06))},
    "actuator_lag": lambda push, speed, d: {"time_constant": d.size(0.02, 0.08)},
    "sensor_delay": lambda push, speed, d: {"delay": _even(d.size(0.02, 0.05))},
    "coulomb_friction": lambda push, speed, d: {"force": rounded(d.size(0.02, 0.15) * push)},
    "quadratic_drag": lambda push, speed, d: {"drag": rounded(d.size(0.1, 0.8) * push / speed**2)},
    "actuator_dead_zone": lambda push, speed, d: {"width": rounded(d.size(0.03, 0.15) * push)},
    "actuator_gain": lambda push, speed, d: {"gain": d.ratio(0.05, 0.25)},
    "parameter_offset": lambda push, speed, d: {"ratio": d.ratio(0.05, 0.25)},
}


def plan_rank(number: int) -> int | None:
    """Which of the worlds for plans a trial is, from 0; None where it is none."""
    return number - PLANS_FROM - 1 if PLANS_FROM < number <= PLANS_TO else None


def draw_plan(seed: int, number: int) -> World:
    """The world: every hidden effect in turn, in an order of the seed's own."""
    cycle, place = divmod(plan_rank(number) or 0, len(HIDDEN))
    family = list(HIDDEN)[np.random.default_rng([seed, PLANS_FROM, cycle]).permutation(len(HIDDEN))[place]]
    rng, system = np.random.default_rng([seed, number, 0]), SYSTEMS["pendulum"]
    p = {n: float(f"{rng.uniform(*r):.3g}") for n, r in system.parameters.items()}
    level = str(rng.choice(LEVELS))
    noise = {n: float(f"{sd * NOISE[level] * rng.uniform(0.5, 2.0):.3g}") for n, sd in system.sensors.items()}
    world = World(
        seed=seed, number=number, attempt=0, stratum="plans", long=False, system=system.name, parameters=p,
        integrator="rk4", dt=DT, engine="rk4", effects=(), episodes=1, steps=round(SECONDS / DT), clock="episode",
        excitation=PLAYED, posture="", noise_level=level, noise=noise, noise_known=bool(rng.random() < 0.5),
        velocities="measured", smoothing="central", wrapped=False, held_out=None,
    )  # fmt: skip
    (on,), (command,) = system.coordinates, system.action
    inertia = p["mass"] * p["length"] ** 2
    damping = rounded(2.0 * rng.uniform(*DAMPING) * inertia * _swings(world))
    dial = Dial(rng, float(rng.uniform()))
    where = {"parameter_offset": "mass"}.get(family, command if family.startswith("actuator") else on)
    sizes = HIDDEN[family](_push(world), SWAY * _swings(world), dial)
    hidden = TrueEffect(family, where, sizes, strength=dial.level)
    return replace(world, effects=(TrueEffect("viscous_friction", on, {"damping": damping}), hidden))


def slow_waves(world: World) -> FloatArray:
    """(K, A) what the first recording was driven by, from rest."""
    rng, t = world.generator(1), world.dt * np.arange(world.steps)
    waves = (
        size * np.sin(2 * np.pi * rng.uniform(*band) * t + rng.uniform(0, 6))
        for size, band in ((1.0, SLOW), (0.5, SLOWER))
    )
    wave = np.minimum(t, 1.0) * sum(waves)
    return np.asarray((_push(world) * wave / np.abs(wave).max())[:, None])


def box_of(world: World) -> dict[str, list[float]]:
    """What a person states: half as far again as the slow waves go, and as fast as it swings then."""
    position, velocity = SYSTEMS[world.system].names
    far, fast = rounded(FAR * SWAY), rounded(FAR * SWAY * _swings(world))
    return {position: [-far, far], velocity: [-fast, fast]}


def _push(world: World) -> float:
    """The largest command of the first recording: what holds it at the sway."""
    p = world.parameters
    return p["mass"] * p["gravity"] * p["length"] * float(np.sin(SWAY))


def _swings(world: World) -> float:
    """[rad/s]."""
    return float(np.sqrt(world.parameters["gravity"] / world.parameters["length"]))


def _even(seconds: float) -> float:
    """In whole fine steps of a world (see `blinding.plan_worlds`)."""
    return round(round(seconds / 0.002) * 0.002, 3)
