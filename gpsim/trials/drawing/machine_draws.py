"""Drawing whole machines: a class, its effects, one to three recordings, and sensors and nuisances as of rough worlds.

Their numbers begin behind MACHINES_FROM, so that all other worlds of a seed stay what they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.trials.drawing.draws import NOISE
from gpsim.trials.drawing.machine_parts import PARTS, Sizes, parts_of
from gpsim.trials.drawing.nuisances import calibrated, nuisances, pilot, rough_log, shares_of
from gpsim.trials.truth import Shares
from gpsim.trials.worlds import (
    CLOSED_LOOP,
    FREE,
    REFERENCES,
    SYSTEMS,
    Machine,
    Rough,
    Scales,
    Session,
    System,
    TrueEffect,
    Values,
    World,
)

MACHINES_FROM, MACHINES_TO = 300_000, 400_000
ARM = "arm"
KINDS = (*PARTS, ARM)
"""Classes in turn; an arm needs MuJoCo, and is drawn by `robots`."""
STEPS = {"axis": (0.005, 0.01, 0.02), "rig": (0.01, 0.02), "servo": (0.01, 0.02), "car": (0.05, 0.1)}
"""s between samples."""
TRANSITIONS, LENGTH = (2500, 6000), (6.0, 20.0)  # in all; s of an episode
SHORTEST = 60  # steps of one, at the least
POSITIONS_ONLY = 0.5  # of the machines that have velocities
SEVERAL = 1 / 3  # of the machines, that have two or three recordings
DIFFERS = 0.4  # of those, in which a payload or a friction is another one
LEVELS = {"light": 0.5, "normal": 0.5}  # of noise: laboratory's sensors
NUISANCES, LARGEST = (1, 2, 3), 0.03  # how many, and the share of the mismatch of the largest
WITH_NUISANCES = 8  # attempts; a pole that hardly stands may fall with any, and then goes without
LARGE, SEEN = 0.05, 0.01  # of the mismatch, that an effect makes which is large, and which counts
BEYOND = 1.0  # standard deviations of the noise, by which one counts, too
FEWEST_LARGE, FEWEST_SEEN = 2, 4
DRIVEN = {
    "axis": REFERENCES,
    "rig": (*CLOSED_LOOP, "trapezoid", "multisine"),
    "servo": (*REFERENCES, "sines"),
    "car": ("tracking", "sweep", "sines", "controller"),
}
"""How a machine may be driven when it has one recording."""
BESIDES = {"axis": (), "rig": (FREE,), "servo": (FREE,), "car": ()}
"""And how in its other recordings, too."""
CHANGING = ("coulomb_friction", "viscous_friction", "parameter_offset")
"""Families of which one may be another in another recording: friction warms up, payloads are changed."""
SENSING = ("sensor_bias",)
"""Families that are another in every recording: zeros are set anew when a sensor is switched on."""


def machine_rank(number: int) -> int | None:
    """Which of the machines a trial is, from 0; None where it is none."""
    return number - MACHINES_FROM - 1 if MACHINES_FROM < number <= MACHINES_TO else None


def kind_of(number: int) -> str:
    """The class of a machine."""
    return KINDS[(machine_rank(number) or 0) % len(KINDS)]


def draw_machine(seed: int, number: int, attempt: int = 0) -> World | None:
    """The world of a machine; None where the attempt gave none with as many effects that count."""
    rng = np.random.default_rng([seed, number, attempt, 0])
    world = _world(seed, number, attempt, rng)
    if not counts(shares_of(world), world.effects):
        return None
    chosen = nuisances(seed, world, NUISANCES, LARGEST, rng)
    fewest = NUISANCES[0] if attempt < WITH_NUISANCES else 0
    return calibrated(world, chosen, Scales(world, pilot(world, ())), fewest)


def counts(shares: Shares | None, effects: Sequence[TrueEffect]) -> bool:
    """Whether as many effects make a share of the mismatch that counts, and as many a large one."""
    if shares is None or not shares.counts.any():
        return False
    own = [e for e in effects if not e.outside]
    made = np.array([shares.of(e) for e in own])
    seen = (made >= SEEN) | (np.array([shares.beyond(e) for e in own]) >= BEYOND)
    return bool(seen.sum() >= FEWEST_SEEN and (made >= LARGE).sum() >= FEWEST_LARGE)


def _world(seed: int, number: int, attempt: int, rng: np.random.Generator) -> World:
    """With its own effects alone."""
    kind = kind_of(number)
    system = SYSTEMS[PARTS[kind][0]]
    turn = np.random.default_rng([seed, number, MACHINES_FROM])  # the same in every attempt
    several, positions_only = turn.random() < SEVERAL, turn.random() < POSITIONS_ONLY
    upright = kind == "rig" and turn.random() < 0.5
    dt = float(rng.choice(STEPS[kind]))
    parameters = {n: float(f"{rng.uniform(*r):.3g}") for n, r in system.parameters.items()}
    effects = parts_of(kind, Sizes(rng, parameters, dt))
    sessions = _sessions(kind, dt, effects, several, upright, rng)
    level = str(rng.choice(list(LEVELS), p=list(LEVELS.values())))
    first = sessions[0]
    world = World(
        seed=seed, number=number, attempt=attempt, stratum="machines", long=False, system=system.name,
        parameters=parameters, integrator="rk4", dt=dt, engine="rk4", effects=effects, episodes=first.episodes,
        steps=first.steps, clock="session", excitation=first.excitation, posture=first.posture, noise_level=level,
        noise=_noise(system, level, rng), noise_known=bool(rng.random() < 0.3),
        velocities=None if system.vehicle else "differentiated" if positions_only else "measured",
        smoothing=str(rng.choice(["central", "savgol"])), wrapped=bool(rng.random() < 0.5), held_out=None,
    )  # fmt: skip
    bare = positions_only and not system.vehicle and bool(rng.random() < 0.5)
    world = replace(world, machine=Machine(kind, bare, sessions))
    return replace(world, rough=_log(world, rng))


def _noise(system: System, level: str, rng: np.random.Generator) -> Values:
    return {n: float(f"{sd * NOISE[level] * rng.uniform(0.5, 2.0):.3g}") for n, sd in system.sensors.items()}


def _log(world: World, rng: np.random.Generator) -> Rough:
    """The log of a rough world; only a car is seen by a camera, which swaps markers."""
    found = rough_log(world, world.effects, rng)
    return found if SYSTEMS[world.system].vehicle else replace(found, swapped=0.0, leap={})


def _sessions(
    kind: str,
    dt: float,
    effects: tuple[TrueEffect, ...],
    several: bool,
    upright: bool,
    rng: np.random.Generator,
) -> tuple[Session, ...]:
    """One recording, or two or three, each driven in another way if there is one."""
    count = int(rng.integers(2, 4)) if several else 1
    # Who balances does it by the controller that is there for it.
    first = [*CLOSED_LOOP] if upright else [*DRIVEN[kind]]
    ways = [str(rng.choice(first))]
    while len(ways) < count:
        others = [w for w in (*DRIVEN[kind], *BESIDES[kind]) if w not in ways]
        ways.append(str(rng.choice(others)))
    changed = _changed(effects, rng) if several and rng.random() < DIFFERS else None
    out = []
    for i, way in enumerate(ways):
        steps = int(rng.uniform(*LENGTH) / dt)
        wanted = float(np.exp(rng.uniform(*np.log(TRANSITIONS))))
        balances = upright and way in CLOSED_LOOP
        posture = ("upright" if balances else "hanging") if kind == "rig" else ""
        changes = _changes(effects, changed, rng) if i else {}
        clock = round(float(rng.uniform(0.0, 500.0)), 3) if several else 0.0
        zeros = _zeros(kind, rng) if several else {}
        episodes = max(round(wanted / steps), 5)
        out.append(Session(way, posture, episodes, max(int(wanted / episodes), 60), clock, zeros, changes))
    return tuple(out)


def _changed(effects: tuple[TrueEffect, ...], rng: np.random.Generator) -> str | None:
    names = [e.name for e in effects if e.family in CHANGING]
    return str(rng.choice(names)) if names else None


def _changes(
    effects: tuple[TrueEffect, ...], changed: str | None, rng: np.random.Generator
) -> dict[str, Values]:
    """What differs in another recording than the first."""
    out: dict[str, Values] = {}
    for e in effects:
        if e.name == changed:
            factor = float(rng.uniform(1.15, 1.4) if rng.random() < 0.5 else rng.uniform(0.7, 0.87))
            out[e.name] = {k: float(f"{v * factor:.4g}") for k, v in e.values.items()}
        elif e.family in SENSING:
            out[e.name] = {k: float(f"{v + rng.uniform(-0.04, 0.04):.4g}") for k, v in e.values.items()}
    return out


def _zeros(kind: str, rng: np.random.Generator) -> dict[str, float]:
    """Of a position on whose zero nothing depends."""
    channel = {"axis": "q", "rig": "x"}.get(kind)
    return {channel: float(f"{rng.uniform(-0.2, 0.2):.3g}")} if channel else {}
