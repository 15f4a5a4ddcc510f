"""Drawing plain worlds, and those of newer families, of curves and for plans: which world a number is.

The same seed and trial number give the same world. A deck says how many effects a trial has: every stratum in its
share, every family as often.

Worlds for plans: a pendulum that was recorded under slow waves, which leave something open. Gravity and viscous
friction, of which the base knows the first, bring it back to rest; one more effect is of those that slow motion hides
behind another.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue, out_of_catalogue
from gpsim.trials.bodies import native
from gpsim.trials.driving import BODY_SIGNALS, GRADED_SIGNALS, PLAYED, VEHICLE_SIGNALS
from gpsim.trials.out_of_catalogue import CURVES
from gpsim.trials.truth import run
from gpsim.trials.worlds import (
    FROM,
    SYSTEMS,
    Dial,
    Scales,
    Stratum,
    System,
    TrueEffect,
    Values,
    Velocities,
    World,
    log_even,
    numbered,
    rounded,
)  # fmt: skip

Rng = np.random.Generator
COUNTS: dict[Stratum, int] = {"single": 10, "pair": 5, "triple": 3, "none": 15, "unknown": 5}
LONG: tuple[Stratum, ...] = ("single", "none")  # two long worlds close every deck
DECK_SIZE = sum(COUNTS.values()) + len(LONG)
SIZE = {"single": 1, "pair": 2, "triple": 3, "none": 0, "unknown": 1, "words": 1, "curves": 1}
NOISE = {"clean": 0.02, "light": 0.3, "normal": 1.0, "heavy": 4.0}
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


def systems_of(family: str) -> list[str]:
    """The systems on which a family makes sense."""
    return [name for name, system in SYSTEMS.items() if places_of(family, system, "measured")]


def places_of(family: str, system: System, velocities: str | None) -> list[str]:
    """What a family, or a kind outside the catalogue, can act on in a system, so that a recording can show it."""
    return out_of_catalogue.LAWS[family].places(system, velocities)


def digits(value: float) -> float:
    """Three significant ones."""
    return float(f"{value:.3g}")


def noise_of(system: System, level: str, rng: Rng) -> Values:
    """Channel -> standard deviation, of sensors of that level."""
    return {n: digits(sd * NOISE[level] * rng.uniform(0.5, 2.0)) for n, sd in system.sensors.items()}


def stratum_of(number: int) -> tuple[Stratum, bool, int]:
    """Stratum of trial `number` (from 1), whether it is long, and its rank among those of its stratum."""
    kind, rank = numbered(number)
    if kind in ("words", "curves"):
        return "words" if kind == "words" else "curves", False, rank - 1
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
    apart = {
        "words": [name for name, word in catalogue.WORDS.items() if word.asked],
        "curves": CURVES,
        "unknown": out_of_catalogue.drawn(seed) if stratum == "unknown" else (),
    }
    names = sorted(apart.get(stratum, catalogue.DECK))
    cycle, place = divmod(rank, len(names))
    order = np.random.default_rng([seed, SIZE[stratum], stratum == "unknown", cycle]).permutation(len(names))
    return str(names[order[place]])


def draw(seed: int, number: int, attempt: int = 0) -> World:
    """The world of a trial; `attempt` counts worlds that could not be run (a cart-pole that fell at once)."""
    stratum, long, rank = stratum_of(number)
    rng = np.random.default_rng([seed, number, attempt, 0])
    family = first_family(seed, stratum, rank)
    named = list(SYSTEMS)[(rank + seed) % len(SYSTEMS)] if family is None else rng.choice(systems_of(family))
    system = SYSTEMS[str(named)]
    velocities: Velocities = None
    if not system.vehicle:
        able = rng.random() >= 0.6 and (family is None or bool(places_of(family, system, "differentiated")))
        velocities = "differentiated" if able else "measured"
    chosen = places(family, system, SIZE[stratum], velocities, rng)
    world = bare_world(seed, number, attempt, stratum, long, system, velocities, chosen, rng)
    scales = Scales(world, run(replace(world, engine="rk4"), (), world.dt / 4))
    world = with_effects(world, chosen, scales, (0.0, 1.0), rng)
    made = world.effects
    native_ones = not system.vehicle and all(
        not out_of_catalogue.LAWS[e.family].of_body or native(e) for e in made
    )
    # MuJoCo's friction yields for a step at every stop, which clean sensors would show as physics of its own.
    native_ones = native_ones and not (
        world.noise_level == "clean" and any(e.family in catalogue.GRIP for e in made)
    )
    return replace(world, engine="mujoco" if native_ones and rng.random() < WITH_MUJOCO else "rk4")


def places(
    family: str | None, system: System, size: int, velocities: str | None, rng: Rng
) -> list[tuple[str, str]]:
    """`size` families and what they act on, `family` first; no two that are alike."""
    return combined(family, size, catalogue.DECK, ALIKE, lambda f: places_of(f, system, velocities), rng)


def combined(
    family: str | None, size: int, others: Sequence[str], alike: Sequence[frozenset[str]],
    where: Callable[[str], list[str]], rng: Rng,
) -> list[tuple[str, str]]:  # fmt: skip
    """`size` families and places, `family` first, then any of the others that are possible there."""
    if family is None:
        return []
    chosen = [(family, str(rng.choice(where(family))))]
    able = [f for f in others if where(f)]
    while len(chosen) < size:
        other = str(rng.choice(able))
        taken = {f for f, _ in chosen}
        if other not in taken and not any(other in group and group & taken for group in alike):
            chosen.append((other, str(rng.choice(where(other)))))
    return chosen


def bare_world(
    seed: int, number: int, attempt: int, stratum: Stratum, long: bool, system: System, velocities: Velocities,
    effects: Sequence[tuple[str, str]], rng: Rng,
) -> World:  # fmt: skip
    """Everything but the effects' strengths and the engine."""
    dt = float(rng.choice(system.steps))
    low, high = (20_000, 60_000) if long else (2_000, 12_000)
    wanted = log_even(rng, low, high)
    steps = int(rng.uniform(120, 260) if system.vehicle else rng.uniform(160, 400))
    signals: tuple[str, ...] = VEHICLE_SIGNALS if system.vehicle else BODY_SIGNALS
    known = [out_of_catalogue.LAWS[f] for f, _ in effects]
    if any(f.needs_levels for f in known) and rng.random() < 0.85:
        signals = tuple(signal for signal in signals if signal in GRADED_SIGNALS)
    blind = {signal for f in known for signal in f.unseen_under}
    signals = tuple(signal for signal in signals if signal not in blind)
    level = str(rng.choice(list(NOISE)))
    noise = noise_of(system, level, rng)
    episodes = max(int(np.ceil(wanted / steps)), 5)
    hanging = attempt > 0 or rng.random() < 0.5
    runs_on = any(f.ages for f in known)
    return World(
        seed=seed, number=number, attempt=attempt, stratum=stratum, long=long, system=system.name,
        parameters={n: digits(rng.uniform(*r)) for n, r in system.parameters.items()},
        integrator=str(rng.choice(["euler", "semi_implicit", "rk4"], p=[0.4, 0.3, 0.3])),
        dt=dt, episodes=episodes, steps=steps, clock="session" if runs_on or rng.random() < 0.5 else "episode",
        excitation=str(rng.choice(signals)),
        posture=("hanging" if hanging else "upright") if system.name == "cartpole" else "",
        noise_level=level, noise=noise, noise_known=bool(rng.random() < 0.5), velocities=velocities,
        smoothing=str(rng.choice(["central", "savgol"])), wrapped=bool(rng.random() < 0.5),
        held_out=round(0.8 * episodes) if rng.random() < 0.5 else None,
    )  # fmt: skip


def with_effects(
    world: World, chosen: Sequence[tuple[str, str]], scales: Scales, dial: tuple[float, float], rng: Rng
) -> World:
    """The world with families, or kinds outside the catalogue, as strong as a dial says; at most one of them gated.

    Its clock runs on where an effect began at a moment.
    """
    made: list[TrueEffect] = []
    for name, on in chosen:
        strength = Dial(rng, float(rng.uniform(*dial)))
        made.append(effect(name, on, scales, strength, not any(e.gated for e in made), rng))
    dated = any(e.since is not None for e in made)
    return replace(world, effects=tuple(made), clock="session" if dated else world.clock)


def effect(family: str, on: str, scales: Scales, dial: Dial, may_gate: bool, rng: Rng) -> TrueEffect:
    """A family, or a kind outside the catalogue, on a place, as strong as the dial says; perhaps gated."""
    outer = family in out_of_catalogue.EVERY_KIND
    values = out_of_catalogue.LAWS[family].drawn(scales, on, dial)

    def region(channel: str) -> dict[str, tuple[float, float]]:
        """An interval that holds between a fifth and a half of the base run's samples, or is open to one side."""
        share, low = float(rng.uniform(0.2, 0.5)), float(rng.uniform(0.05, 0.45))
        left, right = np.quantile(scales.column(channel), [low, low + share])
        return {channel: (digits(left), digits(right))}

    if family == "local_friction_patch":
        return TrueEffect(family, on, values, region(on), None, outer, dial.level)
    where, since = {}, None
    if may_gate and family in DATED and rng.random() < GATED:
        if family in REGIONAL and rng.random() < 0.5:
            axes = SYSTEMS[scales.world.system].coordinates
            where = region(on if on in axes else str(rng.choice(axes or ("x", "y"))))
        else:
            since = round(float(rng.uniform(0.25, 0.75)) * scales.wall, 2)
    return TrueEffect(family, on, values, where, since, outer, dial.level)


DT, SECONDS = 0.02, 30.0  # of the first recording
SWAY = 0.6  # rad, how far slow waves move it
SLOW, SLOWER = (0.05, 0.12), (0.02, 0.05)  # Hz of the two waves
DAMPING = (0.1, 0.3)  # of the critical one
FAR = 1.5  # times the sway, that it may go
HIDDEN: Mapping[str, Callable[[float, float, Dial], dict[str, float]]] = {
    "actuator_delay": lambda push, speed, d: {"delay": _even(d.size(0.02, 0.06))},
    "actuator_lag": lambda push, speed, d: {"time_constant": d.size(0.02, 0.08)},
    "sensor_delay": lambda push, speed, d: {"delay": _even(d.size(0.02, 0.05))},
    "coulomb_friction": lambda push, speed, d: {"force": rounded(d.size(0.02, 0.15) * push)},
    "quadratic_drag": lambda push, speed, d: {"drag": rounded(d.size(0.1, 0.8) * push / speed**2)},
    "actuator_dead_zone": lambda push, speed, d: {"width": rounded(d.size(0.03, 0.15) * push)},
    "actuator_gain": lambda push, speed, d: {"gain": d.ratio(0.05, 0.25)},
    "parameter_offset": lambda push, speed, d: {"ratio": d.ratio(0.05, 0.25)},
}
"""Family -> its parameters, of the largest command, the largest speed, and a dial."""


def draw_plan(seed: int, number: int) -> World:
    """The world: every hidden effect in turn, in an order of the seed's own."""
    cycle, place = divmod(numbered(number)[1] - 1, len(HIDDEN))
    family = list(HIDDEN)[np.random.default_rng([seed, FROM["plans"], cycle]).permutation(len(HIDDEN))[place]]
    rng, system = np.random.default_rng([seed, number, 0]), SYSTEMS["pendulum"]
    p = {n: digits(rng.uniform(*r)) for n, r in system.parameters.items()}
    level = str(rng.choice(("normal", "heavy")))
    noise = noise_of(system, level, rng)
    world = World(
        seed=seed, number=number, attempt=0, stratum="plans", system=system.name, parameters=p, dt=DT, episodes=1,
        steps=round(SECONDS / DT), excitation=PLAYED, noise_level=level, noise=noise,
        noise_known=bool(rng.random() < 0.5), velocities="measured", smoothing="central",
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
    """In whole fine steps of a world (see `concealing`)."""
    return round(round(seconds / 0.002) * 0.002, 3)
