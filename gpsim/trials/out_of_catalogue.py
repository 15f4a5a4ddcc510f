"""Physics outside the catalogue: kinds that no family of `gpsim.effects` described when they were written.

A kind that has become a word since says so (`word`): who names it is right. Kinds stand in the tables of
`out_of_catalogue_forces` and `out_of_catalogue_chain`. `since` of a new one must be a seed of which no world has been
drawn yet, or published proofs could not be repeated. Twenty kinds a measurement: ten for every seed, ten that are new
to it. Nothing here is shared with `gpsim.effects`.

Laws of one input that no family has (CURVES), random smooth functions at every site of a simulator's chain, are what
measured curves are proved on, and no other worlds hold them. Along a line a law is a sum of three sigmoids; around an
angle it is a sum of harmonics. A law that the catalogue follows, alone or by two of its laws together, is drawn anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.trials import catalogue
from gpsim.trials.catalogue import EVERY, VEHICLE, Draw, Family, Site
from gpsim.trials.out_of_catalogue_chain import OF_CHAINS
from gpsim.trials.out_of_catalogue_forces import OF_BODIES
from gpsim.trials.worlds import SYSTEMS, Dial, Run, Scales, Values, World, rounded

SIGMOIDS, HARMONICS = 3, (2, 3, 4)  # a single harmonic of an angle is gravity's
MISSES = 0.025  # of what a law does, on squares, that the nearest laws of the catalogue must miss
TRIES, PLACES = 60, 400  # laws that are drawn; inputs at which they are looked at
STEADY_TRIES = (
    30  # after which a law that rises throughout may turn: few odd ones are far from the catalogue's
)
WIDTHS = {
    False: (0.08, 0.35),
    True: (0.05, 0.15),
}  # of a step, of a law that may turn and of one that does not
BENDS = (0.3, 0.7, 1.2)  # of the reach: where laws that begin somewhere are looked at
VISITED = 201  # inputs at which the law is told, as often where the recording was more often
EDGE = 0.005  # of all samples on either side, that are left out


def smooth(k: Values, x: FloatArray) -> FloatArray:
    """The law: 0 at 0 along a line; with `mirror` the same to both sides, with the other sign."""
    if "reach" not in k:
        waves = (k[f"a{i}"] * np.sin(n * x + k[f"c{i}"]) for i, n in enumerate(HARMONICS))
        return np.asarray(k["size"] * sum(waves, np.zeros_like(x)))

    def along(z: FloatArray) -> FloatArray:
        steps = (k[f"a{i}"] * np.tanh((z - k[f"c{i}"]) / k[f"w{i}"]) for i in range(SIGMOIDS))
        return np.asarray(sum(steps, np.zeros_like(z)))

    z = x / k["reach"]
    return k["size"] * (along(z) - along(-z if k["mirror"] else np.zeros_like(z)))


def drawn_law(x: FloatArray, rms: float, angle: bool, d: Dial) -> dict[str, float]:
    """A law that does `rms` over inputs x and that no two laws of the catalogue follow there.

    Along a line half are odd, and a third to a half rise or fall throughout.
    """
    x = x[:: max(len(x) // PLACES, 1)]
    steady, mirror = d.sign() > 0, d.sign() > 0
    best, most = {"size": 0.0}, -1.0
    for tried in range(TRIES):
        steady = steady and tried < STEADY_TRIES
        k = {"size": 1.0}
        if angle:
            for i in range(len(HARMONICS)):
                k |= {f"a{i}": d.any(0.5, 1.0), f"c{i}": d.any(0.0, 6.28)}
        else:
            first = d.sign()
            k |= {"reach": rounded(float(np.quantile(np.abs(x), 0.9))), "mirror": float(mirror)}
            for i in range(SIGMOIDS):
                size = first * (1.0 if steady or i % 2 == 0 else -1.0) * d.any(0.4, 1.0)
                k |= {f"a{i}": size, f"c{i}": d.any(-0.9, 0.9), f"w{i}": d.any(*WIDTHS[steady])}
        does = smooth(k, x)
        k["size"] = rounded(rms / max(float(np.sqrt(np.mean(does**2))), 1e-12))
        misses = missed(x, does, angle)
        if misses > most:
            best, most = k, misses
        if misses > MISSES:
            break
    return best


def missed(x: FloatArray, law: FloatArray, angle: bool = False) -> float:
    """The share of what a law does, on squares, that the two nearest shapes of the catalogue together miss."""
    size, least = float(np.sum(law**2)), 1.0
    for pair in combinations(_shapes(x, angle), 2):
        basis = np.concatenate(pair, axis=1)
        rest = law - basis @ np.linalg.lstsq(basis, law, rcond=None)[0]
        least = min(least, float(np.sum(rest**2)) / max(size, 1e-300))
    return least


def _shapes(x: FloatArray, angle: bool) -> list[FloatArray]:
    """(N, .) each: shapes that the catalogue's laws have, of every site."""
    sign, reach = np.sign(x), max(float(np.quantile(np.abs(x), 0.9)), 1e-300)
    columns = [np.ones_like(x), x, sign, x * np.abs(x), x**3]
    for edge in (bend * reach for bend in BENDS):
        columns += [
            np.clip(x, -edge, edge), np.where(np.abs(x) < edge, 0.0, x), sign * np.exp(-((x / edge) ** 2)),
            np.maximum(x - edge, 0.0), np.minimum(x + edge, 0.0),
        ]  # fmt: skip
    out = [c[:, None] for c in columns] + [np.stack([np.maximum(x, 0.0), np.minimum(x, 0.0)], axis=1)]
    waves = [1.0, *HARMONICS] if angle else [np.pi * n / reach for n in (0.5, 1.0, 1.5, 2.0)]
    return out + [np.stack([np.sin(n * x), np.cos(n * x)], axis=1) for n in waves]


@dataclass(frozen=True, kw_only=True)
class Curve(Family):
    """Such a law. quantity: the family of a measured curve of it; input_of(on, system): what it is a function of."""

    quantity: str = ""
    input_of: Callable[[str, str], str] = lambda on, system: on


def _speed_of(on: str, system: str) -> str:
    names = SYSTEMS[system].names
    return names[names.index(on) + 1]


def _drawn_force(channel: Callable[[str, str], str], angles: bool) -> Draw:
    def draw(s: Scales, on: str, d: Dial) -> dict[str, float]:
        x = s.column(channel(on, s.world.system))
        return drawn_law(x, d.size(0.15, 0.5) * s.force(on), angles and _is_angle(s, on), d)

    return draw


def _drawn_command(s: Scales, on: str, d: Dial) -> dict[str, float]:
    u = s.command(on)
    return drawn_law(u, d.size(0.1, 0.4) * float(np.sqrt(np.mean(u**2))), False, d)


CURVES: Mapping[str, Curve] = {
    # A force of the coordinate's own speed.
    "free_force_of_speed": Curve(
        site="force", law=lambda k, q, v, t: smooth(k, v), draw=_drawn_force(_speed_of, False),
        quantity="force_curve", input_of=_speed_of,
    ),
    # A force of the coordinate's own position.
    "free_force_of_position": Curve(
        site="force", law=lambda k, q, v, t: smooth(k, q), draw=_drawn_force(lambda on, system: on, True),
        quantity="force_curve",
    ),
    # What reaches the body is the command and a function of it.
    "free_command": Curve(
        site="actuator", law=lambda k, u, s, t, h: u + smooth(k, u), draw=_drawn_command, systems=EVERY,
        quantity="actuator_curve", needs_levels=True,
    ),
    # What is read is the true value and a function of it.
    "free_reading": Curve(
        site="distortion", law=lambda k, y: y + smooth(k, y), systems=EVERY, quantity="sensor_curve",
        draw=lambda s, on, d: drawn_law(s.column(on), d.size(0.04, 0.15) * min(s.reach(on), 1.0), _is_angle(s, on), d),
    ),
    # Curvature by a function of the speed: w (1 + f(v)).
    "free_turn": Curve(
        site="twist after", law=lambda k, v, w, s: (v, w * (1.0 + smooth(k, v))), systems=VEHICLE, on=("vehicle",),
        draw=lambda s, on, d: drawn_law(s.command("v_cmd"), d.size(0.1, 0.4), False, d), quantity="rate_curve",
        input_of=lambda on, system: "v", needs_levels=True,
    ),
}  # fmt: skip


def _is_angle(s: Scales, channel: str) -> bool:
    return SYSTEMS[s.world.system].state[channel] == "rad"


def true_curve(world: World, truth: Run) -> dict[str, Any] | None:
    """What answer.json says of the law; None of a world without one.

    family: of a curve of it; input: its channel; at: values of the input that were visited, evenly by how often; adds:
    what the law adds there to what the base makes of it. second: the turn rates (rad/s) of a law of a vehicle's speed.
    """
    (effect,) = world.effects if len(world.effects) == 1 else (None,)
    if effect is None or effect.family not in CURVES:
        return None
    curve, system, k = CURVES[effect.family], SYSTEMS[world.system], effect.values
    channel = curve.input_of(effect.on, system.name)
    if curve.site == "twist after":
        rows = truth.commands.reshape(-1, truth.commands.shape[2])
        v, w = rows[np.linspace(0, len(rows) - 1, VISITED).astype(int)].T
        told = {"at": v, "adds": w * (1.0 + smooth(k, v)) - w, "second": w}
    else:
        if channel in system.action:
            visited = truth.commands[..., list(system.action).index(channel)].ravel()
        else:
            visited = truth.sampled[:-1, :, system.names.index(channel)].ravel()
            visited = wrap_angle(visited) if system.state[channel] == "rad" else visited
        x = np.asarray(np.quantile(visited, np.linspace(EDGE, 1.0 - EDGE, VISITED)))
        told = {"at": x, "adds": smooth(k, x)}
    values = {key: [float(f"{value:.6g}") for value in column] for key, column in told.items()}
    return {"family": curve.quantity, "input": channel, **values}


TUNING = range(1, 100)
"""Seeds that tuning may use."""
REVEALED = 2031
"""The last seed whose measurement is published."""
KINDS: Mapping[str, Family] = {**OF_CHAINS, **OF_BODIES}
EVERY_KIND: Mapping[str, Family] = {**KINDS, **CURVES}
LAWS: Mapping[str, Family] = {**catalogue.FAMILIES, **EVERY_KIND}
"""Every family and every kind."""


def at_site(site: Site) -> dict[str, Callable[..., Any]]:
    """The laws of the kinds that act at a site."""
    return catalogue.at_site(site, EVERY_KIND)


def drawn(seed: int) -> dict[str, Family]:
    """The kinds that a seed may draw: those for every seed, and the newest that began with it or before it.

    Seeds for tuning draw those for every seed alone. So half of the kinds of a measurement can run for the first time,
    and the worlds of a seed stay what they are when kinds are added with a later `since`.
    """
    begun = [kind.since for kind in KINDS.values() if kind.since is not None and kind.since <= seed]
    newest = None if seed in TUNING else max(begun)
    return {name: kind for name, kind in KINDS.items() if kind.since in (None, newest)}


def nuisances(seed: int) -> dict[str, Family]:
    """The kinds that a seed's rough worlds may hold beside their main effects: those it draws.

    Seeds for tuning may hold every kind of the measurements that were revealed, too.
    """
    if seed in TUNING:
        return {name: kind for name, kind in KINDS.items() if kind.since is None or kind.since <= REVEALED}
    return drawn(seed)
