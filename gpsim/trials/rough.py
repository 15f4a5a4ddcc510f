"""Drawing rough worlds: one to three main effects, nuisances of small shares outside the catalogue, a log as logs are.

Nuisances and logs are those of whole machines, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue, out_of_catalogue
from gpsim.trials.drawing import bare_world, digits, noise_of, places, places_of, systems_of, with_effects
from gpsim.trials.driving import CLOSED_LOOP, sound
from gpsim.trials.shares import Shares
from gpsim.trials.truth import run
from gpsim.trials.worlds import (
    FROM,
    SYSTEMS,
    Dial,
    Rough,
    Run,
    Scales,
    System,
    TrueEffect,
    Velocities,
    World,
    log_even,
    numbered,
)  # fmt: skip

Rng = np.random.Generator
IMPORTANT, NEEDED = 0.1, 0.05  # of a main effect before there are nuisances: what makes it one
LATE = 0.02  # of the mismatch, that a late topic may make
SIZES = {1: 0.35, 2: 0.4, 3: 0.25}  # how often so many main effects
NUISANCES = (2, 3, 4)
POSITIONS_ONLY = 0.3  # of the mechanical ones: with the vehicles, which have poses alone, about half of all
OWN_FAMILY = 8  # attempts with the family whose turn it is; then whichever comes
TRANSITIONS = (2500, 6000)
LEVELS = {"light": 0.3, "normal": 0.5, "heavy": 0.2}  # of noise; no real sensor is clean


def draw_rough(seed: int, number: int, attempt: int = 0) -> World | None:
    """The world of a rough trial; None where the attempt gave none whose effects are what they have to be."""
    rng = np.random.default_rng([seed, number, attempt, 0])
    own = attempt < OWN_FAMILY
    cycle, place = divmod(numbered(number)[1] - 1, len(catalogue.DECK))
    order = np.random.default_rng([seed, FROM["rough"], cycle]).permutation(len(catalogue.DECK))
    family = catalogue.DECK[order[place]] if own else str(rng.choice(catalogue.DECK))
    # The same in every attempt, or what lets attempts succeed would come more often.
    turn = np.random.default_rng([seed, number, FROM["rough"]]) if own else rng
    system = SYSTEMS[str(turn.choice(systems_of(family)))]
    positions_only = turn.random() < POSITIONS_ONLY and bool(places_of(family, system, "differentiated"))
    velocities: Velocities = None
    if not system.vehicle:
        velocities = "differentiated" if positions_only else "measured"
    size = int(rng.choice(list(SIZES), p=list(SIZES.values())))
    chosen = places(family, system, size, velocities, rng)
    world = bare_world(seed, number, attempt, "rough", False, system, velocities, chosen, rng)
    world = _roughened(world, system, rng)
    world = with_effects(world, chosen, Scales(world, pilot(world, ())), (0.3, 1.0), rng)
    world = replace(world, rough=rough_log(world, world.effects, rng))
    shares = shares_of(world)
    if shares is None or not shares.counts.any():
        return None
    world = replace(world, rough=_hardly_late(world, shares))
    if not all(m.importance >= IMPORTANT and m.needed >= NEEDED for m in shares.main()):
        return None
    return calibrated(world, nuisances(seed, world, NUISANCES, MOST_SHARE, rng), NUISANCES[0])


def _hardly_late(world: World, shares: Shares) -> Rough:
    """The log with topics no later than that it is no physics: their share goes with the square of the lag."""
    rough, share = world.rough or Rough(), shares.late()
    if share <= LATE:
        return rough
    shorter = np.sqrt(LATE / share)
    return replace(rough, late={n: digits(lag * shorter) for n, lag in rough.late.items()})


def _roughened(world: World, system: System, rng: Rng) -> World:
    """The same with a controller in the loop and noise as sensors have it.

    The base simulator steps by Runge-Kutta: the mismatch, whose shares decide, is physics alone.
    """
    level = str(rng.choice(list(LEVELS), p=list(LEVELS.values())))
    wanted = log_even(rng, *TRANSITIONS)
    upright = system.name == "cartpole" and rng.random() < 0.5
    return replace(
        world,
        integrator="rk4",
        episodes=max(int(np.ceil(wanted / world.steps)), 5),
        excitation=CLOSED_LOOP[0] if rng.random() < 0.6 else CLOSED_LOOP[1],
        posture=("upright" if upright else "hanging") if system.name == "cartpole" else "",
        noise_level=level,
        noise=noise_of(system, level, rng),
        noise_known=bool(rng.random() < 0.3),
    )


CHANCE, FEWEST = 0.55, 3  # of each defect; how many there are at least
CAMERA = ("swapped", "dropped", "repeated", "jitter", "late", "drift", "quantised")
ENCODER = ("quantised", "dropped", "repeated", "jitter", "late", "drift")
TIMED = ("delay", "lag")  # families that a late topic would be taken for end with these
LEAPS = {"m": (0.05, 0.3), "rad": (0.2, 0.8)}  # of a marker that is swapped


def rough_log(world: World, effects: tuple[TrueEffect, ...], rng: Rng) -> Rough:
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
        drawn = digits(log_even(rng, low, high))
        return drawn if kind in has else 0.0

    def topic() -> tuple[str, ...]:
        """The channels of the topic that is late: a cart-pole's pole has its own, a vehicle's heading may have."""
        if world.system == "cartpole":
            return ("theta", "theta_dot")
        return ("yaw",) if world.system == "unicycle" and rng.random() < 0.5 else system.names

    read = [n for n in system.names if world.velocities != "differentiated" or n in system.coordinates]
    coarse = share("quantised", 1.0, 5.0)
    late = share("late", 0.1, 0.6) * world.dt
    leaps = {
        n: digits(rng.choice([-1, 1]) * rng.uniform(*LEAPS[system.state[n]]))
        for n in (system.coordinates or system.names)
    }
    swapped = share("swapped", 5e-4, 5e-3)
    return Rough(
        quantum={n: digits(coarse * system.sensors[n]) for n in read} if coarse else {},
        jitter=digits(share("jitter", 0.02, 0.12) * world.dt),
        drift=float(rng.choice([-1, 1])) * share("drift", 1e-4, 3e-3),
        dropped=share("dropped", 5e-3, 4e-2),
        repeated=share("repeated", 3e-3, 3e-2),
        swapped=swapped,
        leap=leaps if swapped else {},
        late={n: digits(late) for n in topic()} if late else {},
    )


LEAST_SHARE, MOST_SHARE = 0.005, 0.08  # of the mismatch, that a nuisance makes
INSIDE = 1.3  # drawn shares keep this factor away from both, and calibration comes as near as it
COARSE = 5  # steps a sample while shares are calibrated
ROUNDS, PATIENCE = 6, 3  # of calibration; after so many those that are not near are left out if enough are
STRENGTHS, SLOPE = (-5.0, 1.5), (1.0, 12.0)  # that are looked between; slopes of a share that are believed
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
        values = out_of_catalogue.EVERY_KIND[self.kind].drawn(scales, self.on, dial)
        return TrueEffect(self.kind, self.on, values, out_of_catalogue=True, strength="subtle")


def nuisances(seed: int, world: World, counts: Sequence[int], most: float, rng: Rng) -> list[Nuisance]:
    """As many as one of `counts` says, of kinds that the seed may draw; most: the share of the largest."""
    where = {
        name: kind.places(SYSTEMS[world.system], world.velocities)
        for name, kind in sorted(out_of_catalogue.nuisances(seed).items())
    }
    able = [name for name, there in where.items() if there and name not in COSTLY]
    count = min(int(rng.choice(list(counts))), len(able))
    names = [str(name) for name in rng.choice(able, count, replace=False)]
    pairs = [(name, str(rng.choice(where[name]))) for name in names]
    low, high = LEAST_SHARE * INSIDE, most / INSIDE
    return [Nuisance(kind, on, log_even(rng, low, high), int(rng.integers(2**31))) for kind, on in pairs]


def calibrated(world: World, chosen: Sequence[Nuisance], fewest: int) -> World | None:
    """With the nuisances as strong as their shares ask: bisection of all at once, by secants inside the brackets.

    One whose share cannot be reached (an encoder's step that is always too coarse) is left out while `fewest` are left.
    """
    scales = Scales(world, pilot(world, ()))
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
        # The secant's strengths, or the middle of a bracket that they leave.
        s = s + (wanted - found) / slope
        s = np.where((s > low) & (s < high), s, (low + high) / 2)
    fewer = replace(world, effects=(*world.effects, *good))
    if len(good) < fewest or (shares := shares_of(fewer)) is None:
        return None
    return fewer if all(within(shares.of(e)) for e in good) else None


def shares_of(world: World) -> Shares | None:
    """Of a coarse run; None where too little survives."""
    truth = pilot(world, world.effects)
    kept: FloatArray = np.asarray(sound(world, truth.sampled))
    if (kept < len(truth.clean)).mean() > 0.2:
        return None
    return Shares(world, truth, kept)


def pilot(world: World, effects: Sequence[TrueEffect]) -> Run:
    """A coarse run with these effects."""
    return run(replace(world, engine="rk4"), effects, world.dt / COARSE)
