"""On which systems and places a family, or a kind outside the catalogue, makes sense."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue, outside
from gpsim.trials.truth import Shares, run
from gpsim.trials.worlds import SYSTEMS, Dial, Rough, Run, Scales, System, TrueEffect, World, sound


def systems_of(family: str) -> list[str]:
    """The systems on which a family makes sense."""
    return [name for name, system in SYSTEMS.items() if places_of(family, system, "measured")]


def places_of(family: str, system: System, velocities: str | None) -> list[str]:
    """What a family can act on in a system, so that a recording can show it."""
    if family in outside.EVERY_KIND:
        return outside.EVERY_KIND[family].places(system, velocities)
    if family in catalogue.WORDS:
        return catalogue.places_of(family, system, velocities)
    if family in catalogue.SMOOTH or family in catalogue.GRIP:
        return list(system.coordinates)
    if family in catalogue.ACTUATORS:
        return list(system.action)
    if family == "parameter_offset":
        return list(system.parameters)
    if family in catalogue.TWIST:
        return ["vehicle"] if system.vehicle else []
    if family in ("marker_offset", "frame_rotation"):
        return ["pose"] if system.vehicle else []
    if system.vehicle:
        return {"sensor_bias": ["yaw"], "sensor_scale": ["x", "y"]}.get(family, list(system.names))
    readable = [c for c in system.names if c in system.coordinates or velocities == "measured"]
    if family == "sensor_bias":  # nothing depends on where along its guide a cart or slider is
        return [c for c in readable if c not in ("x", "q")]
    return readable


def of_body(family: str) -> bool:
    """Whether it acts in the body itself; before or after it the engine does not matter."""
    if family in outside.EVERY_KIND:
        return outside.EVERY_KIND[family].of_body
    return not (family in catalogue.ACTUATORS or family.startswith("sensor_"))


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


LEAST_SHARE, MOST_SHARE = 0.005, 0.08  # of the mismatch, that a nuisance makes
INSIDE = 1.3  # drawn shares keep this factor away from both, and calibration comes as near as it
COARSE = 5  # steps a sample while shares are calibrated
ROUNDS, PATIENCE = 6, 3  # of calibration; after so many those that are not near are left out if enough are
STRENGTHS, SLOPE = (
    (-5.0, 1.5),
    (1.0, 12.0),
)  # between which is looked; the slopes of a share that are believed
COSTLY = ("loose_marker", "encoder_play")  # kinds that read their whole past anew at every sample


def within(share: float) -> bool:
    """Whether a share is a nuisance's."""
    return LEAST_SHARE <= share <= MOST_SHARE


@dataclass(frozen=True)
class Nuisance:
    """A kind on a place, the share it is to make, and the seed of all that is drawn for it besides its strength."""

    kind: str
    on: str
    wanted: float
    seed: int

    def at(self, strength: float, scales: Scales) -> TrueEffect:
        """As strong as that; the same in all else."""
        dial = Dial(np.random.default_rng(self.seed), strength)
        values = outside.EVERY_KIND[self.kind].drawn(scales, self.on, dial)
        return TrueEffect(self.kind, self.on, values, outside=True, strength="subtle")


def nuisances(
    seed: int, world: World, counts: Sequence[int], most: float, rng: np.random.Generator
) -> list[Nuisance]:
    """As many as one of `counts` says, of kinds that the seed may draw; most: the share of the largest."""
    return [_nuisance(kind, on, most, rng) for kind, on in _kinds(seed, world, counts, rng)]


def _nuisance(kind: str, on: str, most: float, rng: np.random.Generator) -> Nuisance:
    low, high = np.log([LEAST_SHARE * INSIDE, most / INSIDE])
    return Nuisance(kind, on, float(np.exp(rng.uniform(low, high))), int(rng.integers(2**31)))


def _kinds(seed: int, world: World, counts: Sequence[int], rng: np.random.Generator) -> list[tuple[str, str]]:
    """Kinds that the seed may draw, and where they act."""
    system = SYSTEMS[world.system]
    able = [
        name
        for name, kind in sorted(outside.nuisances(seed).items())
        if name not in COSTLY and kind.places(system, world.velocities)
    ]
    count = min(int(rng.choice(list(counts))), len(able))
    names = [str(name) for name in rng.choice(able, count, replace=False)]
    return [(n, str(rng.choice(outside.EVERY_KIND[n].places(system, world.velocities)))) for n in names]


def calibrated(world: World, chosen: Sequence[Nuisance], scales: Scales, fewest: int) -> World | None:
    """With the nuisances as strong as their shares ask: bisection of all at once, by secants inside the brackets.

    One whose share cannot be reached (an encoder's step that is always too coarse) is left out while `fewest` are left.
    """
    s = np.zeros(len(chosen))
    low, high = (np.full(len(chosen), edge) for edge in STRENGTHS)
    wanted = np.log([n.wanted for n in chosen])
    slope, before = np.full(len(chosen), 4.0), None
    good: list[TrueEffect] = []
    for turn in range(ROUNDS):
        made = [n.at(float(x), scales) for n, x in zip(chosen, s, strict=True)]
        tried = replace(world, effects=(*world.effects, *made))
        shares = shares_of(tried)
        if shares is None:
            high, s = np.minimum(high, s), s - 1.0
            continue
        found = np.log(np.maximum([shares.of(e) for e in made], 1e-9))
        near = np.abs(found - wanted) < np.log(INSIDE)
        if near.all():
            return tried
        good = [e for e, there in zip(made, near, strict=True) if there]
        if turn >= PATIENCE and len(good) >= fewest:
            break
        if before is not None:
            moved = np.where(np.abs(s - before[0]) > 1e-6, s - before[0], np.inf)
            secant = (found - before[1]) / moved
            slope = np.where(np.isfinite(moved), np.clip(np.nan_to_num(secant), *SLOPE), slope)
        before = (s.copy(), found)
        low, high = np.where(found < wanted, s, low), np.where(found > wanted, s, high)
        s = _next(s + (wanted - found) / slope, low, high)
    fewer = replace(world, effects=(*world.effects, *good))
    if len(good) < fewest or (shares := shares_of(fewer)) is None:
        return None
    return fewer if all(within(shares.of(e)) for e in good) else None


def _next(tried: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """The secant's strengths, or the middle of a bracket that they leave."""
    return np.where((tried > low) & (tried < high), tried, (low + high) / 2)


def shares_of(world: World) -> Shares | None:
    """Of a coarse run; None where too little survives."""
    truth = pilot(world, world.effects)
    kept = np.asarray(sound(world, truth.sampled))
    if (kept < len(truth.clean)).mean() > 0.2:
        return None
    return Shares(world, truth, kept)


def pilot(world: World, effects: Sequence[TrueEffect]) -> Run:
    """A coarse run with these effects."""
    return run(replace(world, engine="rk4"), effects, world.dt / COARSE)
