"""What happens to a command on its way to the body: the catalogue's actuators as the truth has them, with memory.

Every actuator is an object that lives for one run: `act` is called once a fine step with the command (B,) and returns
what acts during that step. Several act in the order of ACTUATORS.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import Values


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
