"""The catalogue's laws and how strong they are drawn, written a second time and never shared with `gpsim.effects`.

A mistake in one cannot hide behind the same mistake in the other; a test steps both side by side. Worlds of every
stratum but `words` hold families of the deck alone, so that worlds of older seeds stay what they were.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, System, TrueEffect, Values, rounded

Draw = Callable[[Scales, str, Dial], dict[str, float]]
"""draw(scales, on, dial) -> parameters, from subtle to plain, in proportion to what the system does."""
Twisted = tuple[FloatArray, FloatArray, FloatArray]
Site = Literal[
    "smooth", "grip", "bristles", "parameter", "actuator", "coupling", "twist", "reading", "sensor", "past",
    "force", "hidden force", "coupled force", "inertia", "twist after", "hidden twist", "distortion", "memory",
]  # fmt: skip
"""Of the catalogue; and of physics outside it."""
BEFORE_AND_AFTER: tuple[Site, ...] = ("actuator", "reading", "sensor", "past", "distortion", "memory")
"""Sites that are not in the body itself: what an actuator or a sensor does."""
MECHANICAL = ("cartpole", "slider", "pendulum")
EVERY = (*MECHANICAL, "unicycle")
VEHICLE = ("unicycle",)
DRIVEN = {"cartpole": "x", "slider": "q", "pendulum": "theta"}
"""The coordinate that a system's command drives."""


@dataclass(frozen=True)
class Family:
    """A family of the catalogue, or a kind of physics outside it; its law and how strong it is drawn.

    law, all of which return (B,), by site. Of the catalogue: smooth (k, q, v); a grip (k, v, load), the most it can
    resist with; bristles (k, v, bend, inertia), the force and how fast they bend; a coupling (k, v, z, u), the force on
    what the command u drives, and how fast z moves, the twist and the motor's speed; a twist (k, v, lateral, w); a
    sensor that acts at last, on noise, too, (k, y); one that remembers, `past`, (k, all true values of its channel
    until now (K, E), the time between two of them [s]). A reading's law is in `read`. An actuator: (k, u, s, t, h) what
    acts during the next h s, of command u, state s (B, S) and clock t [s]; with memory (k, z, u, s, t, h), what acts
    and the new z, which is `memory()` at an episode's start.

    Outside: a force (k, q, v, t), t of the clock on the wall [s]; a hidden force (k, q, v, z, w), the force and how
    fast its own state (z, w) moves, w not at all where it is left out; it begins at `start(q, v)` or (`first`, 0), and
    adds `inertia(k, z)`; a coupled force (k, s), (B, C); an inertia (k, q), how much more there is, and its slope; a
    twist (k, v, w, pose), v and w; a hidden one (k, v, w, z), and how fast z moves, from 0; a distortion (k, y), y (E,)
    of a channel or (E, 2) of a pose's place; a sensor with memory as `past`.

    on: what it acts on where the site does not say it, places: which of those that are read. by_command: a grip's load
    is the command's size. needs_levels: only commands of many values show it; needs_speeds: nowhere that speeds are
    differentiated; ages: only a clock that runs on shows it; unseen_under: excitations that cannot show it. asked: are
    worlds drawn with it? since: the first seed whose worlds may hold a kind, None: those of every seed. word: what the
    catalogue calls a kind that has become a word.
    """

    site: Site
    law: Callable[..., Any] | None
    draw: Draw
    systems: tuple[str, ...] = MECHANICAL
    by_command: bool = False
    needs_levels: bool = False
    needs_speeds: bool = False
    ages: bool = False
    asked: bool = True
    on: tuple[str, ...] = ()
    places_read: Callable[[System, Sequence[str]], Sequence[str]] | None = None
    memory: Callable[[], Any] | None = None
    since: int | None = None
    word: str = ""
    unseen_under: tuple[str, ...] = ()
    first: float = 0.0
    start: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]] | None = None
    inertia: Callable[..., Any] | None = None

    @property
    def of_body(self) -> bool:
        """Whether it acts in the body itself, not before it (actuators) or after it (sensors)."""
        return self.site not in BEFORE_AND_AFTER

    def drawn(self, s: Scales, on: str, d: Dial) -> dict[str, float]:
        """The parameters on a place with as many digits as an answer shows, as strong as the dial says."""
        return {name: rounded(value) for name, value in self.draw(s, on, d).items()}

    def places(self, system: System, velocities: str | None = "measured") -> list[str]:
        """What it can act on in a system whose velocities are measured, or are not, so that a recording shows it."""
        if system.name not in self.systems or (self.needs_speeds and velocities == "differentiated"):
            return []
        if self.by_command:
            return [DRIVEN[system.name]]
        # A speed that is differentiated has no sensor of its own.
        read = list(system.coordinates if velocities == "differentiated" else system.names)
        if self.places_read:
            return list(self.places_read(system, read))
        where: dict[str, Sequence[str]] = {
            **dict.fromkeys(("actuator", "coupling"), tuple(system.action)),
            **dict.fromkeys(("sensor", "past", "reading"), read),
            **dict.fromkeys(("distortion", "memory"), ("yaw",) if system.vehicle else system.coordinates),
            "parameter": tuple(system.parameters), "twist": ("vehicle",),
        }  # fmt: skip
        return list(self.on or where.get(self.site, system.coordinates))


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


class Actuator:
    """One actuator of a running batch."""

    def __init__(self, family: Family, k: Values) -> None:
        assert family.law is not None
        self._law, self._k, self._remembers = family.law, k, family.memory is not None
        self._memory = family.memory() if family.memory else None

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """(B,) what acts during the next h s; u (B,) command, s (B, S) state, t (B,) s of the recording's clock."""
        if not self._remembers:
            return np.asarray(self._law(self._k, u, s, t, h), dtype=np.float64)
        acts, self._memory = self._law(self._k, self._memory, u, s, t, h)
        return np.asarray(acts)


Remembered = tuple[FloatArray, Any]


def _lag(k: Values, level: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    """T a' = u - a, integrated exactly; the mean over the step."""
    x, behind = h / k["time_constant"], level - u
    return u + behind * (1.0 - np.exp(-x)) / x, u + behind * np.exp(-x)


def _rate_limit(k: Values, before: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    """|a'| <= r; the mean over the step, in which the command may be reached."""
    level = before + np.maximum(np.minimum(u - before, k["rate"] * h), -k["rate"] * h)
    walking = np.abs(level - before) / k["rate"]  # s of the step; then it stands there
    return level - (level - before) * walking / (2 * h), level


def _backlash(k: Values, level: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    """The play operator: what the gap's ends drag along."""
    level = np.maximum(np.minimum(level, u + k["half_width"]), u - k["half_width"])
    return level, level


def _delay(k: Values, line: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    """u(t - T) with T a whole number of fine steps; nothing was commanded before the start."""
    line.append(u)
    return np.zeros_like(u) if len(line) <= round(k["delay"] / h) else line.pop(0), line


def _slow_clock(k: Values, given: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    """Commands are read off by a clock that loses k['drift'] ppm: at t those are held that were given at t (1 - d).

    What that clock reads half a step on; between two commands, what both share of the step.
    """
    given.append(u)
    ago = k["drift"] * 1e-6 * (t + h / 2) / h
    last, rows = len(given) - 1, range(len(u))
    newer = np.floor(ago).astype(int)

    def then(back: FloatArray) -> FloatArray:
        pairs = zip(rows, back, strict=True)
        return np.array([given[last - b][i] if b <= last else 0.0 for i, b in pairs])

    return (1.0 - ago + newer) * then(newer) + (ago - newer) * then(newer + 1), given


def _asymmetric(k: Values, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
    return np.asarray(k["gain_positive"] * np.maximum(u, 0.0) + k["gain_negative"] * np.minimum(u, 0.0))


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


def _dead_band(k: Values, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
    return np.where(u > k["width"], u - k["width"], np.where(u < -k["width"], u + k["width"], 0.0))


def _torque_line(k: Values, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
    """A motor that pushes with the motion has what its line leaves, one that brakes what it has at standstill."""
    speed = s[:, 1]
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
    static = sliding * d.any(1.5, 2.5)
    return {"force": sliding, "static_force": static, "stribeck_velocity": speed}


def _coulomb_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    force = d.size(0.05, 0.5) * s.force(on)
    if s.world.system == "cartpole" and on == "x" and s.world.engine == "rk4" and d.rng.random() < 0.5:
        p = s.world.parameters
        return {"coefficient": force / ((p["cart_mass"] + p["pole_mass"]) * p["gravity"])}
    return {"force": force}


def _asymmetry_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    off, sign = d.size(0.04, 0.25), d.sign()
    return {
        "gain_positive": 1.0 + sign * off,
        "gain_negative": 1.0 - sign * off * d.any(0.3, 1.0),
    }


def _sensor_bias_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    unit = SYSTEMS[s.world.system].state[on]
    size = d.size(0.02, 0.12) if unit in ("rad", "m") else d.size(0.05, 0.5) * s.reach(on)
    return {"offset": d.sign() * size}


def _radius_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that a tenth (subtle) to a half (plain) of the commanded curves are too tight."""
    v, w = s.command("v_cmd"), np.abs(s.command("w_cmd"))
    return {"radius": float(np.quantile(np.abs(v) / np.maximum(w, 1e-3), d.size(0.1, 0.5)))}


def _torque_line_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    speed = s.speed(DRIVEN[s.world.system])
    stall = s.action(on) * d.any(0.9, 1.3)
    return {"stall": stall, "no_load_speed": speed * (4.5 - d.size(1.0, 3.0))}


def _cubic_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    force, reach = s.force(on), s.reach(on)
    return {
        "stiffness": d.any(0.05, 0.3) * force / reach,
        "cubic": d.size(0.1, 0.6) * force / reach**3,
        "rest_position": middle(s, on, d, 0.4),
    }


def _stops_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that the outer tenth to third of the way is beyond an edge; stiff enough to turn the body round there."""
    share = d.size(0.04, 0.15)
    low, high = (float(edge) for edge in np.quantile(s.column(on), [share, 1.0 - share]))
    stiffness = d.any(8, 40) * s.force(on) / (high - low)
    damping = d.any(0.1, 0.5) * s.force(on) / s.speed(on)
    return {"low": low, "high": high, "stiffness": stiffness, "damping": damping}


def _range_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that the outer twentieth to quarter of the readings stand at an end."""
    share = d.size(0.03, 0.12)
    low, high = (float(end) for end in np.quantile(s.column(on), [share, 1.0 - share]))
    return {"low": low, "high": high}


def _bristles_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """They bend by a twentieth of the way or less; in half of the worlds they grip more at rest."""
    force, way = d.size(0.15, 0.6) * s.force(on), d.any(0.015, 0.06) * s.reach(on)
    out = {"force": force, "stiffness": force / way}
    if d.rng.random() < 0.5:
        rest, slow = force * d.any(1.4, 2.2), d.any(0.1, 0.3) * s.speed(on)
        out |= {"static_force": rest, "stribeck_velocity": slow}
    return out


def _coupling_strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Motor and load swing against each other at 1.5 to 4 Hz, damped by 2 to 15 %."""
    load, turn = s.inertia(DRIVEN[s.world.system]), 2 * np.pi * d.any(1.5, 4.0)
    inertia = d.size(0.1, 0.6) * load
    light = inertia * load / (inertia + load)
    damping = 2 * d.any(0.02, 0.15) * light * turn
    return {
        "stiffness": light * turn**2, "damping": damping, "inertia": inertia
    }  # fmt: skip


def middle(s: Scales, on: str, d: Dial, far: float) -> float:
    """A place near the mean of a channel, no farther from it than `far` times its standard deviation."""
    return float(np.mean(s.column(on))) + d.any(-far, far) * s.reach(on)


def seconds(s: Scales, share: float) -> float:
    """A share of an episode [s]."""
    return share * s.world.steps * s.world.dt


def _milliseconds(value: float) -> float:
    return max(round(value, 3), 0.001)


OLD: Mapping[str, Family] = {
    "viscous_friction": Family(
        "smooth", lambda k, q, v: -k["damping"] * v,
        lambda s, on, d: {"damping": d.size(0.05, 0.5) * s.force(on) / s.speed(on)},
    ),
    "quadratic_drag": Family(
        "smooth", lambda k, q, v: -k["drag"] * np.abs(v) * v,
        lambda s, on, d: {"drag": d.size(0.05, 0.4) * s.force(on) / s.speed(on) ** 2},
    ),
    "spring": Family(
        "smooth", lambda k, q, v: -k["stiffness"] * (q - k["rest_position"]),
        lambda s, on, d: {
            "stiffness": d.size(0.05, 0.5) * s.force(on) / s.reach(on), "rest_position": middle(s, on, d, 0.8)
        },
    ),
    "constant_force": Family(
        "smooth", lambda k, q, v: np.full_like(q, k["force"]),
        lambda s, on, d: {"force": d.sign() * d.size(0.05, 0.4) * s.force(on)},
    ),
    "coulomb_friction": Family("grip", _coulomb, _coulomb_strength),
    "stribeck_friction": Family("grip", _stribeck, _stribeck_strength),
    "local_friction_patch": Family(
        "grip", lambda k, v, load: np.full_like(v, k["force"]),
        lambda s, on, d: {"force": d.size(0.15, 0.8) * s.force(on)},
    ),
    "parameter_offset": Family(
        "parameter", None,
        lambda s, on, d: {"ratio": d.ratio(0.1, 0.5) if on == "pole_mass" else d.ratio(0.04, 0.3)},
    ),
    "minimum_turning_radius": Family("twist", _turning_radius, _radius_strength, VEHICLE),
    "understeer": Family(
        "twist", lambda k, v, lateral, w: (v, lateral, w / (1.0 + k["gradient"] * v * v)),
        lambda s, on, d: {"gradient": d.size(0.05, 0.8) / s.action("v_cmd") ** 2}, VEHICLE,
    ),
    "steering_bias": Family(
        "twist", lambda k, v, lateral, w: (v, lateral, w + k["curvature"] * v),
        lambda s, on, d: {"curvature": d.sign() * d.size(0.02, 0.4)}, VEHICLE,
    ),
    "lateral_slip": Family(
        "twist", lambda k, v, lateral, w: (v, lateral - k["slip"] * v * w, w),
        lambda s, on, d: {"slip": d.size(0.02, 0.3)}, VEHICLE,
    ),
    "actuator_delay": Family(
        "actuator", _delay, lambda s, on, d: {"delay": _milliseconds(d.size(0.5, 5.0) * s.world.dt)}, EVERY,
        memory=list,
    ),
    "actuator_dead_zone": Family(
        "actuator", lambda k, u, s, t, h: u * (np.abs(u) >= k["width"]),
        lambda s, on, d: {"width": d.size(0.08, 0.4) * s.action(on)}, EVERY, needs_levels=True,
    ),
    "actuator_saturation": Family(
        "actuator", lambda k, u, s, t, h: np.maximum(np.minimum(u, k["limit"]), -k["limit"]),
        lambda s, on, d: {"limit": (1.0 - d.size(0.12, 0.6)) * s.action(on)}, EVERY, needs_levels=True,
    ),
    "actuator_gain": Family(
        "actuator", lambda k, u, s, t, h: k["gain"] * u,
        lambda s, on, d: {"gain": d.ratio(0.04, 0.3)}, EVERY,
    ),
    "actuator_asymmetry": Family("actuator", _asymmetric, _asymmetry_strength, EVERY),
    "battery_sag": Family(
        "actuator", lambda k, u, s, t, h: u * np.maximum(1.0 - k["loss_per_second"] * t, 0.0),
        lambda s, on, d: {"loss_per_second": d.size(0.1, 0.6) / s.duration}, EVERY, ages=True,
    ),
    "actuator_bias": Family(
        "actuator", lambda k, u, s, t, h: u + k["bias"],
        lambda s, on, d: {"bias": d.sign() * d.size(0.03, 0.3) * s.action(on)}, EVERY,
    ),
    "actuator_backlash": Family(
        "actuator", _backlash, lambda s, on, d: {"half_width": d.size(0.03, 0.3) * s.action(on)}, EVERY,
        needs_levels=True, memory=float,
    ),
    "actuator_rate_limit": Family(
        "actuator", _rate_limit,
        lambda s, on, d: {"rate": s.action(on) / (d.size(0.8, 8.0) * s.world.dt)}, EVERY, memory=float,
    ),
    "actuator_lag": Family(
        "actuator", _lag, lambda s, on, d: {"time_constant": d.size(0.5, 6.0) * s.world.dt}, EVERY,
        memory=float,
    ),
    "marker_offset": Family(
        "reading", None,
        lambda s, on, d: {"forward": d.sign() * d.size(0.02, 0.2), "left": d.sign() * d.size(0.01, 0.1)},
        VEHICLE, on=("pose",),
    ),
    "frame_rotation": Family(
        "reading", None, lambda s, on, d: {"angle": d.sign() * d.size(0.02, 0.25)}, VEHICLE, on=("pose",)
    ),
    "sensor_scale": Family(
        "reading", None, lambda s, on, d: {"scale": d.ratio(0.03, 0.2)}, EVERY,
        places_read=lambda system, read: ["x", "y"] if system.vehicle else read,
    ),
    "sensor_bias": Family(  # nothing depends on where along its guide a cart or slider is
        "reading", None, _sensor_bias_strength, EVERY,
        places_read=lambda system, read: ["yaw"] if system.vehicle else [c for c in read if c not in ("x", "q")],
    ),
    "sensor_delay": Family(
        "reading", None, lambda s, on, d: {"delay": _milliseconds(d.size(0.5, 4.0) * s.world.dt)}, EVERY
    ),
}  # fmt: skip
"""The deck's. Twists and what happens to commands act in this order."""
WORDS: Mapping[str, Family] = {
    "actuator_dead_band": Family(
        "actuator", _dead_band, lambda s, on, d: {"width": d.size(0.05, 0.35) * s.action(on)}, EVERY,
        needs_levels=True,
    ),
    "torque_speed_limit": Family("actuator", _torque_line, _torque_line_strength),
    "clock_drift": Family(
        "actuator", _slow_clock, lambda s, on, d: {"drift": d.size(80.0, 450.0)}, EVERY, ages=True, memory=list
    ),
    "flexible_coupling": Family("coupling", _coupled, _coupling_strength, asked=False),
    "cubic_spring": Family(
        "smooth",
        lambda k, q, v: -k["stiffness"] * (q - k["rest_position"]) - k["cubic"] * (q - k["rest_position"]) ** 3,
        _cubic_strength,
    ),
    "cogging_force": Family(
        "smooth", lambda k, q, v: k["amplitude"] * np.cos(2 * np.pi * q / k["period"] + k["phase"] - np.pi / 2),
        lambda s, on, d: {
            "amplitude": d.size(0.1, 0.6) * s.force(on), "period": 4 * s.reach(on) / d.any(3, 9),
            "phase": d.any(-3, 3),
        },
    ),
    "end_stop": Family("smooth", _stops, _stops_strength),
    "load_friction": Family(
        "grip", lambda k, v, load: k["share"] * load, lambda s, on, d: {"share": d.size(0.08, 0.5)},
        by_command=True, needs_levels=True,
    ),
    "cornering_drag": Family("twist", _slowed, lambda s, on, d: {"drag": d.size(0.05, 0.8)}, VEHICLE),
    "wheel_saturation": Family(
        "twist", _wheels,
        lambda s, on, d: {"limit": s.action("v_cmd") * (1.1 - d.size(0.1, 0.5)), "track": d.any(0.2, 0.5)},
        VEHICLE,
    ),
    "sensor_saturation": Family(
        "sensor", lambda k, y: np.where(y > k["high"], k["high"], np.where(y < k["low"], k["low"], y)), _range_strength
    ),
    "sensor_dead_zone": Family(
        "sensor", lambda k, y: y * (np.abs(y) >= k["width"]),
        lambda s, on, d: {"width": d.size(0.15, 0.6) * float(np.std(s.column(on)))},
    ),
    "lugre_friction": Family("bristles", bristles, _bristles_strength),
    "sensor_lag": Family(
        "past", _filtered, lambda s, on, d: {"time_constant": d.size(0.4, 4.0) * s.world.dt}, needs_speeds=True
    ),
}  # fmt: skip
"""Newer families, which worlds of the stratum `words` hold."""
FAMILIES: Mapping[str, Family] = {**OLD, **WORDS}
DECK = tuple(sorted(OLD))
"""The families that worlds of every stratum but `words` hold."""
STRENGTHS: Mapping[str, Draw] = {name: family.drawn for name, family in FAMILIES.items()}


def at_site(site: Site, families: Mapping[str, Family] = FAMILIES) -> dict[str, Callable[..., Any]]:
    """The laws of a site."""
    return {name: f.law for name, f in families.items() if f.site == site and f.law is not None}


def acting(families: Mapping[str, Family]) -> dict[str, Callable[[Values], Actuator]]:
    """Name of an actuator -> what makes one that runs of its parameters."""
    return {name: partial(Actuator, family) for name, family in families.items() if family.site == "actuator"}


SMOOTH, GRIP, TWIST = at_site("smooth"), at_site("grip"), at_site("twist")
BRISTLES, COUPLINGS = at_site("bristles"), at_site("coupling")
LAST_SENSORS, PAST_SENSORS = at_site("sensor"), at_site("past")
ACTUATORS: Mapping[str, Callable[[Values], Actuator]] = acting(FAMILIES)
SENSORS = ("marker_offset", "frame_rotation", "sensor_scale", "sensor_bias", "joint_offset", "sensor_delay")
"""Several act in this order, a delay before all others."""


def places_of(family: str, system: System, velocities: str | None = "measured") -> list[str]:
    """What a family can act on in a system whose velocities are measured, or are not, so that a recording shows it."""
    return FAMILIES[family].places(system, velocities)
