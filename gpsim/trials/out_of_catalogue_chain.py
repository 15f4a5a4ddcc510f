"""Physics outside the catalogue before and after a body: actuators, sensors, and what becomes of a vehicle's twist.

The comment above a kind is its law.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.catalogue import EVERY, VEHICLE, Family, Twisted, seconds
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, Values, waves

Remembered = tuple[FloatArray, Any]
TWIST: dict[str, Any] = {"site": "twist after", "systems": VEHICLE, "on": ("vehicle",)}
HIDDEN_TWIST = {**TWIST, "site": "hidden twist"}
READ: dict[str, Any] = {"site": "distortion", "systems": EVERY}
REMEMBERED = {**READ, "site": "memory"}


def _power_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """A limit that the stronger part of what drives the body exceeds."""
    power = s.pilot.commands[..., 0].ravel() * s.column(SYSTEMS[s.world.system].names[1])
    return {"power": (1.0 - d.size(0.3, 0.9)) * float(np.quantile(power[power > 0], 0.9))}


def _pulsed(k: Values, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
    """As long as they are open in the step; more than U they cannot give."""
    full, period = k["full"], k["period"]
    share = np.minimum(np.abs(u) / full, 1.0)

    def opened(t: FloatArray) -> FloatArray:
        """(B,) s that they were open until t."""
        periods = np.floor(t / period)
        return np.asarray(period * (periods * share + np.minimum(t / period - periods, share)))

    return np.asarray(np.sign(u) * full * (opened(t + h) - opened(t)) / h)


def _ripple_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Slower than the sampling by far: what is faster is only its mean."""
    fastest = 0.5 if SYSTEMS[s.world.system].vehicle else 1.5
    frequency = d.any(0.3 * fastest, fastest)
    return {"depth": d.size(0.15, 0.7), "frequency": frequency, "phase": d.any(0, 2 * np.pi)}


def _ringing(k: Values, z: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    """The damped oscillation about the command; the mean of a step's two ends."""
    (before, rate), w, zeta = z, k["frequency"] * 2 * np.pi, k["damping_ratio"]
    decay, turn, gap = zeta * w, w * np.sqrt(1.0 - zeta**2), before - u
    cos, sin, shrink = np.cos(turn * h), np.sin(turn * h), np.exp(-decay * h)
    level = u + shrink * (gap * cos + (rate + decay * gap) / turn * sin)
    rate = shrink * (rate * cos - (decay * rate + w**2 * gap) / turn * sin)
    return (before + level) / 2, (level, rate)


def _lost(k: Values, level: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    """The command; in a lost period, of which each is a few samples long, the last one before it."""
    number = np.floor((t + h / 2) / k["outage"])
    # The usual one-line hash: digits behind the point of a large multiple of a sine.
    chance = np.abs(np.sin(12.9898 * number + k["phase"])) * 43758.5453 % 1.0
    level = np.where(chance < k["share"], level, u)
    return level, level


def _warmed(k: Values, heat: Any, given: FloatArray, h: float) -> Any:
    """Of what warms up: time T' = (what it gives / rated)^2 - T; cold at an episode's start."""
    goal = (given / k["rated"]) ** 2
    return goal + (heat - goal) * np.exp(-h / k["time"])


def _hot(k: Values, heat: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    return u * np.maximum(1.0 - k["loss"] * heat, 0.0), _warmed(k, heat, u, h)


def _sticky(k: Values, level: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    level = np.where(np.abs(u - level) > k["band"], u, level)
    return level, level


def _filled(k: Values, level: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    behind = level - u
    x = h / np.where(behind * level > 0.0, k["vent"], k["fill"])
    return u - behind * np.expm1(-x) / x, u + behind * np.exp(-x)


def _filled_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    vent = d.size(1.0, 8.0) * s.world.dt
    return {"fill": d.any(0.1, 0.3) * vent, "vent": vent}


def _folding(k: Values, z: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    heat, folded = z
    out = np.where(folded, k["share"], 1.0) * u
    heat = _warmed(k, heat, out, h)
    return out, (heat, np.where(folded, heat > k["reset"], heat >= 1.0))


def _folding_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """The typical command heats it up to where it folds back, and that share of it lets it cool, over and over."""
    share, column = 1.0 - d.size(0.12, 0.6), list(SYSTEMS[s.world.system].action).index(on)
    typical = float(np.sqrt(np.mean(s.pilot.commands[..., column] ** 2)))
    hot, cool = (1.0 - part * (1.0 - share**2) for part in (0.25, 0.75))  # between the two means of heat
    own = {"share": share, "rated": typical * np.sqrt(hot), "reset": cool / hot}
    return {**own, "time": seconds(s, d.any(0.05, 0.12))}


def _reversing(k: Values, z: Any, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> Remembered:
    """The command, for as long as it is closed in the step; the mean over it."""
    closed, left = z  # the side on which it is closed; how long it stays open
    side = np.where(u == 0.0, closed, np.sign(u))
    left = np.where(side * closed < 0.0, k["pause"], left)
    return u * (1.0 - np.minimum(left, h) / h), (side, np.maximum(left - h, 0.0))


ACTUATORS: Mapping[str, Family] = {
    # A gain that varies with position: u (1 + a sin(k q + phase)) with q the state's first column.
    "position_gain": Family(
        "actuator",
        lambda k, u, s, t, h: u * (1.0 + k["depth"] * np.sin(k["wave_number"] * s[:, 0] + k["phase"])),
        lambda s, on, d: {"depth": d.size(0.12, 0.6), **waves(s, SYSTEMS[s.world.system].names[0], d, 1, 3)},
    ),
    # Commands rounded to coarse levels, the multiples of a step.
    "quantised_actuator": Family(
        "actuator", lambda k, u, s, t, h: k["step"] * np.round(u / k["step"]),
        lambda s, on, d: {"step": d.size(0.25, 0.9) * s.action(on)}, EVERY, needs_levels=True,
    ),
    # A gear whose friction grows with what it transmits: u - mu |u| tanh(v / v0), v the driven coordinate's.
    "worm_gear": Family(
        "actuator", lambda k, u, s, t, h: u - k["friction"] * np.abs(u) * np.tanh(s[:, 1] / k["speed"]),
        lambda s, on, d: {
            "friction": d.size(0.08, 0.45), "speed": 0.1 * s.speed(SYSTEMS[s.world.system].coordinates[0])
        },
        since=2028, needs_levels=True,
    ),
    # A supply that gives only so much power: |u v| <= P while it drives, v the driven coordinate's. It brakes in full.
    "power_limit": Family(
        "actuator", lambda k, u, s, t, h: u * (k["power"] / np.maximum(u * s[:, 1], k["power"])),
        _power_drawn, since=2029,
    ),
    # A stick's curve that is soft in the middle and right at full command U: u (1 - e + e (u / U)^2).
    "expo_curve": Family(
        "actuator", lambda k, u, s, t, h: u * (1.0 - k["softness"] + k["softness"] * (u / k["full"]) ** 2),
        lambda s, on, d: {"softness": d.size(0.15, 0.7), "full": s.action(on)}, EVERY, since=2030, needs_levels=True,
    ),
    # Thrusters that are open or shut: +-U for the share |u| / U of every period, then nothing. The mean over the step.
    # Sidi (1997), Spacecraft Dynamics and Control, chapter 9.
    "pulsed_thrusters": Family(
        "actuator", _pulsed,
        lambda s, on, d: {"period": d.size(0.6, 4.0) * s.world.dt, "full": d.any(1.1, 1.5) * s.action(on)},
        since=2031, needs_levels=True,
    ),
    # A supply that is not smoothed: u (1 + a sin(2 pi f t + phase)).
    "supply_ripple": Family(
        "actuator",
        lambda k, u, s, t, h: u * (1.0 + k["depth"] * np.sin(2 * np.pi * k["frequency"] * t + k["phase"])),
        _ripple_drawn, EVERY, since=2040,
    ),
    # A second-order actuator that overshoots: a'' = w^2 (u - a) - 2 zeta w a', stepped exactly for a held command.
    # Ogata, Modern Control Engineering, section 5-3.
    "ringing_actuator": Family(
        "actuator", _ringing,
        lambda s, on, d: {
            "frequency": 1.0 / (d.size(6.0, 20.0) * s.world.dt), "damping_ratio": d.any(0.1, 0.3)
        },
        EVERY, since=0, memory=lambda: (0.0, 0.0),
    ),
    # Outages of a radio link: what acts is the last command that arrived. Which are lost follows from the moment.
    # Outages last two to five samples; a sweep holds its commands for longer.
    "lost_commands": Family(
        "actuator", _lost,
        lambda s, on, d: {
            "share": d.size(0.06, 0.35), "outage": round(d.any(1.5, 5.49)) * s.world.dt, "phase": d.any(0, 6.28)
        },
        EVERY, since=2028, unseen_under=("sweep",), memory=float,
    ),
    # A gain 1 - loss T that falls as the motor warms up by its commands, within a part of an episode.
    "hot_motor": Family(
        "actuator", _hot,
        lambda s, on, d: {"loss": d.size(0.12, 0.6), "rated": s.action(on), "time": seconds(s, d.any(0.15, 0.5))},
        EVERY, since=2028, memory=float,
    ),
    # It stays where it is until the command is more than a band away, then it goes there in one jump.
    # Stenman, Gustafsson and Forsman (2003), A segmentation-based method for detection of stiction in control valves.
    "sticky_valve": Family(
        "actuator", _sticky, lambda s, on, d: {"band": d.size(0.12, 0.7) * s.action(on)}, EVERY, since=2029,
        needs_levels=True, memory=float,
    ),
    # A chamber that fills in one time and vents in another: T a' = u - a, T by whether |a| grows or falls.
    # Exact for a command held while a keeps its side; the mean over the step.
    "pneumatic_valve": Family("actuator", _filled, _filled_drawn, EVERY, since=2030, memory=float),
    # A drive that gives a share of its command once its heat reaches 1, until that is back at `reset`.
    "overload_foldback": Family(
        "actuator", _folding, _folding_drawn, EVERY, since=2031, memory=lambda: (0.0, False)
    ),
    # A contactor that opens to reverse: for a pause after the command changed its sign nothing acts.
    "reversing_contactor": Family(
        "actuator", _reversing, lambda s, on, d: {"pause": d.size(0.8, 6.0) * s.world.dt}, since=2040,
        memory=lambda: (0.0, 0.0),
    ),
}  # fmt: skip


def _eccentric_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    once = {"wave_number": 1.0, "phase": d.any(0, 6.28)} if on == "yaw" else waves(s, on, d, 2, 4)
    return {"amplitude": d.size(0.04, 0.2) * min(s.reach(on), 1.0), **once}


def _fisheye_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    far = float(np.sqrt(np.mean(s.column("x") ** 2 + s.column("y") ** 2)))
    return {"height": far / np.sqrt(d.size(0.04, 0.4))}


def _coarse_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {"step": d.size(0.03, 0.3) * min(s.reach(on), 1.0)}


def _slow(k: Values, past: FloatArray, h: float) -> FloatArray:
    period, index = k["period"], len(past) - 1
    ticks = np.floor((index + 0.5) * h / period)
    return np.asarray(past[min(int(ticks * period / h + 0.5), index)])


def _swaying(k: Values, past: FloatArray, h: float) -> FloatArray:
    turn, zeta = 2 * np.pi * k["frequency"], k["damping_ratio"]
    decay, ring = zeta * turn, turn * np.sqrt(1.0 - zeta**2)
    age = h * (np.arange(len(past) - 1)[::-1] + 0.5)
    behind = np.exp(-decay * age) * (np.cos(ring * age) - decay / ring * np.sin(ring * age))
    return np.asarray(past[-1] - (behind[:, None] * np.diff(past, axis=0)).sum(axis=0))


def _swaying_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """The slower it sways the more; a vehicle, which is slower, carries a longer stalk."""
    period = d.size(0.1, 0.5) * (4.0 if SYSTEMS[s.world.system].vehicle else 1.0)
    return {"frequency": 1.0 / period, "damping_ratio": d.any(0.1, 0.3)}


def _warming_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Warm before the episode ends; a vehicle's heading goes round, so that its range says nothing."""
    size = d.size(0.05, 0.4) * (1.0 if SYSTEMS[s.world.system].vehicle else s.reach(on))
    return {"offset": d.sign() * size, "time": seconds(s, d.any(0.1, 0.4))}


def _played(k: Values, past: FloatArray, h: float) -> FloatArray:
    gap = k["gap"]
    free = past - past[0] + gap
    held = free + np.maximum(np.maximum.accumulate(-free), 0.0)
    least = np.minimum.accumulate(held[::-1])[::-1]  # from every moment until now
    over = np.minimum(np.maximum(held - 2.0 * gap, 0.0), least).max(axis=0)
    return np.asarray(past[-1] - (held[-1] - over - gap))


SENSORS: Mapping[str, Family] = {
    # An encoder mounted off its axis: y + A sin(k y + phase).
    "eccentric_encoder": Family(
        law=lambda k, y: y + k["amplitude"] * np.sin(k["wave_number"] * y + k["phase"]), draw=_eccentric_drawn,
        since=0, **READ,
    ),
    # Positions by a camera at height H above the origin whose orthographic fisheye was taken for a pinhole.
    # It sees the radius H sin(atan(r / H)) = r / sqrt(1 + (r / H)^2).
    "fisheye_camera": Family(
        "distortion", lambda k, y: y / np.sqrt(1.0 + (y**2).sum(axis=1) / k["height"] ** 2)[:, None],
        _fisheye_drawn, VEHICLE, since=2028, on=("pose",),
    ),
    # An encoder of few lines: multiples of its step.
    "coarse_encoder": Family(
        law=lambda k, y: k["step"] * np.floor(y / k["step"] + 0.5), draw=_coarse_drawn, since=2030, **READ
    ),
    # An encoder with a bit that is always 0: where it should be 1, the reading is too small by the bit's worth.
    "stuck_bit": Family(
        law=lambda k, y: y - k["step"] * (np.floor(y / k["step"]) % 2.0), draw=_coarse_drawn, since=2040, **READ
    ),
    # A sensor that reads less often than recorded: what was at its last tick; ticks begin with the episode.
    # Nowhere that velocities are differentiated: a reading that repeats is no speed of 0.
    "slow_sensor": Family(
        law=_slow, draw=lambda s, on, d: {"period": d.size(1.3, 5.0) * s.world.dt}, since=2028, needs_speeds=True,
        **REMEMBERED,
    ),
    # A marker on a springy stalk: p'' = w^2 (q - p) + 2 zeta w (q' - p'), what is read is p.
    # Base excitation (Inman, Engineering Vibration, section 2.4): the sum of its responses to a past of small moves,
    # each taken half a fine step after it began.
    "loose_marker": Family(law=_swaying, draw=_swaying_drawn, since=2029, **REMEMBERED),
    # A zero that moves as the sensor warms up: y + A (1 - e^(-t / T)), t s after the episode's start.
    "warming_sensor": Family(
        law=lambda k, past, h: past[-1] - k["offset"] * np.expm1(-h * (len(past) - 1) / k["time"]),
        draw=_warming_drawn, since=2030, **REMEMBERED,
    ),
    # An encoder behind a gear with play: it reads on only when an end of the gap, `gap` to either side, pushes it.
    # What lies between the gap's lower end and the body, a path held between 0 and 2 gap: Kruk, Lehoczky, Ramanan and
    # Shreve (2007), An explicit formula for the Skorokhod map on [0, a]. In the middle of the gap at the start.
    "encoder_play": Family(
        law=_played, draw=lambda s, on, d: {"gap": d.size(0.03, 0.25) * min(s.reach(on), 1.0)}, since=2031,
        **REMEMBERED,
    ),
}  # fmt: skip
"""Distortions are the last thing that happens to a reading, those with a memory the first."""


def _where_it_drives(s: Scales) -> dict[str, float]:
    """Middle and radius of a place where the vehicle is most of the time."""
    x, y = (float(np.median(s.column(name))) for name in ("x", "y"))
    return {"x": x, "y": y, "radius": 0.6 * min(s.reach("x"), s.reach("y"))}


def _off(k: Values, s: FloatArray) -> Twisted:
    """(B,) how far a vehicle is off a round place in x and y, and the square of its distance in radii."""
    x, y = s[:, 0] - k["x"], s[:, 1] - k["y"]
    return x, y, (x**2 + y**2) / k["radius"] ** 2


def _hill(k: Values, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    x, y, far = _off(k, s)
    ahead = x * np.cos(s[:, 2]) + y * np.sin(s[:, 2])
    return v + k["loss"] * ahead / k["radius"] * np.exp(0.5 * (1.0 - far)), w


def _wheels(k: Values, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    limit, half = k["limit"], k["half_track"]
    left, right = (np.maximum(np.minimum(x, limit), -limit) for x in (v - half * w, v + half * w))
    return (left + right) / 2, (right - left) / (2 * half)


def _wheels_drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """A limit that part of the commanded curves exceed with their outer wheel."""
    half, (v, w) = d.any(0.12, 0.3), s.pilot.commands.reshape(-1, 2).T
    most = float(np.quantile(np.abs(v) + half * np.abs(w), 0.95))
    return {"half_track": half, "limit": (1.0 - d.size(0.08, 0.4)) * most}


def _trolley(k: Values, v: FloatArray, w: FloatArray, z: FloatArray) -> Twisted:
    swing = v / k["length"] * np.sin(z)
    turning = w - k["pull"] * swing
    return v, turning, turning - swing


def _eccentric(k: Values, v: FloatArray, w: FloatArray, z: FloatArray) -> Twisted:
    """Speed and turn rate at once, as only one of two wheels differs."""
    half = k["half_track"]
    rolling = v - half * w
    more = k["depth"] * np.sin(z) * rolling
    return v + more / 2, w - more / (2 * half), rolling / k["radius"]


def _lagging(k: Values, v: FloatArray, w: FloatArray, z: FloatArray) -> Twisted:
    """Whenever the speed changes it turns, whenever the turn rate changes it slows down or speeds up."""
    half = k["half_track"]
    left, right = v - half * w, v + half * w
    return (z + right) / 2, (right - z) / (2 * half), (left - z) / k["time"]


def _cable(k: Values, v: FloatArray, w: FloatArray, z: FloatArray) -> Twisted:
    """Slower the more it is wound up, faster as it unwinds."""
    turning = w - k["rate"] * z
    return v, turning, turning


TWISTS: Mapping[str, Family] = {
    # Curves cost speed: v (1 - a |w|).
    "curve_slowdown": Family(
        law=lambda k, v, w, s: (v * (1.0 - k["loss"] * np.minimum(np.abs(w), 2.5)), w),
        draw=lambda s, on, d: {"loss": d.size(0.04, 0.3)}, **TWIST,
    ),
    # A sloping floor: v + a sin(yaw - phase).
    "heading_slope": Family(
        law=lambda k, v, w, s: (v + k["amplitude"] * np.sin(s[:, 2] - k["phase"]), w),
        draw=lambda s, on, d: {"amplitude": d.size(0.02, 0.2), "phase": d.any(0, 6.28)}, **TWIST,
    ),
    # A round carpet that slows the vehicle down towards its middle: v (1 - a e^(-r^2 / 2 R^2)).
    "carpet": Family(
        law=lambda k, v, w, s: (v * (1.0 - k["depth"] * np.exp(-0.5 * _off(k, s)[2])), w),
        draw=lambda s, on, d: {"depth": d.size(0.15, 0.6), **_where_it_drives(s)}, since=0, **TWIST,
    ),
    # A round hill of height e^(-r^2 / 2 R^2): slower uphill, faster downhill; `loss` m/s straight up its steepest.
    "hill": Family(
        law=_hill, draw=lambda s, on, d: {"loss": d.size(0.1, 0.5) * s.action("v_cmd"), **_where_it_drives(s)},
        since=2030, **TWIST,
    ),
    # Left and right wheel, v -+ b w, no faster than the limit: a fast curve costs speed and turn rate at once.
    "wheel_speed_limit": Family(
        law=_wheels, draw=_wheels_drawn, word="wheel_saturation", since=2028, needs_levels=True, **TWIST
    ),
    # A wind that pushes the tail aside and so turns the vehicle into it: w + a sin(wind - yaw).
    "weathervane": Family(
        law=lambda k, v, w, s: (v, w + k["turn"] * np.sin(k["wind"] - s[:, 2])),
        draw=lambda s, on, d: {"turn": d.size(0.05, 0.4) * s.action("w_cmd"), "wind": d.any(0, 6.28)},
        since=2031, **TWIST,
    ),
    # A floor of boards whose grooves turn the wheels along, whichever way: w + a sin(2 (line - yaw)).
    "grooved_floor": Family(
        law=lambda k, v, w, s: (v, w + k["turn"] * np.sin(2 * (k["line"] - s[:, 2]))),
        draw=lambda s, on, d: {"turn": d.size(0.05, 0.4) * s.action("w_cmd"), "line": d.any(0, 3.14)},
        since=2040, **TWIST,
    ),
    # A trolley on a drawbar of length L that swivels freely; its angle phi behind the vehicle is the hidden state.
    # Its wheels do not slip, so phi' = w - v / L sin(phi), and its pull turns the vehicle back: w - b v / L sin(phi).
    "towed_trolley": Family(
        law=_trolley, draw=lambda s, on, d: {"length": d.any(0.2, 0.6), "pull": d.size(0.08, 0.6)}, since=2028,
        **HIDDEN_TWIST,
    ),
    # The left wheel's axle is off its centre: it rolls (1 + a sin(phi)) as far, phi' = commanded speed / radius.
    # phi, its angle, is the hidden state; it is put down the same way every time.
    "eccentric_wheel": Family(
        law=_eccentric,
        draw=lambda s, on, d: {
            "depth": d.size(0.03, 0.3), "half_track": d.any(0.1, 0.25), "radius": d.any(0.05, 0.12)
        },
        since=2029, **HIDDEN_TWIST,
    ),
    # The side force of a tyre builds up over a way, not over a time: z' = |v| (w - z) / length, turn rate z.
    # von Schlippe and Dietrich (1941); Pacejka (2012), Tire and Vehicle Dynamics, 3rd ed., section 7.2. Of a vehicle
    # that drives: at rest z would stay; the speed commanded in these worlds is never 0.
    "tyre_relaxation": Family(
        law=lambda k, v, w, z: (v, z, np.abs(v) * (w - z) / k["length"]),
        draw=lambda s, on, d: {"length": d.size(0.02, 0.4)}, since=2029, **HIDDEN_TWIST,
    ),
    # The left wheel's motor is slow: T z' = (v - b w) - z with z what the wheel rolls; the right one is quick.
    "lagging_wheel": Family(
        law=_lagging,
        draw=lambda s, on, d: {"time": d.size(0.5, 6.0) * s.world.dt, "half_track": d.any(0.1, 0.25)},
        since=2031, **HIDDEN_TWIST,
    ),
    # A cable from the ceiling that is wound up by turning and turns the vehicle back: w - k z, z' = w - k z.
    # z, by how much it is wound up since the start, is the hidden state.
    "twisting_cable": Family(
        law=_cable, draw=lambda s, on, d: {"rate": d.size(0.03, 0.4)}, since=2040, **HIDDEN_TWIST
    ),
}  # fmt: skip
OF_CHAINS: Mapping[str, Family] = {**ACTUATORS, **SENSORS, **TWISTS}
