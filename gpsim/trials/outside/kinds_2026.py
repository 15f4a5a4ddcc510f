"""Ten kinds of physics outside the catalogue that ran for the first time in the measurement of seed 2026.

Every seed before 2028 draws them, but for those for tuning.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.hidden import Hidden, Values
from gpsim.trials.outside.kind import EVERY, MECHANICAL, VEHICLE, Generation, Kind


def _detent(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    x = (q - k["centre"]) / k["reach"]
    return np.asarray(-k["amplitude"] * x * np.exp(0.5 * (1.0 - x * x)))


def _soft_stop(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    depth = np.maximum(q - k["edge"], 0.0)
    return np.asarray(-k["stiffness"] * depth**1.5 * np.maximum(1.0 + k["loss"] * v, 0.0))


class FlexibleCoupling(Hidden):
    """A second inertia behind a spring and a damper: z is its position and velocity."""

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """At rest against the first."""
        return np.stack([q, v], axis=1)

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What the spring and the damper transmit."""
        return np.asarray(k["stiffness"] * (z[:, 0] - q) + k["damping"] * (z[:, 1] - v))

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the second inertia."""
        return np.stack([z[:, 1], -self.force(k, q, v, z) / k["inertia"]], axis=1)


class Ringing:
    """a'' = w^2 (u - a) - 2 zeta w a', stepped exactly for a held command; the mean of a step's two ends."""

    def __init__(self, k: Values) -> None:
        self._w, self._zeta = k["frequency"] * 2 * np.pi, k["damping_ratio"]
        self._a: FloatArray | float = 0.0
        self._rate: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The damped oscillation about the command (Ogata, Modern Control Engineering, section 5-3)."""
        decay, turn = self._zeta * self._w, self._w * np.sqrt(1.0 - self._zeta**2)
        gap, rate = self._a - u, self._rate
        cos, sin, shrink = np.cos(turn * h), np.sin(turn * h), np.exp(-decay * h)
        before = self._a
        self._a = u + shrink * (gap * cos + (rate + decay * gap) / turn * sin)
        self._rate = shrink * (rate * cos - (decay * rate + self._w**2 * gap) / turn * sin)
        return np.asarray((before + self._a) / 2)


def _carpet(k: Values, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    far = ((s[:, 0] - k["x"]) ** 2 + (s[:, 1] - k["y"]) ** 2) / k["radius"] ** 2
    return v * (1.0 - k["depth"] * np.exp(-0.5 * far)), w


def _gyroscopic(k: Values, s: FloatArray) -> FloatArray:
    """(B, 2): forces on the cart and on the pole, each proportional to the other's speed; they do no work together."""
    return np.stack([k["coupling"] * s[:, 3], -k["coupling"] * s[:, 1]], axis=1)


def _eccentric(k: Values, y: FloatArray) -> FloatArray:
    """What an encoder mounted off its axis reads."""
    return np.asarray(y + k["amplitude"] * np.sin(k["wave_number"] * y + k["phase"]))


GENERATION = Generation(
    since=0,
    kinds={
        "magnetic_detent": Kind("force", MECHANICAL, "a magnet that pulls to one place and reaches not far"),
        "flexible_coupling": Kind("hidden", MECHANICAL, "a hidden second mass on a spring"),
        "gyroscopic": Kind("coupled", ("cartpole",), "each axis pushed by the other's speed"),
        "fading_damping": Kind("force", MECHANICAL, "viscous friction that fades as the bearing warms up"),
        "soft_stop": Kind("force", MECHANICAL, "a one-sided contact: Hunt and Crossley (1975)"),
        "vibrating_pivot": Kind("force", ("pendulum",), "gravity modulated by a shaking support"),
        "speed_ripple": Kind("force", MECHANICAL, "a force periodic in speed: -A sin(v / v0)"),
        "ringing_actuator": Kind("actuator", EVERY, "a second-order actuator that overshoots"),
        "eccentric_encoder": Kind("sensor", EVERY, "y + A sin(k y)"),
        "carpet": Kind("twist", VEHICLE, "a round carpet that slows the vehicle down towards its middle"),
    },
    forces={
        "magnetic_detent": _detent,
        "fading_damping": lambda k, q, v, wall: -k["damping"] * v * (0.1 + 2.0 * np.exp(-wall / k["time"])),
        "soft_stop": _soft_stop,
        "vibrating_pivot": lambda k, q, v, wall: (
            -k["lever"] * k["acceleration"] * np.sin(2 * np.pi * k["frequency"] * wall) * np.sin(q)
        ),
        "speed_ripple": lambda k, q, v, wall: -k["amplitude"] * np.sin(v / k["speed"]),
    },
    hidden={"flexible_coupling": FlexibleCoupling()},
    coupled={"gyroscopic": _gyroscopic},
    actuators={"ringing_actuator": Ringing},
    twist={"carpet": _carpet},
    bent={"eccentric_encoder": _eccentric},
)
