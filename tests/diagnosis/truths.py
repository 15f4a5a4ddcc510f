"""The plain case of every family: worlds, and what a diagnosis should say of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .worlds import World


@dataclass(frozen=True)
class Truth:
    """A world's effect and its parameter values."""

    family: str
    on: str
    values: dict
    world: World


def channel_filter(column, function):
    def apply(u, t, h, memory):
        out = u.copy()
        out[:, column] = function(u[:, column], t, h, memory)
        return out

    return apply


def level_filter(update, mean=True):
    """The mean over a fine step of a level that moves; a level that jumps has its new value at once."""

    def apply(u, t, h, memory):
        level = memory.setdefault(id(update), np.zeros_like(u))
        before = level.copy()
        level[:] = update(level, u, h)
        return (before + level) / 2 if mean else level.copy()

    return apply


def delayed(delay):
    past = {}

    def apply(u, t, h, memory):
        line = past.setdefault(id(memory), [])
        line.append(u.copy())
        back = round(delay / h)
        return line[-1 - back] if len(line) > back else np.zeros_like(u)

    return apply


def sensor(column, function):
    def apply(states, times):
        out = states.copy()
        out[:, :, column] = function(states[:, :, column], times)
        return out

    return apply


def late(delay):
    def function(values, times):
        return np.stack(
            [np.interp(times - delay, times, values[:, i]) for i in range(values.shape[1])], axis=1
        )

    return function


def mechanical(system: str, c: int = 0) -> list[Truth]:
    """Force effects on a coordinate, parameters, actuators and sensors of a mechanical system."""
    from .worlds import ACTION, STATE, P

    names = list(STATE[system])
    q, action = names[2 * c], next(iter(ACTION[system]))
    big = {"cartpole": [3.0, 0.05], "slider": [1.2], "pendulum": [0.5]}[system][c]
    smooth = lambda f: World(system, forces={c: f})  # noqa: E731
    dry = lambda f: World(system, grips={c: f})  # noqa: E731
    top = {"cartpole": 10.0, "slider": 6.0, "pendulum": 3.0}[system]
    out = [
        Truth("coulomb_friction", q, {"force": big}, dry(lambda x, v, n: big + 0 * v)),
        Truth("viscous_friction", q, {"damping": big}, smooth(lambda x, v, t: -big * v)),
        Truth("quadratic_drag", q, {"drag": big}, smooth(lambda x, v, t: -big * abs(v) * v)),
        Truth(
            "stribeck_friction", q, {"force": big / 2, "static_force": 1.5 * big, "stribeck_velocity": 0.2},
            dry(lambda x, v, n: big / 2 + big * np.exp(-((v / 0.2) ** 2))),
        ),
        Truth("spring", q, {"stiffness": 3 * big, "rest_position": 0.1}, smooth(lambda x, v, t: -3 * big * (x - 0.1))),
        Truth("constant_force", q, {"force": big / 2}, smooth(lambda x, v, t: big / 2)),
        Truth(
            "local_friction_patch", q, {"force": 2 * big},
            dry(lambda x, v, n: 2 * big * ((x > 0.0) & (x < 0.4))),
        ),
    ]  # fmt: skip
    if c == 0:
        for name in P[system]:
            if name in ("pole_mass",):
                continue
            out.append(
                Truth("parameter_offset", name, {"ratio": 1.2}, World(system, {name: 1.2 * P[system][name]}))
            )
        out += actuators(system, 0, action, top)
        for i, name in enumerate(names):
            span = 0.05 if i % 2 == 0 else 0.2
            out += [
                Truth(
                    "sensor_bias",
                    name,
                    {"offset": span},
                    World(system, sensors=[sensor(i, lambda y, t, o=span: y + o)]),
                ),
                Truth(
                    "sensor_scale",
                    name,
                    {"scale": 1.1},
                    World(system, sensors=[sensor(i, lambda y, t: 1.1 * y)]),
                ),
                Truth("sensor_delay", name, {"delay": 0.03}, World(system, sensors=[sensor(i, late(0.03))])),
            ]
    return out


def vehicle_sensors(system: str) -> list[Truth]:
    """What may be wrong with one channel of a vehicle's pose."""
    make = lambda i, f: World(system, sensors=[sensor(i, f)])  # noqa: E731
    out = []
    for i, name in enumerate(("x", "y", "yaw")):
        out += [
            Truth("sensor_bias", name, {"offset": 0.1}, make(i, lambda y, t: y + 0.1)),
            Truth("sensor_scale", name, {"scale": 1.1}, make(i, lambda y, t: 1.1 * y)),
            Truth("sensor_delay", name, {"delay": 0.15}, make(i, late(0.15))),
        ]
    return out


def actuators(system: str, column: int, action: str, top: float, dt: float = 0.02) -> list[Truth]:
    """What may be wrong with one action."""
    make = lambda f: World(system, filters=[channel_filter(column, f)])  # noqa: E731
    time_constant, rate, half = 3 * dt, 0.15 * top / dt, 0.1 * top

    def backlash(level, u, h):
        return np.clip(level, u - half, u + half)

    def lag(level, u, h):
        return u + (level - u) * np.exp(-h / time_constant)

    def limit(level, u, h):
        return level + np.clip(u - level, -rate * h, rate * h)

    def held(update, mean=True):
        apply = level_filter(update, mean)
        return lambda u, t, h, m: apply(u, t, h, m)

    delay = delayed(2.5 * dt)
    return [
        Truth("actuator_gain", action, {"gain": 0.8}, make(lambda u, t, h, m: 0.8 * u)),
        Truth("actuator_bias", action, {"bias": 0.1 * top}, make(lambda u, t, h, m: u + 0.1 * top)),
        Truth("actuator_dead_zone", action, {"width": 0.2 * top}, make(lambda u, t, h, m: u * (abs(u) >= 0.2 * top))),
        Truth(
            "actuator_saturation", action, {"limit": 0.6 * top}, make(lambda u, t, h, m: np.clip(u, -0.6 * top, 0.6 * top)),
        ),
        Truth(
            "actuator_asymmetry", action, {"gain_positive": 0.85, "gain_negative": 1.1},
            make(lambda u, t, h, m: np.where(u > 0, 0.85, 1.1) * u),
        ),
        Truth("actuator_delay", action, {"delay": 2.5 * dt}, make(lambda u, t, h, m: delay(u, t, h, m))),
        Truth("actuator_lag", action, {"time_constant": time_constant}, make(held(lag))),
        Truth("actuator_rate_limit", action, {"rate": rate}, make(held(limit))),
        Truth("actuator_backlash", action, {"half_width": half}, make(held(backlash, mean=False))),
        Truth("battery_sag", action, {"loss_per_second": 0.05}, make(lambda u, t, h, m: u * (1 - 0.05 * t))),
    ]  # fmt: skip


def vehicles(system: str) -> list[Truth]:
    """What may be wrong with a vehicle."""
    twist = lambda f: World(system, twist=f)  # noqa: E731
    out = [
        Truth(
            "minimum_turning_radius", "vehicle", {"radius": 0.8},
            twist(lambda v, s, w: (v, s, np.clip(w, -abs(v) / 0.8, abs(v) / 0.8))),
        ),
        Truth("understeer", "vehicle", {"gradient": 0.6}, twist(lambda v, s, w: (v, s, w / (1 + 0.6 * v**2)))),
        Truth("steering_bias", "vehicle", {"curvature": 0.15}, twist(lambda v, s, w: (v, s, w + 0.15 * v))),
        Truth("lateral_slip", "vehicle", {"slip": 0.12}, twist(lambda v, s, w: (v, s - 0.12 * v * w, w))),
        Truth("marker_offset", "pose", {"forward": 0.1, "left": 0.03}, World(system, sensors=[marker])),
        Truth("frame_rotation", "pose", {"angle": 0.08}, World(system, sensors=[sensor(2, lambda y, t: y + 0.08)])),
    ]  # fmt: skip
    first, second = ("v_cmd", "w_cmd") if system == "unicycle" else ("v_cmd", "steering")
    out += actuators(system, 0, first, 0.8, 0.1)
    out += actuators(system, 1, second, 1.2 if system == "unicycle" else 0.3, 0.1)
    if system == "ackermann":
        out.append(
            Truth("parameter_offset", "wheelbase", {"ratio": 1.15}, World(system, {"wheelbase": 0.23}))
        )
    return out


def marker(states, times):
    out = states.copy()
    sin, cos = np.sin(states[:, :, 2]), np.cos(states[:, :, 2])
    out[:, :, 0] += 0.1 * cos - 0.03 * sin
    out[:, :, 1] += 0.1 * sin + 0.03 * cos
    return out
