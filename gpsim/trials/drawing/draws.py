"""How many effects a trial has, and which family comes first: every stratum in its share, every family as often."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, cast

import numpy as np

from gpsim.trials import catalogue, outside
from gpsim.trials.drawing.nuisances import of_body, places_of, systems_of
from gpsim.trials.truth import native, run
from gpsim.trials.worlds import (
    BODY_SIGNALS,
    GRADED_SIGNALS,
    SYSTEMS,
    VEHICLE_SIGNALS,
    Dial,
    Scales,
    Stratum,
    System,
    TrueEffect,
    World,
)

COUNTS: dict[Stratum, int] = {"single": 10, "pair": 5, "triple": 3, "none": 15, "unknown": 5}
LONG: tuple[Stratum, ...] = ("single", "none")  # two long worlds close every deck
DECK_SIZE = sum(COUNTS.values()) + len(LONG)
SIZE = {"single": 1, "pair": 2, "triple": 3, "none": 0, "unknown": 1, "words": 1, "curves": 1}
WORDS_FROM = 50_000
"""Behind it are the numbers of worlds with one of the newer families each; decks never come that far."""
CURVES_FROM = 75_000
"""Behind it are the numbers of worlds with a law of one input that no family has."""


def stratum_of(number: int) -> tuple[Stratum, bool, int]:
    """Stratum of trial `number` (from 1), whether it is long, and its rank among those of its stratum."""
    if number > CURVES_FROM:
        return "curves", False, number - CURVES_FROM - 1
    if number > WORDS_FROM:
        return "words", False, number - WORDS_FROM - 1
    deck, place = divmod(number - 1, DECK_SIZE)
    cards: list[Stratum] = [s for s, count in COUNTS.items() for _ in range(count)]
    # Interleaved by a fixed stride that shares no factor with the deck, so that every part of a proof holds all.
    shuffled = [cards[(17 * i + 5) % len(cards)] for i in range(len(cards))] + list(LONG)
    stratum = shuffled[place]
    per_deck = COUNTS[stratum] + LONG.count(stratum)
    return stratum, place >= len(cards), deck * per_deck + shuffled[:place].count(stratum)


def first_family(seed: int, stratum: Stratum, rank: int) -> str | None:
    """The first effect of a world: each family (or kind) once in every cycle, cycles in an order of their own."""
    if stratum == "none":
        return None
    names = list(catalogue.DECK)
    if stratum == "words":
        names = sorted(name for name, word in catalogue.WORDS.items() if word.asked)
    if stratum == "curves":
        names = sorted(outside.CURVES)
    if stratum == "unknown":
        names = sorted(outside.drawn(seed))
    cycle, place = divmod(rank, len(names))
    order = np.random.default_rng([seed, SIZE[stratum], stratum == "unknown", cycle]).permutation(len(names))
    return str(names[order[place]])


NOISE = {"clean": 0.02, "light": 0.3, "normal": 1.0, "heavy": 4.0}
NEEDS_LEVELS = (
    "actuator_dead_zone",
    "actuator_saturation",
    "actuator_backlash",
    *(name for name, kind in outside.EVERY_KIND.items() if kind.needs_levels),
    *(name for name, word in catalogue.WORDS.items() if word.needs_levels),
)
REGIONAL = ("viscous_friction", "quadratic_drag", "constant_force", "actuator_gain", "actuator_bias")
DATED = (
    *REGIONAL, "coulomb_friction", "spring", "parameter_offset", "actuator_dead_zone", "actuator_saturation",
    "understeer", "steering_bias", "lateral_slip", "minimum_turning_radius",
)  # fmt: skip
GATED = 0.3  # share of the effects that could act in a region or since a moment and do
WITH_MUJOCO = 0.6  # share of the worlds that MuJoCo can play, and does
ALIKE: tuple[frozenset[str], ...] = (
    frozenset({"coulomb_friction", "stribeck_friction", "local_friction_patch"}),
    frozenset({"actuator_gain", "actuator_asymmetry", "battery_sag", "parameter_offset", "sensor_scale"}),
    frozenset({"constant_force", "actuator_bias", "sensor_bias", "spring"}),
    frozenset({"actuator_delay", "sensor_delay"}),
    frozenset({"frame_rotation", "sensor_bias", "marker_offset"}),
)
"""Two of a group do the same thing to a system with other numbers: they never share a world, whatever they act on."""


def draw(seed: int, number: int, attempt: int = 0) -> World:
    """The world of a trial; `attempt` counts worlds that could not be run (a cart-pole that fell at once)."""
    stratum, long, rank = stratum_of(number)
    rng = np.random.default_rng([seed, number, attempt, 0])
    family = first_family(seed, stratum, rank)
    system = SYSTEMS[_system(family, seed, rank, rng)]
    velocities = _velocities(family, system, rng)
    effects = places(family, system, SIZE[stratum], velocities, rng)
    world = bare_world(seed, number, attempt, stratum, long, system, velocities, effects, rng)
    scales = Scales(world, run(replace(world, engine="rk4"), (), world.dt / 4))
    made: list[TrueEffect] = []
    for name, on in effects:
        gates_left = not any(e.gated for e in made)
        made.append(effect(name, on, scales, Dial(rng, float(rng.uniform())), gates_left, rng))
    dated = any(e.since is not None for e in made)
    world = replace(world, effects=tuple(made), clock="session" if dated else world.clock)
    able = not system.vehicle and all(not of_body(e.family) or native(e) for e in made)
    # MuJoCo's friction yields for a step at every stop, which clean sensors would show as physics of its own.
    able = able and not (world.noise_level == "clean" and any(e.family in catalogue.GRIP for e in made))
    engine: Literal["rk4", "mujoco"] = "mujoco" if able and rng.random() < WITH_MUJOCO else "rk4"
    return replace(world, engine=engine)


def _system(family: str | None, seed: int, rank: int, rng: np.random.Generator) -> str:
    names = list(SYSTEMS) if family is None else systems_of(family)
    return names[(rank + seed) % len(names)] if family is None else str(rng.choice(names))


def _velocities(
    family: str | None, system: System, rng: np.random.Generator
) -> Literal["measured", "differentiated"] | None:
    if system.vehicle:
        return None
    differentiated = rng.random() >= 0.6 and (
        family is None or bool(places_of(family, system, "differentiated"))
    )
    return "differentiated" if differentiated else "measured"


def places(
    family: str | None,
    system: System,
    size: int,
    velocities: str | None,
    rng: np.random.Generator,
) -> list[tuple[str, str]]:
    """`size` families and what they act on, `family` first; no two that are alike."""
    if family is None:
        return []
    chosen = [(family, str(rng.choice(places_of(family, system, velocities))))]
    others = [f for f in catalogue.DECK if places_of(f, system, velocities)]
    while len(chosen) < size:
        other = str(rng.choice(others))
        taken = [f for f, _ in chosen]
        if other not in taken and not any(other in g and g & set(taken) for g in ALIKE):
            chosen.append((other, str(rng.choice(places_of(other, system, velocities)))))
    return chosen


def bare_world(
    seed: int,
    number: int,
    attempt: int,
    stratum: Stratum,
    long: bool,
    system: System,
    velocities: Literal["measured", "differentiated"] | None,
    effects: Sequence[tuple[str, str]],
    rng: np.random.Generator,
) -> World:
    """Everything but the effects' strengths and the engine."""
    dt = float(rng.choice(system.steps))
    low, high = (20_000, 60_000) if long else (2_000, 12_000)
    wanted = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    steps = int(rng.uniform(120, 260) if system.vehicle else rng.uniform(160, 400))
    signals: tuple[str, ...] = VEHICLE_SIGNALS if system.vehicle else BODY_SIGNALS
    if any(f in NEEDS_LEVELS for f, _ in effects) and rng.random() < 0.85:
        signals = tuple(signal for signal in signals if signal in GRADED_SIGNALS)
    blind = {
        signal for f, _ in effects if f in outside.EVERY_KIND for signal in outside.EVERY_KIND[f].unseen_under
    }
    signals = tuple(signal for signal in signals if signal not in blind)
    level = str(rng.choice(list(NOISE)))
    noise = {n: float(f"{sd * NOISE[level] * rng.uniform(0.5, 2.0):.3g}") for n, sd in system.sensors.items()}
    episodes = max(int(np.ceil(wanted / steps)), 5)
    hanging = attempt > 0 or rng.random() < 0.5
    ages = {"battery_sag", *(name for name, word in catalogue.WORDS.items() if word.ages)}
    runs_on = not ages.isdisjoint(f for f, _ in effects)
    return World(
        seed=seed, number=number, attempt=attempt, stratum=stratum, long=long, system=system.name,
        parameters={n: float(f"{rng.uniform(*r):.3g}") for n, r in system.parameters.items()},
        integrator=str(rng.choice(["euler", "semi_implicit", "rk4"], p=[0.4, 0.3, 0.3])),
        dt=dt, engine="rk4", effects=(), episodes=episodes, steps=steps,
        clock="session" if runs_on or rng.random() < 0.5 else "episode",
        excitation=str(rng.choice(signals)),
        posture=("hanging" if hanging else "upright") if system.name == "cartpole" else "",
        noise_level=level, noise=noise, noise_known=bool(rng.random() < 0.5), velocities=velocities,
        smoothing=str(rng.choice(["central", "savgol"])), wrapped=bool(rng.random() < 0.5),
        held_out=round(0.8 * episodes) if rng.random() < 0.5 else None,
    )  # fmt: skip


def effect(
    family: str, on: str, scales: Scales, dial: Dial, may_gate: bool, rng: np.random.Generator
) -> TrueEffect:
    """A family, or a kind outside the catalogue, on a place, as strong as the dial says; perhaps gated."""
    outer = family in outside.EVERY_KIND
    strength = outside.EVERY_KIND[family].drawn if outer else catalogue.STRENGTHS[family]
    values = strength(scales, on, dial)
    region: dict[str, tuple[float, float]] = {}
    since = None
    if family == "local_friction_patch":
        region = _region(on, scales, rng)
    elif may_gate and family in DATED and rng.random() < GATED:
        if family in REGIONAL and rng.random() < 0.5:
            system = SYSTEMS[scales.world.system]
            where = on if on in system.coordinates else str(rng.choice(system.coordinates or ("x", "y")))
            region = _region(where, scales, rng)
        else:
            since = round(float(rng.uniform(0.25, 0.75)) * scales.wall, 2)
    return TrueEffect(family, on, values, region, since, outer, dial.level)


def _region(channel: str, scales: Scales, rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    """An interval that holds between a fifth and a half of the base run's samples, or is open to one side."""
    share, low = float(rng.uniform(0.2, 0.5)), float(rng.uniform(0.05, 0.45))
    values = scales.column(channel)
    edges = np.quantile(values, [low, low + share])
    return {channel: cast(tuple[float, float], tuple(float(f"{e:.3g}") for e in edges))}
