"""The catalogue's laws and how strong they are drawn, written a second time and never shared with `gpsim.effects`.

A mistake in one cannot hide behind the same mistake in the other; a test steps both side by side. Worlds of every
stratum but `words` hold families of the deck alone, so that worlds of older seeds stay what they were.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, Protocol

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, System, TrueEffect, Values, rounded

Draw = Callable[[Scales, str, Dial], dict[str, float]]
"""draw(scales, on, dial) -> parameters, from subtle to plain, in proportion to what the system does."""
Twisted = tuple[FloatArray, FloatArray, FloatArray]
Site = Literal[
    "smooth",
    "grip",
    "bristles",
    "parameter",
    "actuator",
    "commands",
    "coupling",
    "twist",
    "reading",
    "sensor",
    "past",
]
MECHANICAL = ("cartpole", "slider", "pendulum")
EVERY = (*MECHANICAL, "unicycle")
VEHICLE = ("unicycle",)
DRIVEN = {"cartpole": "x", "slider": "q", "pendulum": "theta"}
"""The coordinate that a system's command drives."""


class Actuator(Protocol):
    """One actuator of a running batch."""

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """(B,) what acts during the next h s; u (B,) command, s (B, S) state, t (B,) s of the recording's clock."""
        ...


@dataclass(frozen=True)
class Family:
    """One family.

    law: of a force (k, q, v); of a grip (k, v, load), the most it can resist with; of bristles (k, v, bend, inertia),
    the force and how fast they bend; of an actuator (k, u, speed of what it drives, t); of commands: an actuator with
    memory, made of k; of a coupling: (k, v, z, u), the force on what the command u drives, and how fast z moves, the
    twist and the motor's speed; of a twist (k, v, lateral, w); of a sensor that acts at last, on noise, too, (k, y); of
    one that remembers, `past`, (k, all true values of its channel until now (K, E), the time between two of them [s]).
    All of them return (B,). A reading's law is in `read`. by_command: a grip's load is the command's size.
    needs_levels: only commands of many values show it; needs_speeds: only where speeds are measured beside positions;
    ages: only a clock that runs on shows it. asked: are worlds drawn with it?
    """

    site: Site
    law: Callable[..., Any] | None
    strength: Draw
    systems: tuple[str, ...] = MECHANICAL
    by_command: bool = False
    needs_levels: bool = False
    needs_speeds: bool = False
    ages: bool = False
    asked: bool = True


def read(effect: TrueEffect, names: tuple[str, ...], now: FloatArray) -> None:
    """Change the readings `now` (E, S), in place, to what the sensor says; a delay is not one of these."""
    k = effect.values
    if effect.family == "marker_offset":
        sin, cos = np.sin(now[:, 2]), np.cos(now[:, 2])
        now[:, 0] += k["forward"] * cos - k["left"] * sin
        now[:, 1] += k["forward"] * sin + k["left"] * cos
    elif effect.family == "frame_rotation":
        now[:, 2] += k["angle"]
    elif effect.family in ("sensor_bias", "joint_offset"):
        now[:, names.index(effect.on)] += k["offset"]
    elif effect.family == "sensor_scale":
        now[:, names.index(effect.on)] *= k["scale"]


class _Driven:
    """An actuator without memory: a function of the command, the speed of what it drives, and the time."""

    def __init__(self, law: Callable[..., Any], k: Values) -> None:
        self._law, self._k = law, k

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What acts; a vehicle, whose state has no speed, is no place of a law that looks at one."""
        return np.asarray(self._law(self._k, u, s[:, 1], t), dtype=np.float64)


class _Level:
    """An actuator that remembers one number, 0 at an episode's start."""

    def __init__(self, k: Values) -> None:
        self.k = k
        self.level: FloatArray | float = 0.0


class _Lag(_Level):
    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """T a' = u - a, integrated exactly; the mean over the step."""
        x, behind = h / self.k["time_constant"], self.level - u
        self.level = u + behind * np.exp(-x)
        return np.asarray(u + behind * (1.0 - np.exp(-x)) / x)


class _RateLimit(_Level):
    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """|a'| <= r; the mean over the step, in which the command may be reached."""
        before, rate = self.level, self.k["rate"]
        self.level = before + np.maximum(np.minimum(u - before, rate * h), -rate * h)
        walking = np.abs(self.level - before) / rate  # s of the step; then it stands there
        return np.asarray(self.level - (self.level - before) * walking / (2 * h))


class _Backlash(_Level):
    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The play operator: what the gap's ends drag along."""
        self.level = np.maximum(np.minimum(self.level, u + self.k["half_width"]), u - self.k["half_width"])
        return np.asarray(self.level)


class _Delay:
    """u(t - T) with T a whole number of fine steps; nothing was commanded before the start."""

    def __init__(self, k: Values) -> None:
        self._delay = k["delay"]
        self._line: list[FloatArray] = []

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command of a delay ago."""
        self._line.append(u)
        return np.zeros_like(u) if len(self._line) <= round(self._delay / h) else self._line.pop(0)


class _SlowClock:
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
            pairs = zip(rows, back, strict=True)
            return np.array([self._given[last - b][i] if b <= last else 0.0 for i, b in pairs])

        return np.asarray((1.0 - ago + newer) * then(newer) + (ago - newer) * then(newer + 1))


def _coulomb(k: Values, v: FloatArray, load: FloatArray) -> FloatArray:
    if "coefficient" in k:
        return k["coefficient"] * np.maximum(load, 0.0)
    return np.full_like(v, k["force"])


def _stribeck(k: Values, v: FloatArray, load: FloatArray) -> FloatArray:
    return k["force"] + (k["static_force"] - k["force"]) * np.exp(-((v / k["stribeck_velocity"]) ** 2))


def _turning_radius(k: Values, v: FloatArray, lateral: FloatArray, w: FloatArray) -> Twisted:
    most = np.abs(v) / k["radius"]
    return v, lateral, np.maximum(np.minimum(w, most), -most)


def _slowed(k: Values, v: FloatArray, lateral: FloatArray, w: FloatArray) -> Twisted:
    """The way stays the same: speed and turn rate fall together."""
    loss = 1.0 + k["drag"] * np.square(v * w)
    return v / loss, lateral, w / loss


def _wheels(k: Values, v: FloatArray, lateral: FloatArray, w: FloatArray) -> Twisted:
    """Each of two wheels is clipped by itself."""
    arms = np.array([-0.5, 0.5])[:, None] * k["track"]
    inner, outer = np.clip(v + arms * w, -k["limit"], k["limit"])
    return (inner + outer) / 2.0, lateral, (outer - inner) / k["track"]


def _dead_band(k: Values, u: FloatArray, speed: FloatArray, t: FloatArray) -> FloatArray:
    return np.where(u > k["width"], u - k["width"], np.where(u < -k["width"], u + k["width"], 0.0))


def _torque_line(k: Values, u: FloatArray, speed: FloatArray, t: FloatArray) -> FloatArray:
    """A motor that pushes with the motion has what its line leaves, one that brakes what it has at standstill."""
    slower = np.abs(speed) / k["no_load_speed"]
    most = np.where(u * speed > 0, k["stall"] * np.maximum(1.0 - slower, 0.0), k["stall"])
    return np.asarray(np.sign(u) * np.minimum(np.abs(u), most))


def _stops(k: Values, q: FloatArray, v: FloatArray) -> FloatArray:
    """Two springs with dampers; neither pulls."""
    push = np.zeros_like(q)
    for edge, side in ((k["low"], -1.0), (k["high"], 1.0)):
        depth, into = side * (q - edge), side * v
        push -= np.where(depth > 0, side * np.maximum(k["stiffness"] * depth + k["damping"] * into, 0.0), 0.0)
    return push


def bristles(
    k: Values, v: FloatArray, bend: FloatArray, inertia: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(B,) force and rate of bend of friction with bristles, damped by sqrt(stiffness inertia)."""
    rest = k.get("static_force", k["force"])
    level = k["force"] + (rest - k["force"]) * np.exp(-np.square(v / k.get("stribeck_velocity", 1.0)))
    rate = v - np.abs(v) * bend * k["stiffness"] / level
    return -k["stiffness"] * bend - np.sqrt(k["stiffness"] * inertia) * rate, rate


def _coupled(k: Values, v: FloatArray, z: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Newton's law for the motor; v is the load's speed."""
    ahead = z[:, 1] - v
    pull = k["stiffness"] * z[:, 0] + k["damping"] * ahead
    return pull, np.stack([ahead, (u - pull) / k["inertia"]], axis=1)


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


def _stribeck_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    sliding = d.size(0.05, 0.3) * s.force(on)
    speed = d.any(0.1, 0.4) * s.speed(on)
    static = rounded(sliding * d.any(1.5, 2.5))
    return {"force": rounded(sliding), "static_force": static, "stribeck_velocity": rounded(speed)}


def _coulomb_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    force = d.size(0.05, 0.5) * s.force(on)
    if s.world.system == "cartpole" and on == "x" and s.world.engine == "rk4" and d.rng.random() < 0.5:
        p = s.world.parameters
        return {"coefficient": rounded(force / ((p["cart_mass"] + p["pole_mass"]) * p["gravity"]))}
    return {"force": rounded(force)}


def _asymmetry_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    off, sign = d.size(0.04, 0.25), d.sign()
    return {
        "gain_positive": rounded(1.0 + sign * off),
        "gain_negative": rounded(1.0 - sign * off * d.any(0.3, 1.0)),
    }


def _sensor_bias_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    unit = SYSTEMS[s.world.system].state[on]
    size = d.size(0.02, 0.12) if unit in ("rad", "m") else d.size(0.05, 0.5) * s.reach(on)
    return {"offset": rounded(d.sign() * size)}


def _radius_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that a tenth (subtle) to a half (plain) of the commanded curves are too tight."""
    v, w = s.command("v_cmd"), np.abs(s.command("w_cmd"))
    return {"radius": rounded(float(np.quantile(np.abs(v) / np.maximum(w, 1e-3), d.size(0.1, 0.5))))}


def _torque_line_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    speed = s.speed(DRIVEN[s.world.system])
    stall = rounded(s.action(on) * d.any(0.9, 1.3))
    return {"stall": stall, "no_load_speed": rounded(speed * (4.5 - d.size(1.0, 3.0)))}


def _cubic_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    force, reach = s.force(on), s.reach(on)
    return {
        "stiffness": rounded(d.any(0.05, 0.3) * force / reach),
        "cubic": rounded(d.size(0.1, 0.6) * force / reach**3),
        "rest_position": rounded(float(np.mean(s.column(on))) + d.any(-0.4, 0.4) * reach),
    }


def _stops_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that the outer tenth to third of the way is beyond an edge; stiff enough to turn the body round there."""
    share = d.size(0.04, 0.15)
    low, high = (float(edge) for edge in np.quantile(s.column(on), [share, 1.0 - share]))
    stiffness = rounded(d.any(8, 40) * s.force(on) / (high - low))
    damping = rounded(d.any(0.1, 0.5) * s.force(on) / s.speed(on))
    return {"low": rounded(low), "high": rounded(high), "stiffness": stiffness, "damping": damping}


def _range_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that the outer twentieth to quarter of the readings stand at an end."""
    share = d.size(0.03, 0.12)
    low, high = (float(end) for end in np.quantile(s.column(on), [share, 1.0 - share]))
    return {"low": rounded(low), "high": rounded(high)}


def _bristles_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """They bend by a twentieth of the way or less; in half of the worlds they grip more at rest."""
    force, way = d.size(0.15, 0.6) * s.force(on), d.any(0.015, 0.06) * s.reach(on)
    out = {"force": rounded(force), "stiffness": rounded(force / way)}
    if d.rng.random() < 0.5:
        rest, slow = rounded(force * d.any(1.4, 2.2)), rounded(d.any(0.1, 0.3) * s.speed(on))
        out |= {"static_force": rest, "stribeck_velocity": slow}
    return out


def _coupling_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Motor and load swing against each other at 1.5 to 4 Hz, damped by 2 to 15 %."""
    load, turn = s.inertia(DRIVEN[s.world.system]), 2 * np.pi * d.any(1.5, 4.0)
    inertia = d.size(0.1, 0.6) * load
    light = inertia * load / (inertia + load)
    damping = 2 * d.any(0.02, 0.15) * light * turn
    return {
        "stiffness": rounded(light * turn**2), "damping": rounded(damping), "inertia": rounded(inertia)
    }  # fmt: skip


def _milliseconds(value: float) -> float:
    return max(round(value, 3), 0.001)


OLD: Mapping[str, Family] = {
    "viscous_friction": Family(
        "smooth", lambda k, q, v: -k["damping"] * v,
        lambda s, on, d: {"damping": rounded(d.size(0.05, 0.5) * s.force(on) / s.speed(on))},
    ),
    "quadratic_drag": Family(
        "smooth", lambda k, q, v: -k["drag"] * np.abs(v) * v,
        lambda s, on, d: {"drag": rounded(d.size(0.05, 0.4) * s.force(on) / s.speed(on) ** 2)},
    ),
    "spring": Family(
        "smooth", lambda k, q, v: -k["stiffness"] * (q - k["rest_position"]),
        lambda s, on, d: {
            "stiffness": rounded(d.size(0.05, 0.5) * s.force(on) / s.reach(on)),
            "rest_position": rounded(float(np.mean(s.column(on))) + d.any(-0.8, 0.8) * s.reach(on)),
        },
    ),
    "constant_force": Family(
        "smooth", lambda k, q, v: np.full_like(q, k["force"]),
        lambda s, on, d: {"force": rounded(d.sign() * d.size(0.05, 0.4) * s.force(on))},
    ),
    "coulomb_friction": Family("grip", _coulomb, _coulomb_strength),
    "stribeck_friction": Family("grip", _stribeck, _stribeck_strength),
    "local_friction_patch": Family(
        "grip", lambda k, v, load: np.full_like(v, k["force"]),
        lambda s, on, d: {"force": rounded(d.size(0.15, 0.8) * s.force(on))},
    ),
    "parameter_offset": Family(
        "parameter", None,
        lambda s, on, d: {"ratio": d.ratio(0.1, 0.5) if on == "pole_mass" else d.ratio(0.04, 0.3)},
    ),
    "minimum_turning_radius": Family("twist", _turning_radius, _radius_strength, VEHICLE),
    "understeer": Family(
        "twist", lambda k, v, lateral, w: (v, lateral, w / (1.0 + k["gradient"] * v * v)),
        lambda s, on, d: {"gradient": rounded(d.size(0.05, 0.8) / s.action("v_cmd") ** 2)}, VEHICLE,
    ),
    "steering_bias": Family(
        "twist", lambda k, v, lateral, w: (v, lateral, w + k["curvature"] * v),
        lambda s, on, d: {"curvature": rounded(d.sign() * d.size(0.02, 0.4))}, VEHICLE,
    ),
    "lateral_slip": Family(
        "twist", lambda k, v, lateral, w: (v, lateral - k["slip"] * v * w, w),
        lambda s, on, d: {"slip": d.size(0.02, 0.3)}, VEHICLE,
    ),
    "actuator_delay": Family(
        "commands", _Delay, lambda s, on, d: {"delay": _milliseconds(d.size(0.5, 5.0) * s.world.dt)}, EVERY
    ),
    "actuator_dead_zone": Family(
        "commands", partial(_Driven, lambda k, u, speed, t: u * (np.abs(u) >= k["width"])),
        lambda s, on, d: {"width": rounded(d.size(0.08, 0.4) * s.action(on))}, EVERY, needs_levels=True,
    ),
    "actuator_saturation": Family(
        "commands", partial(_Driven, lambda k, u, speed, t: np.maximum(np.minimum(u, k["limit"]), -k["limit"])),
        lambda s, on, d: {"limit": rounded((1.0 - d.size(0.12, 0.6)) * s.action(on))}, EVERY, needs_levels=True,
    ),
    "actuator_gain": Family(
        "commands", partial(_Driven, lambda k, u, speed, t: k["gain"] * u),
        lambda s, on, d: {"gain": d.ratio(0.04, 0.3)}, EVERY,
    ),
    "actuator_asymmetry": Family(
        "commands",
        partial(
            _Driven,
            lambda k, u, speed, t: k["gain_positive"] * np.maximum(u, 0.0) + k["gain_negative"] * np.minimum(u, 0.0),
        ),
        _asymmetry_strength, EVERY,
    ),
    "battery_sag": Family(
        "commands",
        partial(_Driven, lambda k, u, speed, t: u * np.maximum(1.0 - k["loss_per_second"] * t, 0.0)),
        lambda s, on, d: {"loss_per_second": rounded(d.size(0.1, 0.6) / s.duration)}, EVERY, ages=True,
    ),
    "actuator_bias": Family(
        "commands", partial(_Driven, lambda k, u, speed, t: u + k["bias"]),
        lambda s, on, d: {"bias": rounded(d.sign() * d.size(0.03, 0.3) * s.action(on))}, EVERY,
    ),
    "actuator_backlash": Family(
        "commands", _Backlash, lambda s, on, d: {"half_width": rounded(d.size(0.03, 0.3) * s.action(on))}, EVERY,
        needs_levels=True,
    ),
    "actuator_rate_limit": Family(
        "commands", _RateLimit,
        lambda s, on, d: {"rate": rounded(s.action(on) / (d.size(0.8, 8.0) * s.world.dt))}, EVERY,
    ),
    "actuator_lag": Family(
        "commands", _Lag, lambda s, on, d: {"time_constant": rounded(d.size(0.5, 6.0) * s.world.dt)}, EVERY
    ),
    "marker_offset": Family(
        "reading", None,
        lambda s, on, d: {
            "forward": rounded(d.sign() * d.size(0.02, 0.2)), "left": rounded(d.sign() * d.size(0.01, 0.1))
        },
        VEHICLE,
    ),
    "frame_rotation": Family(
        "reading", None, lambda s, on, d: {"angle": rounded(d.sign() * d.size(0.02, 0.25))}, VEHICLE
    ),
    "sensor_scale": Family("reading", None, lambda s, on, d: {"scale": d.ratio(0.03, 0.2)}, EVERY),
    "sensor_bias": Family("reading", None, _sensor_bias_strength, EVERY),
    "sensor_delay": Family(
        "reading", None, lambda s, on, d: {"delay": _milliseconds(d.size(0.5, 4.0) * s.world.dt)}, EVERY
    ),
}  # fmt: skip
"""The deck's. Twists and what happens to commands act in this order."""
WORDS: Mapping[str, Family] = {
    "actuator_dead_band": Family(
        "actuator", _dead_band, lambda s, on, d: {"width": rounded(d.size(0.05, 0.35) * s.action(on))}, EVERY,
        needs_levels=True,
    ),
    "clock_drift": Family(
        "commands", _SlowClock, lambda s, on, d: {"drift": rounded(d.size(80.0, 450.0))}, EVERY, ages=True
    ),
    "flexible_coupling": Family("coupling", _coupled, _coupling_strength, asked=False),
    "torque_speed_limit": Family("actuator", _torque_line, _torque_line_strength),
    "cubic_spring": Family(
        "smooth",
        lambda k, q, v: -k["stiffness"] * (q - k["rest_position"]) - k["cubic"] * (q - k["rest_position"]) ** 3,
        _cubic_strength,
    ),
    "cogging_force": Family(
        "smooth", lambda k, q, v: k["amplitude"] * np.cos(2 * np.pi * q / k["period"] + k["phase"] - np.pi / 2),
        lambda s, on, d: {
            "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)),
            "period": rounded(4 * s.reach(on) / d.any(3, 9)),
            "phase": d.any(-3, 3),
        },
    ),
    "end_stop": Family("smooth", _stops, _stops_strength),
    "load_friction": Family(
        "grip", lambda k, v, load: k["share"] * load, lambda s, on, d: {"share": d.size(0.08, 0.5)},
        by_command=True, needs_levels=True,
    ),
    "cornering_drag": Family(
        "twist", _slowed, lambda s, on, d: {"drag": rounded(d.size(0.05, 0.8))}, VEHICLE
    ),
    "wheel_saturation": Family(
        "twist", _wheels,
        lambda s, on, d: {
            "limit": rounded(s.action("v_cmd") * (1.1 - d.size(0.1, 0.5))), "track": rounded(d.any(0.2, 0.5))
        },
        VEHICLE,
    ),
    "sensor_saturation": Family(
        "sensor", lambda k, y: np.where(y > k["high"], k["high"], np.where(y < k["low"], k["low"], y)), _range_strength
    ),
    "sensor_dead_zone": Family(
        "sensor", lambda k, y: y * (np.abs(y) >= k["width"]),
        lambda s, on, d: {"width": rounded(d.size(0.15, 0.6) * float(np.std(s.column(on))))},
    ),
    "lugre_friction": Family("bristles", bristles, _bristles_strength),
    "sensor_lag": Family(
        "past", _filtered, lambda s, on, d: {"time_constant": rounded(d.size(0.4, 4.0) * s.world.dt)}, needs_speeds=True
    ),
}  # fmt: skip
"""Newer families, which worlds of the stratum `words` hold."""
FAMILIES: Mapping[str, Family] = {**OLD, **WORDS}
DECK = tuple(sorted(OLD))
"""The families that worlds of every stratum but `words` hold."""
STRENGTHS: Mapping[str, Draw] = {name: family.strength for name, family in FAMILIES.items()}


def at_site(site: Site) -> dict[str, Callable[..., Any]]:
    """The laws of a site."""
    return {name: f.law for name, f in FAMILIES.items() if f.site == site and f.law is not None}


SMOOTH, GRIP, TWIST = at_site("smooth"), at_site("grip"), at_site("twist")
BRISTLES, COUPLINGS = at_site("bristles"), at_site("coupling")
LAST_SENSORS, PAST_SENSORS = at_site("sensor"), at_site("past")
ACTUATORS: Mapping[str, Callable[[Values], Actuator]] = {
    **{name: law for name, law in at_site("commands").items() if name in OLD},
    **{name: partial(_Driven, law) for name, law in at_site("actuator").items()},
    **{name: law for name, law in at_site("commands").items() if name in WORDS},
}
SENSORS = ("marker_offset", "frame_rotation", "sensor_scale", "sensor_bias", "joint_offset", "sensor_delay")
"""Several act in this order, a delay before all others."""


def places_of(family: str, system: System, velocities: str | None = "measured") -> list[str]:
    """What a family can act on in a system whose velocities are measured, or are not, so that a recording shows it."""
    found = FAMILIES[family]
    if system.name not in found.systems or (found.needs_speeds and velocities != "measured"):
        return []
    if found.by_command:
        return [DRIVEN[system.name]]
    # A speed that is differentiated has no sensor of its own.
    read = list(system.coordinates if velocities == "differentiated" else system.names)
    match found.site:
        case "actuator" | "commands" | "coupling":
            return list(system.action)
        case "parameter":
            return list(system.parameters)
        case "twist":
            return ["vehicle"]
        case "sensor" | "past":
            return read
        case "reading" if system.vehicle:
            poses = {
                "marker_offset": ["pose"],
                "frame_rotation": ["pose"],
                "sensor_bias": ["yaw"],
                "sensor_scale": ["x", "y"],
            }
            return poses.get(family, read)
        case "reading":  # nothing depends on where along its guide a cart or slider is
            return [c for c in read if family != "sensor_bias" or c not in ("x", "q")]
        case _:
            return list(system.coordinates)
