"""Families that worlds of the stratum `words` hold, each with its law and how strong it is drawn.

Worlds of older seeds hold the families of `laws` alone, so that they stay what they were.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import Dial, Scales, Values, rounded

Systems = tuple[str, ...]
MECHANICAL: Systems = ("cartpole", "slider", "pendulum")
DRIVEN = {"cartpole": "x", "slider": "q", "pendulum": "theta"}
"""The coordinate that a system's command drives."""
Draw = Callable[[Scales, str, Dial], dict[str, float]]


@dataclass(frozen=True)
class Word:
    """One family.

    law: of a force (k, q, v); of a grip (k, v, load); of bristles (k, v, bend, inertia), the force and how fast they
    bend; of an actuator (k, u, speed of what it drives); of a twist (k, v, lateral, w); of a sensor (k, y); of one
    that remembers, `past`, (k, all true values of its channel until now (K, E), the time between two of them [s]). Of
    commands: an actuator with memory, made of k. Of a coupling: (k, v, z, u), the force on what the command u drives,
    and how fast z moves, the twist and the motor's speed. by_command: a grip's load is the command's size.
    needs_levels: only commands of many values show it; needs_speeds: only where speeds are measured beside positions;
    ages: only a clock that runs on. asked: are worlds drawn with it? (With bristles, which are asked on request, too.)
    """

    site: Literal["smooth", "grip", "bristles", "actuator", "commands", "coupling", "twist", "sensor", "past"]
    law: Callable[..., Any]
    strength: Draw
    systems: Systems = MECHANICAL
    by_command: bool = False
    needs_levels: bool = False
    needs_speeds: bool = False
    ages: bool = False
    asked: bool = True


def _dead_band(k: Values, u: FloatArray, speed: FloatArray) -> FloatArray:
    return np.where(u > k["width"], u - k["width"], np.where(u < -k["width"], u + k["width"], 0.0))


def _torque_line(k: Values, u: FloatArray, speed: FloatArray) -> FloatArray:
    """A motor that pushes with the motion has what its line leaves, one that brakes what it has at standstill."""
    slower = np.abs(speed) / k["no_load_speed"]
    most = np.where(u * speed > 0, k["stall"] * np.maximum(1.0 - slower, 0.0), k["stall"])
    return np.asarray(np.sign(u) * np.minimum(np.abs(u), most))


def _torque_line_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    speed = s.speed(DRIVEN[s.world.system])
    return {
        "stall": rounded(s.action(on) * d.any(0.9, 1.3)),
        "no_load_speed": rounded(speed * (4.5 - d.size(1.0, 3.0))),
    }


def _slowed(
    k: Values, v: FloatArray, lateral: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The way stays the same: speed and turn rate fall together."""
    loss = 1.0 + k["drag"] * np.square(v * w)
    return v / loss, lateral, w / loss


def _cogging_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {
        "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)),
        "period": rounded(4 * s.reach(on) / d.any(3, 9)),
        "phase": d.any(-3, 3),
    }


def _cubic_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    force, reach = s.force(on), s.reach(on)
    return {
        "stiffness": rounded(d.any(0.05, 0.3) * force / reach),
        "cubic": rounded(d.size(0.1, 0.6) * force / reach**3),
        "rest_position": rounded(float(np.mean(s.column(on))) + d.any(-0.4, 0.4) * reach),
    }


def _stops(k: Values, q: FloatArray, v: FloatArray) -> FloatArray:
    """Two springs with dampers; neither pulls."""
    push = np.zeros_like(q)
    for edge, side in ((k["low"], -1.0), (k["high"], 1.0)):
        depth, into = side * (q - edge), side * v
        push -= np.where(depth > 0, side * np.maximum(k["stiffness"] * depth + k["damping"] * into, 0.0), 0.0)
    return push


def _stops_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that the outer tenth to third of the way is beyond an edge; stiff enough to turn the body round there."""
    share, q = d.size(0.04, 0.15), s.column(on)
    low, high = (float(edge) for edge in np.quantile(q, [share, 1.0 - share]))
    return {
        "low": rounded(low),
        "high": rounded(high),
        "stiffness": rounded(d.any(8, 40) * s.force(on) / (high - low)),
        "damping": rounded(d.any(0.1, 0.5) * s.force(on) / s.speed(on)),
    }


def _wheels(
    k: Values, v: FloatArray, lateral: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Each of two wheels is clipped by itself."""
    arms = np.array([-0.5, 0.5])[:, None] * k["track"]
    inner, outer = np.clip(v + arms * w, -k["limit"], k["limit"])
    return (inner + outer) / 2.0, lateral, (outer - inner) / k["track"]


def _range_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that the outer twentieth to quarter of the readings stand at an end."""
    share = d.size(0.03, 0.12)
    low, high = (float(end) for end in np.quantile(s.column(on), [share, 1.0 - share]))
    return {"low": rounded(low), "high": rounded(high)}


def bristles(
    k: Values, v: FloatArray, bend: FloatArray, inertia: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(B,) force and rate of bend of friction with bristles, damped by sqrt(stiffness inertia)."""
    rest = k.get("static_force", k["force"])
    level = k["force"] + (rest - k["force"]) * np.exp(-np.square(v / k.get("stribeck_velocity", 1.0)))
    rate = v - np.abs(v) * bend * k["stiffness"] / level
    return -k["stiffness"] * bend - np.sqrt(k["stiffness"] * inertia) * rate, rate


def _bristles_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """They bend by a twentieth of the way or less; in half of the worlds they grip more at rest."""
    force, way = d.size(0.15, 0.6) * s.force(on), d.any(0.015, 0.06) * s.reach(on)
    out = {"force": rounded(force), "stiffness": rounded(force / way)}
    if d.rng.random() < 0.5:
        rest, slow = rounded(force * d.any(1.4, 2.2)), rounded(d.any(0.1, 0.3) * s.speed(on))
        out |= {"static_force": rest, "stribeck_velocity": slow}
    return out


def _coupled(k: Values, v: FloatArray, z: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Newton's law for the motor; v is the load's speed."""
    ahead = z[:, 1] - v
    pull = k["stiffness"] * z[:, 0] + k["damping"] * ahead
    return pull, np.stack([ahead, (u - pull) / k["inertia"]], axis=1)


def _coupling_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Motor and load swing against each other at 1.5 to 4 Hz, damped by 2 to 15 %."""
    load, turn = s.inertia(DRIVEN[s.world.system]), 2 * np.pi * d.any(1.5, 4.0)
    inertia = d.size(0.1, 0.6) * load
    light = inertia * load / (inertia + load)
    damping = 2 * d.any(0.02, 0.15) * light * turn
    return {
        "stiffness": rounded(light * turn**2),
        "damping": rounded(damping),
        "inertia": rounded(inertia),
    }


class SlowClock:
    """Commands are read off by a clock that loses k['drift'] ppm: at t those are held that were given at t (1 - d)."""

    def __init__(self, k: Values) -> None:
        self._loses = k["drift"] * 1e-6
        self._given: list[FloatArray] = []

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What that clock reads half a step on; between two commands, what both share of the step."""
        self._given.append(u)
        ago = self._loses * (t + h / 2) / h
        last, rows = len(self._given) - 1, range(len(u))
        newer = np.floor(ago).astype(int)

        def then(back: FloatArray) -> FloatArray:
            return np.array(
                [self._given[last - b][i] if b <= last else 0.0 for i, b in zip(rows, back, strict=True)]
            )

        return np.asarray((1.0 - ago + newer) * then(newer) + (ago - newer) * then(newer + 1))


def _filtered(k: Values, past: FloatArray, h: float) -> FloatArray:
    """An exponentially weighted mean of all that was, each value held for h; the first one for ever before."""
    back = past[::-1][: 1 + int(np.ceil(25.0 * k["time_constant"] / h))]
    kept = np.exp(-h / k["time_constant"])
    weights = (1.0 - kept) * kept ** np.arange(len(back))
    weights[-1] += kept ** len(back)
    middle = np.concatenate(
        [(back[:-1] + back[1:]) / 2, back[-1:]]
    )  # what was held is what was in the middle
    return np.asarray(np.tensordot(weights, middle, axes=1))


WORDS: Mapping[str, Word] = {
    "actuator_dead_band": Word(
        "actuator",
        _dead_band,
        lambda s, on, d: {"width": rounded(d.size(0.05, 0.35) * s.action(on))},
        systems=(*MECHANICAL, "unicycle"),
        needs_levels=True,
    ),
    "clock_drift": Word(
        "commands",
        SlowClock,
        lambda s, on, d: {"drift": rounded(d.size(80.0, 450.0))},
        systems=(*MECHANICAL, "unicycle"),
        ages=True,
    ),
    "flexible_coupling": Word("coupling", _coupled, _coupling_strength, asked=False),
    "torque_speed_limit": Word("actuator", _torque_line, _torque_line_strength),
    "cubic_spring": Word(
        "smooth",
        lambda k, q, v: (
            -k["stiffness"] * (q - k["rest_position"]) - k["cubic"] * (q - k["rest_position"]) ** 3
        ),
        _cubic_strength,
    ),
    "cogging_force": Word(
        "smooth",
        lambda k, q, v: k["amplitude"] * np.cos(2 * np.pi * q / k["period"] + k["phase"] - np.pi / 2),
        _cogging_strength,
    ),
    "end_stop": Word("smooth", _stops, _stops_strength),
    "load_friction": Word(
        "grip",
        lambda k, v, load: k["share"] * load,
        lambda s, on, d: {"share": d.size(0.08, 0.5)},
        by_command=True,
        needs_levels=True,
    ),
    "cornering_drag": Word(
        "twist", _slowed, lambda s, on, d: {"drag": rounded(d.size(0.05, 0.8))}, systems=("unicycle",)
    ),
    "wheel_saturation": Word(
        "twist",
        _wheels,
        lambda s, on, d: {
            "limit": rounded(s.action("v_cmd") * (1.1 - d.size(0.1, 0.5))),
            "track": rounded(d.any(0.2, 0.5)),
        },
        systems=("unicycle",),
    ),
    "sensor_saturation": Word(
        "sensor",
        lambda k, y: np.where(y > k["high"], k["high"], np.where(y < k["low"], k["low"], y)),
        _range_strength,
    ),
    "sensor_dead_zone": Word(
        "sensor",
        lambda k, y: y * (np.abs(y) >= k["width"]),
        lambda s, on, d: {"width": rounded(d.size(0.15, 0.6) * float(np.std(s.column(on))))},
    ),
    "lugre_friction": Word("bristles", bristles, _bristles_strength),
    "sensor_lag": Word(
        "past",
        _filtered,
        lambda s, on, d: {"time_constant": rounded(d.size(0.4, 4.0) * s.world.dt)},
        needs_speeds=True,
    ),
}


def at_site(site: str) -> dict[str, Callable[..., Any]]:
    """The laws of a site."""
    return {family: word.law for family, word in WORDS.items() if word.site == site}


def places_of(family: str, system: Any, velocities: str | None = "measured") -> list[str]:
    """What a family of these can act on in a system whose velocities are measured, or are not."""
    word = WORDS[family]
    if system.name not in word.systems or (word.needs_speeds and velocities != "measured"):
        return []
    if word.by_command:
        return [DRIVEN[system.name]]
    # A speed that is differentiated has no sensor of its own.
    read = list(system.coordinates if velocities == "differentiated" else system.names)
    at = {
        "actuator": list(system.action),
        "commands": list(system.action),
        "coupling": list(system.action),
        "twist": ["vehicle"],
        "sensor": read,
        "past": read,
    }
    return at.get(word.site, list(system.coordinates))


class Driven:
    """An actuator of these as the truth runs it: a function of the command and of the speed of what it drives."""

    def __init__(self, law: Callable[..., Any], k: Values) -> None:
        self._law, self._k = law, k

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What acts; a vehicle, whose state has no speed, is no place of a law that looks at one."""
        return np.asarray(self._law(self._k, u, s[:, 1]), dtype=np.float64)
