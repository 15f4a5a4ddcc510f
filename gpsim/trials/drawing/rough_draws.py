"""Drawing rough worlds: one to three main effects, nuisances of small shares outside the catalogue, a log as logs are.

Their numbers begin behind ROUGH_FROM, so that the plain worlds of a seed stay what they are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from gpsim.trials import catalogue
from gpsim.trials.drawing.draws import NOISE, bare_world, effect, places
from gpsim.trials.drawing.nuisances import (
    MOST_SHARE,
    calibrated,
    nuisances,
    pilot,
    places_of,
    rough_log,
    shares_of,
    systems_of,
)
from gpsim.trials.truth import Shares
from gpsim.trials.worlds import CLOSED_LOOP, SYSTEMS, Dial, Rough, Scales, System, TrueEffect, World

ROUGH_FROM = 100_000
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


def rank_of(number: int) -> int | None:
    """Which of the rough worlds a trial is, from 0; None for a plain one."""
    return number - ROUGH_FROM - 1 if number > ROUGH_FROM else None


def draw_rough(seed: int, number: int, attempt: int = 0) -> World | None:
    """The world of a rough trial; None where the attempt gave none whose effects are what they have to be."""
    rng = np.random.default_rng([seed, number, attempt, 0])
    world = _world(seed, number, attempt, rng)
    if world is None:
        return None
    chosen = nuisances(seed, world, NUISANCES, MOST_SHARE, rng)
    return calibrated(world, chosen, Scales(world, pilot(world, ())), NUISANCES[0])


def _world(seed: int, number: int, attempt: int, rng: np.random.Generator) -> World | None:
    """With its main effects alone, each of which is one."""
    rank = rank_of(number) or 0
    own = attempt < OWN_FAMILY
    family = _first_family(seed, rank) if own else str(rng.choice(catalogue.DECK))
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
    scales = Scales(world, pilot(world, ()))
    made: list[TrueEffect] = []
    for name, on in chosen:
        dial = Dial(rng, float(rng.uniform(0.3, 1.0)))
        made.append(effect(name, on, scales, dial, not any(e.gated for e in made), rng))
    dated = any(e.since is not None for e in made)
    world = replace(world, effects=tuple(made), clock="session" if dated else world.clock)
    world = replace(world, rough=rough_log(world, world.effects, rng))
    shares = shares_of(world)
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
    names = catalogue.DECK
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
