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


def mechanical(system: str, c: int = 0, size: float = 1.0) -> list[Truth]:
    """Force effects on a coordinate, parameters, actuators and sensors of a mechanical system.

    size: how much stronger than usual the effects are.
    """
    from .worlds import ACTION, STATE, P

    names = list(STATE[system])
    q, action = names[2 * c], next(iter(ACTION[system]))
    big = size * {"cartpole": [3.0, 0.05], "slider": [1.2], "pendulum": [0.5]}[system][c]
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
            ratio = 1.0 + size * (
                0.5 if name == "pole_mass" else 0.2
            )  # a tenth of the cart's mass: it shows little
            out.append(
                Truth(
                    "parameter_offset", name, {"ratio": ratio}, World(system, {name: ratio * P[system][name]})
                )
            )
        out += actuators(system, 0, action, top, size=size)
        for i, name in enumerate(names):
            span, scale, delay = size * (0.05 if i % 2 == 0 else 0.2), 1.0 + 0.1 * size, 0.03 * size
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
                    {"scale": scale},
                    World(system, sensors=[sensor(i, lambda y, t, k=scale: k * y)]),
                ),
                Truth(
                    "sensor_delay", name, {"delay": delay}, World(system, sensors=[sensor(i, late(delay))])
                ),
            ]
    return out


def vehicle_sensors(system: str, size: float = 1.0) -> list[Truth]:
    """What may be wrong with one channel of a vehicle's pose."""
    offset, scale, delay = 0.1 * size, 1.0 + 0.1 * size, 0.15 * size
    make = lambda i, f: World(system, sensors=[sensor(i, f)])  # noqa: E731
    out = []
    for i, name in enumerate(("x", "y", "yaw")):
        out += [
            Truth("sensor_bias", name, {"offset": offset}, make(i, lambda y, t: y + offset)),
            Truth("sensor_scale", name, {"scale": scale}, make(i, lambda y, t: scale * y)),
            Truth("sensor_delay", name, {"delay": delay}, make(i, late(delay))),
        ]
    return out


def actuators(
    system: str, column: int, action: str, top: float, dt: float = 0.02, size: float = 1.0
) -> list[Truth]:
    """What may be wrong with one action."""
    make = lambda f: World(system, filters=[channel_filter(column, f)])  # noqa: E731
    time_constant, rate, half = 3 * dt * size, 0.15 * top / dt / size, 0.1 * top * size
    gain, bias, width = 1.0 - 0.2 * size, 0.1 * top * size, 0.2 * top * size
    limit, late_by, loss = (1.0 - 0.4 * size) * top, 2.5 * dt * size, 0.001 / dt * size
    positive, negative = 1.0 - 0.15 * size, 1.0 + 0.1 * size

    def backlash(level, u, h):
        return np.clip(level, u - half, u + half)

    def lag(level, u, h):
        return u + (level - u) * np.exp(-h / time_constant)

    def rated(level, u, h):
        return level + np.clip(u - level, -rate * h, rate * h)

    def held(update, mean=True):
        apply = level_filter(update, mean)
        return lambda u, t, h, m: apply(u, t, h, m)

    delay = delayed(late_by)
    return [
        Truth("actuator_gain", action, {"gain": gain}, make(lambda u, t, h, m: gain * u)),
        Truth("actuator_bias", action, {"bias": bias}, make(lambda u, t, h, m: u + bias)),
        Truth("actuator_dead_zone", action, {"width": width}, make(lambda u, t, h, m: u * (abs(u) >= width))),
        Truth("actuator_saturation", action, {"limit": limit}, make(lambda u, t, h, m: np.clip(u, -limit, limit))),
        Truth(
            "actuator_asymmetry", action, {"gain_positive": positive, "gain_negative": negative},
            make(lambda u, t, h, m: np.where(u > 0, positive, negative) * u),
        ),
        Truth("actuator_delay", action, {"delay": late_by}, make(lambda u, t, h, m: delay(u, t, h, m))),
        Truth("actuator_lag", action, {"time_constant": time_constant}, make(held(lag))),
        Truth("actuator_rate_limit", action, {"rate": rate}, make(held(rated))),
        Truth("actuator_backlash", action, {"half_width": half}, make(held(backlash, mean=False))),
        Truth("battery_sag", action, {"loss_per_second": loss}, make(lambda u, t, h, m: u * np.maximum(1 - loss * t, 0))),
    ]  # fmt: skip


def vehicles(system: str, size: float = 1.0) -> list[Truth]:
    """What may be wrong with a vehicle."""
    twist = lambda f: World(system, twist=f)  # noqa: E731
    gradient, curvature, slip = 0.6 * size, 0.15 * size, 0.12 * size
    radius = (
        0.8 * size if system == "unicycle" else 0.65 + 0.35 * size
    )  # the steering alone turns as sharply as 0.65 m
    forward, left, angle = 0.1 * size, 0.03 * size, 0.08 * size
    out = [
        Truth(
            "minimum_turning_radius", "vehicle", {"radius": radius},
            twist(lambda v, s, w: (v, s, np.clip(w, -abs(v) / radius, abs(v) / radius))),
        ),
        Truth("understeer", "vehicle", {"gradient": gradient}, twist(lambda v, s, w: (v, s, w / (1 + gradient * v**2)))),
        Truth("steering_bias", "vehicle", {"curvature": curvature}, twist(lambda v, s, w: (v, s, w + curvature * v))),
        Truth("lateral_slip", "vehicle", {"slip": slip}, twist(lambda v, s, w: (v, s - slip * v * w, w))),
        Truth(
            "marker_offset", "pose", {"forward": forward, "left": left},
            World(system, sensors=[marker(forward, left)]),
        ),
        Truth("frame_rotation", "pose", {"angle": angle}, World(system, sensors=[sensor(2, lambda y, t: y + angle)])),
    ]  # fmt: skip
    first, second = ("v_cmd", "w_cmd") if system == "unicycle" else ("v_cmd", "steering")
    out += actuators(system, 0, first, 0.8, 0.1, size)
    out += actuators(system, 1, second, 1.2 if system == "unicycle" else 0.3, 0.1, size)
    if system == "ackermann":
        ratio = 1.0 + 0.15 * size
        out.append(
            Truth(
                "parameter_offset", "wheelbase", {"ratio": ratio}, World(system, {"wheelbase": 0.2 * ratio})
            )
        )
    return out


def marker(forward, left):
    def apply(states, times):
        out = states.copy()
        sin, cos = np.sin(states[:, :, 2]), np.cos(states[:, :, 2])
        out[:, :, 0] += forward * cos - left * sin
        out[:, :, 1] += forward * sin + left * cos
        return out

    return apply
