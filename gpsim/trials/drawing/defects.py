"""What is wrong with the log of a rough world: several defects, those that its kind of sensor has."""

from __future__ import annotations

import numpy as np

from gpsim.trials.worlds import SYSTEMS, Rough, TrueEffect, World

CHANCE, FEWEST = 0.55, 3  # of each defect; how many there are at least
CAMERA = ("swapped", "dropped", "repeated", "jitter", "late", "drift", "quantised")
ENCODER = ("quantised", "dropped", "repeated", "jitter", "late", "drift")
TIMED = ("delay", "lag")  # families that a late topic would be taken for end with these


def rough_log(world: World, effects: tuple[TrueEffect, ...], rng: np.random.Generator) -> Rough:
    """Positions alone are a camera's, which swaps markers; velocities beside them are an encoder's, which counts."""
    system = SYSTEMS[world.system]
    kinds = list(ENCODER if world.velocities == "measured" else CAMERA)
    if any(e.family.endswith(TIMED) for e in effects):
        kinds.remove("late")
    has = [kind for kind in kinds if rng.random() < CHANCE]
    others = [kind for kind in kinds if kind not in has]
    has += list(rng.permutation(others)[: max(FEWEST - len(has), 0)])
    if world.velocities == "measured" and "quantised" not in has:
        has.append("quantised")

    def share(kind: str, low: float, high: float) -> float:
        """Evenly in the logarithm; nothing where the log has not got it."""
        drawn = float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")
        return drawn if kind in has else 0.0

    read = [n for n in system.names if world.velocities != "differentiated" or n in system.coordinates]
    coarse = share("quantised", 1.0, 5.0)
    late = share("late", 0.1, 0.6) * world.dt
    leaps = {
        n: float(f"{rng.choice([-1, 1]) * rng.uniform(*_LEAPS[system.state[n]]):.3g}")
        for n in (system.coordinates or system.names)
    }
    swapped = share("swapped", 5e-4, 5e-3)
    return Rough(
        quantum={n: float(f"{coarse * system.sensors[n]:.3g}") for n in read} if coarse else {},
        jitter=float(f"{share('jitter', 0.02, 0.12) * world.dt:.3g}"),
        drift=float(rng.choice([-1, 1])) * share("drift", 1e-4, 3e-3),
        dropped=share("dropped", 5e-3, 4e-2),
        repeated=share("repeated", 3e-3, 3e-2),
        swapped=swapped,
        leap=leaps if swapped else {},
        late={n: float(f"{late:.3g}") for n in _topic(world, rng)} if late else {},
    )


_LEAPS = {"m": (0.05, 0.3), "rad": (0.2, 0.8)}


def _topic(world: World, rng: np.random.Generator) -> tuple[str, ...]:
    """The channels of the topic that is late: a cart-pole's pole has its own, a vehicle's heading may have."""
    if world.system == "cartpole":
        return ("theta", "theta_dot")
    if world.system == "unicycle" and rng.random() < 0.5:
        return ("yaw",)
    return SYSTEMS[world.system].names
