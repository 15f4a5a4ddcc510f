"""Drawing rough worlds: one to three main effects, nuisances of small shares outside the catalogue, a log as logs are.

Their numbers begin behind ROUGH_FROM, so that the plain worlds of a seed stay what they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue, outside
from gpsim.trials.drawing.defects import rough_log
from gpsim.trials.drawing.draws import NOISE, bare_world, effect, places
from gpsim.trials.drawing.places import places_of, systems_of
from gpsim.trials.truth import Shares, run
from gpsim.trials.worlds import (
    CLOSED_LOOP,
    SYSTEMS,
    Dial,
    Rough,
    Run,
    Scales,
    System,
    TrueEffect,
    World,
    sound,
)

ROUGH_FROM = 100_000
LEAST_SHARE, MOST_SHARE = 0.005, 0.08  # of the mismatch, that a nuisance makes
INSIDE = 1.3  # drawn shares keep this factor away from both, and calibration comes as near as it
IMPORTANT, NEEDED = 0.1, 0.05  # of a main effect before there are nuisances: what makes it one
LATE = 0.02  # of the mismatch, that a late topic may make
SIZES = {1: 0.35, 2: 0.4, 3: 0.25}  # how often so many main effects
NUISANCES = (2, 3, 4)
POSITIONS_ONLY = (
    0.3  # of the mechanical ones: with the vehicles, of which a pose is all there is, about half of all
)
OWN_FAMILY = 8  # attempts with the family whose turn it is; then whichever comes
TRANSITIONS = (2500, 6000)
LEVELS = {"light": 0.3, "normal": 0.5, "heavy": 0.2}  # of noise; no real sensor is clean
COARSE = 5  # steps a sample while shares are calibrated
ROUNDS, PATIENCE = 6, 3  # of calibration; after so many those that are not near are left out if enough are
STRENGTHS, SLOPE = (
    (-5.0, 1.5),
    (1.0, 12.0),
)  # between which is looked; the slopes of a share that are believed
COSTLY = ("loose_marker", "encoder_play")  # kinds that read their whole past anew at every sample


def rank_of(number: int) -> int | None:
    """Which of the rough worlds a trial is, from 0; None for a plain one."""
    return number - ROUGH_FROM - 1 if number > ROUGH_FROM else None


def draw_rough(seed: int, number: int, attempt: int = 0) -> World | None:
    """The world of a rough trial; None where the attempt gave none whose effects are what they have to be."""
    rng = np.random.default_rng([seed, number, attempt, 0])
    world = _world(seed, number, attempt, rng)
    if world is None:
        return None
    nuisances = [_nuisance(kind, on, rng) for kind, on in _nuisances(seed, world, rng)]
    scales = Scales(world, _pilot(world, ()))
    return _calibrated(world, nuisances, scales)


def within(share: float) -> bool:
    """Whether a share is a nuisance's."""
    return LEAST_SHARE <= share <= MOST_SHARE


def _world(seed: int, number: int, attempt: int, rng: np.random.Generator) -> World | None:
    """With its main effects alone, each of which is one."""
    rank = rank_of(number) or 0
    own = attempt < OWN_FAMILY
    family = _first_family(seed, rank) if own else str(rng.choice(sorted(catalogue.STRENGTHS)))
    # The same in every attempt, or what lets attempts succeed would come more often.
    turn = np.random.default_rng([seed, number, ROUGH_FROM]) if own else rng
    system = SYSTEMS[str(turn.choice(systems_of(family)))]
    positions_only = turn.random() < POSITIONS_ONLY and bool(places_of(family, system, "differentiated"))
    velocities: Literal["measured", "differentiated"] | None = None
    if not system.vehicle:
        velocities = "differentiated" if positions_only else "measured"
    size = int(rng.choice(list(SIZES), p=list(SIZES.values())))
    chosen = places(family, system, size, velocities, rng)
    world = bare_world(seed, number, attempt, "rough", False, system, velocities, chosen, rng)
    world = _roughened(world, system, rng)
    scales = Scales(world, _pilot(world, ()))
    made: list[TrueEffect] = []
    for name, on in chosen:
        dial = Dial(rng, float(rng.uniform(0.3, 1.0)))
        made.append(effect(name, on, scales, dial, not any(e.gated for e in made), rng))
    dated = any(e.since is not None for e in made)
    world = replace(world, effects=tuple(made), clock="session" if dated else world.clock)
    world = replace(world, rough=rough_log(world, world.effects, rng))
    shares = _shares(world)
    if shares is None or not shares.counts.any():
        return None
    world = replace(world, rough=_hardly_late(world, shares))
    main = shares.main()
    return world if all(m.importance >= IMPORTANT and m.needed >= NEEDED for m in main) else None


def _hardly_late(world: World, shares: Shares) -> Rough:
    """The log with topics no later than that it is no physics: their share goes with the square of the lag."""
    rough, share = world.rough or Rough(), shares.late()
    if share <= LATE:
        return rough
    shorter = np.sqrt(LATE / share)
    return replace(rough, late={n: float(f"{lag * shorter:.3g}") for n, lag in rough.late.items()})


def _first_family(seed: int, rank: int) -> str:
    """Each family once in every cycle, cycles in an order of their own."""
    names = sorted(catalogue.STRENGTHS)
    cycle, place = divmod(rank, len(names))
    return str(names[np.random.default_rng([seed, ROUGH_FROM, cycle]).permutation(len(names))[place]])


def _roughened(world: World, system: System, rng: np.random.Generator) -> World:
    """The same with a controller in the loop and noise as sensors have it.

    The base simulator steps by Runge-Kutta: the mismatch, whose shares decide, is physics alone.
    """
    level = str(rng.choice(list(LEVELS), p=list(LEVELS.values())))
    wanted = float(np.exp(rng.uniform(*np.log(TRANSITIONS))))
    upright = system.name == "cartpole" and rng.random() < 0.5
    return replace(
        world,
        integrator="rk4",
        episodes=max(int(np.ceil(wanted / world.steps)), 5),
        excitation=CLOSED_LOOP[0] if rng.random() < 0.6 else CLOSED_LOOP[1],
        posture=("upright" if upright else "hanging") if system.name == "cartpole" else "",
        noise_level=level,
        noise={
            n: float(f"{sd * NOISE[level] * rng.uniform(0.5, 2.0):.3g}") for n, sd in system.sensors.items()
        },
        noise_known=bool(rng.random() < 0.3),
    )


@dataclass(frozen=True)
class _Nuisance:
    """A kind on a place, the share it is to make, and the seed of all that is drawn for it besides its strength."""

    kind: str
    on: str
    wanted: float
    seed: int

    def at(self, strength: float, scales: Scales) -> TrueEffect:
        """As strong as that; the same in all else."""
        dial = Dial(np.random.default_rng(self.seed), strength)
        values = outside.KINDS[self.kind].strength(scales, self.on, dial)
        return TrueEffect(self.kind, self.on, values, outside=True, strength="subtle")


def _nuisance(kind: str, on: str, rng: np.random.Generator) -> _Nuisance:
    low, high = np.log([LEAST_SHARE * INSIDE, MOST_SHARE / INSIDE])
    return _Nuisance(kind, on, float(np.exp(rng.uniform(low, high))), int(rng.integers(2**31)))


def _nuisances(seed: int, world: World, rng: np.random.Generator) -> list[tuple[str, str]]:
    """Kinds that the seed may draw, and where they act."""
    system = SYSTEMS[world.system]
    able = [
        name
        for name, kind in sorted(outside.nuisances(seed).items())
        if name not in COSTLY and kind.places(system, world.velocities)
    ]
    count = min(int(rng.choice(NUISANCES)), len(able))
    names = [str(name) for name in rng.choice(able, count, replace=False)]
    return [(n, str(rng.choice(outside.KINDS[n].places(system, world.velocities)))) for n in names]


def _calibrated(world: World, nuisances: Sequence[_Nuisance], scales: Scales) -> World | None:
    """With the nuisances as strong as their shares ask: bisection of all at once, by secants inside the brackets.

    One whose share cannot be reached (an encoder's step that is always too coarse) is left out while two are left.
    """
    s = np.zeros(len(nuisances))
    low, high = (np.full(len(nuisances), edge) for edge in STRENGTHS)
    wanted = np.log([n.wanted for n in nuisances])
    slope, before = np.full(len(nuisances), 4.0), None
    good: list[TrueEffect] = []
    for turn in range(ROUNDS):
        made = [n.at(float(x), scales) for n, x in zip(nuisances, s, strict=True)]
        tried = replace(world, effects=(*world.effects, *made))
        shares = _shares(tried)
        if shares is None:
            high, s = np.minimum(high, s), s - 1.0
            continue
        found = np.log(np.maximum([shares.of(e) for e in made], 1e-9))
        near = np.abs(found - wanted) < np.log(INSIDE)
        if near.all():
            return tried
        good = [e for e, there in zip(made, near, strict=True) if there]
        if turn >= PATIENCE and len(good) >= NUISANCES[0]:
            break
        if before is not None:
            moved = np.where(np.abs(s - before[0]) > 1e-6, s - before[0], np.inf)
            secant = (found - before[1]) / moved
            slope = np.where(np.isfinite(moved), np.clip(np.nan_to_num(secant), *SLOPE), slope)
        before = (s.copy(), found)
        low, high = np.where(found < wanted, s, low), np.where(found > wanted, s, high)
        s = _next(s + (wanted - found) / slope, low, high)
    fewer = replace(world, effects=(*world.effects, *good))
    if len(good) < NUISANCES[0] or (shares := _shares(fewer)) is None:
        return None
    return fewer if all(within(shares.of(e)) for e in good) else None


def _next(tried: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """The secant's strengths, or the middle of a bracket that they leave."""
    return np.where((tried > low) & (tried < high), tried, (low + high) / 2)


def _shares(world: World) -> Shares | None:
    """Of a coarse run; None where too little survives."""
    truth = _pilot(world, world.effects)
    kept = np.asarray(sound(world, truth.sampled))
    if (kept < len(truth.clean)).mean() > 0.2:
        return None
    return Shares(world, truth, kept)


def _pilot(world: World, effects: Sequence[TrueEffect]) -> Run:
    return run(replace(world, engine="rk4"), effects, world.dt / COARSE)
