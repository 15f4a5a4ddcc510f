"""Laws of one input that no family has: random smooth functions at every site of a simulator's chain.

They are what measured curves are proved on, and no other worlds hold them. Along a line a law is a sum of three
sigmoids; around an angle it is a sum of harmonics. A law that the catalogue follows, alone or by two of its laws
together, is drawn anew.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any, ClassVar

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.trials.outside_kind import Actuator, Distortion, Draw, Force, Kind, Twist
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


class FreeCurve(Kind):
    """What such laws share. quantity: the family that a measured curve of it has."""

    quantity: ClassVar[str]

    @classmethod
    def input_of(cls, on: str, system: str) -> str:
        """The channel or command that it is a function of."""
        return on

    def adds(self, x: FloatArray) -> FloatArray:
        """What it adds to what the base simulator makes of its input."""
        return smooth(self.k, x)


class FreeForceOfSpeed(FreeCurve, Force, quantity="force_curve"):
    """A force of the coordinate's own speed."""

    @classmethod
    def input_of(cls, on: str, system: str) -> str:
        names = SYSTEMS[system].names
        return names[names.index(on) + 1]

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return self.adds(v)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        x = s.column(FreeForceOfSpeed.input_of(on, s.world.system))
        return drawn_law(x, d.size(0.15, 0.5) * s.force(on), False, d)


class FreeForceOfPosition(FreeCurve, Force, quantity="force_curve"):
    """A force of the coordinate's own position."""

    strength: ClassVar[Draw] = lambda s, on, d: drawn_law(
        s.column(on), d.size(0.15, 0.5) * s.force(on), _is_angle(s, on), d
    )

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return self.adds(q)


class FreeCommand(FreeCurve, Actuator, quantity="actuator_curve", needs_levels=True):
    """What reaches the body is the command and a function of it."""

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        return np.asarray(u + self.adds(u))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        u = s.command(on)
        return drawn_law(u, d.size(0.1, 0.4) * float(np.sqrt(np.mean(u**2))), False, d)


class FreeReading(FreeCurve, Distortion, quantity="sensor_curve"):
    """What is read is the true value and a function of it."""

    strength: ClassVar[Draw] = lambda s, on, d: drawn_law(
        s.column(on), d.size(0.04, 0.15) * min(s.reach(on), 1.0), _is_angle(s, on), d
    )

    def read(self, y: FloatArray) -> FloatArray:
        return np.asarray(y + self.adds(y))


class FreeTurn(FreeCurve, Twist, quantity="rate_curve", needs_levels=True):
    """Curvature by a function of the speed: w (1 + f(v))."""

    strength: ClassVar[Draw] = lambda s, on, d: drawn_law(s.command("v_cmd"), d.size(0.1, 0.4), False, d)

    @classmethod
    def input_of(cls, on: str, system: str) -> str:
        return "v"

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v, np.asarray(w * (1.0 + self.adds(v)))


def _is_angle(s: Scales, channel: str) -> bool:
    return SYSTEMS[s.world.system].state[channel] == "rad"


def true_curve(world: World, truth: Run) -> dict[str, Any] | None:
    """What answer.json says of the law; None of a world without one.

    family: of a curve of it; input: its channel; at: values of the input that were visited, evenly by how often; adds:
    what the law adds there to what the base makes of it. second: the turn rates (rad/s) of a law of a vehicle's speed.
    """
    (effect,) = world.effects if len(world.effects) == 1 else (None,)
    kind = None if effect is None else Kind.listed.get(effect.family)
    if effect is None or kind is None or not issubclass(kind, FreeCurve):
        return None
    law, system = kind(effect.values), SYSTEMS[world.system]
    channel = law.input_of(effect.on, system.name)
    if isinstance(law, Twist):
        rows = truth.commands.reshape(-1, truth.commands.shape[2])
        v, w = rows[np.linspace(0, len(rows) - 1, VISITED).astype(int)].T
        told = {"at": v, "adds": law.twist(v, w, np.zeros((len(v), 3)))[1] - w, "second": w}
    else:
        if channel in system.action:
            visited = truth.commands[..., list(system.action).index(channel)].ravel()
        else:
            visited = truth.sampled[:-1, :, system.names.index(channel)].ravel()
            visited = wrap_angle(visited) if system.state[channel] == "rad" else visited
        x = np.asarray(np.quantile(visited, np.linspace(EDGE, 1.0 - EDGE, VISITED)))
        told = {"at": x, "adds": law.adds(x)}
    values = {key: [float(f"{value:.6g}") for value in column] for key, column in told.items()}
    return {"family": law.quantity, "input": channel, **values}
