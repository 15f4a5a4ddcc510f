"""The catalogue's laws as the truth has them, written anew and never shared with `gpsim.effects`.

q, v: (B,) a coordinate's position and velocity; k: the effect's values; all results (B,).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import TrueEffect, Values

SMOOTH: Mapping[str, Callable[[Values, FloatArray, FloatArray], FloatArray]] = {
    "viscous_friction": lambda k, q, v: -k["damping"] * v,
    "quadratic_drag": lambda k, q, v: -k["drag"] * np.abs(v) * v,
    "spring": lambda k, q, v: -k["stiffness"] * (q - k["rest_position"]),
    "constant_force": lambda k, q, v: np.full_like(q, k["force"]),
}
"""Forces that are functions of position and velocity."""


def _stribeck(k: Values, v: FloatArray, load: FloatArray) -> FloatArray:
    rise = (k["static_force"] - k["force"]) * np.exp(-((v / k["stribeck_velocity"]) ** 2))
    return k["force"] + rise


def _coulomb(k: Values, v: FloatArray, load: FloatArray) -> FloatArray:
    if "coefficient" in k:
        return k["coefficient"] * np.maximum(load, 0.0)
    return np.full_like(v, k["force"])


GRIP: Mapping[str, Callable[[Values, FloatArray, FloatArray], FloatArray]] = {
    "coulomb_friction": _coulomb,
    "stribeck_friction": _stribeck,
    "local_friction_patch": lambda k, v, load: np.full_like(v, k["force"]),
}
"""Dry friction: the most it can resist with; it opposes motion and holds a body at rest."""


def _turning_radius(
    k: Values, v: FloatArray, lateral: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    most = np.abs(v) / k["radius"]
    return v, lateral, np.maximum(np.minimum(w, most), -most)


TWIST: Mapping[
    str,
    Callable[[Values, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]],
] = {
    "minimum_turning_radius": _turning_radius,
    "understeer": lambda k, v, lateral, w: (v, lateral, w / (1.0 + k["gradient"] * v * v)),
    "steering_bias": lambda k, v, lateral, w: (v, lateral, w + k["curvature"] * v),
    "lateral_slip": lambda k, v, lateral, w: (v, lateral - k["slip"] * v * w, w),
}
"""What becomes of a vehicle's twist; several act in this order."""


SENSORS = ("marker_offset", "frame_rotation", "sensor_scale", "sensor_bias", "joint_offset", "sensor_delay")
"""Several act in this order, a delay before all others."""


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


class Actuator(Protocol):
    """One actuator of a running batch."""

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """(B,) what acts during the next h s; u (B,) command, s (B, S) state, t (B,) s of the recording's clock."""
        ...


class Stateless:
    """A function of the command and the time."""

    def __init__(self, law: Callable[[FloatArray, FloatArray], FloatArray]) -> None:
        self._law = law

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The law."""
        return self._law(u, t)


class Delay:
    """u(t - T) with T a whole number of fine steps; nothing was commanded before the start."""

    def __init__(self, k: Values) -> None:
        self._delay = k["delay"]
        self._line: list[FloatArray] = []

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command of a delay ago."""
        self._line.append(u)
        back = round(self._delay / h)
        if len(self._line) <= back:
            return np.zeros_like(u)
        return self._line.pop(0)


class Lag:
    """T a' = u - a, integrated exactly; the mean over the step."""

    def __init__(self, k: Values) -> None:
        self._time_constant = k["time_constant"]
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The mean of the exponential approach."""
        x = h / self._time_constant
        behind = self._level - u
        self._level = u + behind * np.exp(-x)
        return np.asarray(u + behind * (1.0 - np.exp(-x)) / x)


class RateLimit:
    """|a'| <= r; the mean over the step, in which the command may be reached."""

    def __init__(self, k: Values) -> None:
        self._rate = k["rate"]
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """A level that walks towards the command."""
        before = self._level
        self._level = before + np.maximum(np.minimum(u - before, self._rate * h), -self._rate * h)
        walking = np.abs(self._level - before) / self._rate  # s of the step; then it stands there
        return np.asarray(self._level - (self._level - before) * walking / (2 * h))


class Backlash:
    """The play operator."""

    def __init__(self, k: Values) -> None:
        self._half = k["half_width"]
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What the gap's ends drag along."""
        self._level = np.maximum(np.minimum(self._level, u + self._half), u - self._half)
        return np.asarray(self._level)


ACTUATORS: Mapping[str, Callable[[Values], Actuator]] = {
    "actuator_delay": Delay,
    "actuator_dead_zone": lambda k: Stateless(lambda u, t: u * (np.abs(u) >= k["width"])),
    "actuator_saturation": lambda k: Stateless(
        lambda u, t: np.maximum(np.minimum(u, k["limit"]), -k["limit"])
    ),
    "actuator_gain": lambda k: Stateless(lambda u, t: k["gain"] * u),
    "actuator_asymmetry": lambda k: Stateless(
        lambda u, t: k["gain_positive"] * np.maximum(u, 0.0) + k["gain_negative"] * np.minimum(u, 0.0)
    ),
    "battery_sag": lambda k: Stateless(lambda u, t: u * np.maximum(1.0 - k["loss_per_second"] * t, 0.0)),
    "actuator_bias": lambda k: Stateless(lambda u, t: u + k["bias"]),
    "actuator_backlash": Backlash,
    "actuator_rate_limit": RateLimit,
    "actuator_lag": Lag,
}
