"""Physics outside the catalogue: thirty kinds that no family of `gpsim.effects` describes, and never will.

A seed draws from twenty. Ten are everybody's. Ten are `final`: seeds 1 to 99, which tuning may use, never draw those,
and they ran for the first time in the measurement of seed 2026. From seed 2028 on ten newer ones (`newer_kinds.py`),
which no earlier seed draws, stand in their place: half of the kinds of that measurement are new again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import newer_kinds
from gpsim.trials.actuators import Actuator
from gpsim.trials.hidden import Hidden, Values
from gpsim.trials.newer_kinds import NEWER_SINCE

Force = Callable[[Values, FloatArray, FloatArray, FloatArray], FloatArray]
"""f(values, q, v, wall time) -> (B,) on its own coordinate."""
MECHANICAL = ("cartpole", "slider", "pendulum")
LAST_TUNING_SEED = 99


@dataclass(frozen=True)
class Kind:
    """One kind: where it acts, on which systems, and which seeds draw it.

    final: seeds for tuning leave it out, and so do those from NEWER_SINCE on. since_seed: the first seed that draws
    it; None: no such limit. places: what it acts on where the site does not say it.
    """

    site: Literal["force", "hidden", "coupled", "inertia", "actuator", "twist", "sensor"]
    systems: tuple[str, ...]
    final: bool
    text: str
    since_seed: int | None = None
    places: tuple[str, ...] = ()

    def drawn(self, seed: int) -> bool:
        """Whether a seed may draw it."""
        if self.since_seed is not None:
            return seed >= self.since_seed
        return not self.final or (seed < NEWER_SINCE and not 1 <= seed <= LAST_TUNING_SEED)


def _newer(
    site: Literal["force", "hidden", "inertia", "actuator", "twist", "sensor"],
    systems: tuple[str, ...],
    text: str,
    places: tuple[str, ...] = (),
) -> Kind:
    return Kind(site, systems, False, text, NEWER_SINCE, places)


KINDS: Mapping[str, Kind] = {
    "cogging": Kind("force", MECHANICAL, False, "a torque ripple: -A sin(k q + phase)"),
    "hardening_spring": Kind("force", MECHANICAL, False, "a force cubic in position: -c q^3"),
    "fan": Kind("force", MECHANICAL, False, "a force periodic in time"),
    "bouc_wen": Kind("hidden", MECHANICAL, False, "hysteresis: Wen (1976), n = 1"),
    "gusts": Kind("force", MECHANICAL, False, "a random force that wanders over seconds"),
    "exponential_aero": Kind("force", MECHANICAL, False, "-a (exp(|v|/v0) - 1) sgn v"),
    "position_gain": Kind("actuator", MECHANICAL, False, "a gain that varies with position"),
    "quantised_actuator": Kind(
        "actuator", (*MECHANICAL, "unicycle"), False, "commands rounded to coarse levels"
    ),
    "curve_slowdown": Kind("twist", ("unicycle",), False, "v (1 - a |w|)"),
    "heading_slope": Kind("twist", ("unicycle",), False, "a sloping floor: v + a sin(yaw - phase)"),
    "magnetic_detent": Kind(
        "force", MECHANICAL, True, "a magnet that pulls to one place and reaches not far"
    ),
    "flexible_coupling": Kind("hidden", MECHANICAL, True, "a hidden second mass on a spring"),
    "gyroscopic": Kind("coupled", ("cartpole",), True, "each axis pushed by the other's speed"),
    "fading_damping": Kind("force", MECHANICAL, True, "viscous friction that fades as the bearing warms up"),
    "soft_stop": Kind("force", MECHANICAL, True, "a one-sided contact: Hunt and Crossley (1975)"),
    "vibrating_pivot": Kind("force", ("pendulum",), True, "gravity modulated by a shaking support"),
    "speed_ripple": Kind("force", MECHANICAL, True, "a force periodic in speed: -A sin(v / v0)"),
    "ringing_actuator": Kind(
        "actuator", (*MECHANICAL, "unicycle"), True, "a second-order actuator that overshoots"
    ),
    "eccentric_encoder": Kind("sensor", (*MECHANICAL, "unicycle"), True, "y + A sin(k y)"),
    "carpet": Kind(
        "twist", ("unicycle",), True, "a round carpet that slows the vehicle down towards its middle"
    ),
    "eddy_brake": _newer("force", MECHANICAL, "a magnetic brake that lets go when the body is fast"),
    "rubber_buffer": _newer(
        "hidden", MECHANICAL, "a spring and a damper in a row: it forgets where it began"
    ),
    "uneven_inertia": _newer("inertia", MECHANICAL, "an unbalanced drive: the inertia varies with position"),
    "worm_gear": _newer("actuator", MECHANICAL, "friction that grows with the force transmitted"),
    "lost_commands": _newer(
        "actuator", (*MECHANICAL, "unicycle"), "outages in which the last command goes on"
    ),
    "hot_motor": _newer(
        "actuator", (*MECHANICAL, "unicycle"), "a gain that falls with the mean square of the command"
    ),
    "wheel_speed_limit": _newer("twist", ("unicycle",), "each of two wheels turns only so fast"),
    "towed_trolley": _newer("twist", ("unicycle",), "a trolley on a drawbar pulls the vehicle straight"),
    "slow_sensor": _newer(
        "sensor", (*MECHANICAL, "unicycle"), "a sensor that reads less often than recorded"
    ),
    "fisheye_camera": _newer("sensor", ("unicycle",), "a camera's radial distortion of the pose", ("pose",)),
}


def allowed(seed: int, system: str) -> list[str]:
    """The kinds that a seed may draw on a system, in the order of KINDS."""
    return [name for name, kind in KINDS.items() if system in kind.systems and kind.drawn(seed)]


def _gusts(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    """Twelve incommensurate waves between 0.1 and 3 Hz with random phases from k['phase']."""
    waves = np.arange(12)
    frequency = 0.1 * 30.0 ** ((waves + 0.37 * np.sin(7.0 * waves + k["phase"])) / 11.5)
    phase = 1000.0 * np.sin((waves + 1) * (k["phase"] + 0.1))
    waves_now = np.sin(2 * np.pi * wall[:, None] * frequency + phase)
    return np.asarray(k["amplitude"] * np.sqrt(2.0 / 12) * waves_now.sum(axis=1))


def _detent(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    x = (q - k["centre"]) / k["reach"]
    return np.asarray(-k["amplitude"] * x * np.exp(0.5 * (1.0 - x * x)))


def _soft_stop(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    depth = np.maximum(q - k["edge"], 0.0)
    return np.asarray(-k["stiffness"] * depth**1.5 * np.maximum(1.0 + k["loss"] * v, 0.0))


FORCES: Mapping[str, Force] = {
    "cogging": lambda k, q, v, wall: -k["amplitude"] * np.sin(k["wave_number"] * q + k["phase"]),
    "hardening_spring": lambda k, q, v, wall: -k["cubic"] * q**3,
    "fan": lambda k, q, v, wall: k["amplitude"] * np.sin(2 * np.pi * k["frequency"] * wall + k["phase"]),
    "gusts": _gusts,
    "exponential_aero": lambda k, q, v, wall: (
        -k["amplitude"] * np.sign(v) * np.expm1(np.minimum(np.abs(v) / k["speed"], 30.0))
    ),
    "magnetic_detent": _detent,
    "fading_damping": lambda k, q, v, wall: -k["damping"] * v * (0.1 + 2.0 * np.exp(-wall / k["time"])),
    "soft_stop": _soft_stop,
    "vibrating_pivot": lambda k, q, v, wall: (
        -k["lever"] * k["acceleration"] * np.sin(2 * np.pi * k["frequency"] * wall) * np.sin(q)
    ),
    "speed_ripple": lambda k, q, v, wall: -k["amplitude"] * np.sin(v / k["speed"]),
    "eddy_brake": newer_kinds.eddy_brake,
}


class BoucWen(Hidden):
    """Force -A z; z' = (v - (|v| z + v |z|) / 2) / width."""

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Relaxed."""
        return np.zeros((len(q), 2))

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """-A z."""
        return np.asarray(-k["amplitude"] * z[:, 0])

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Loading stiff, unloading stiffer."""
        out = np.zeros_like(z)
        out[:, 0] = (v - 0.5 * (np.abs(v) * z[:, 0] + v * np.abs(z[:, 0]))) / k["width"]
        return out


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


HIDDEN: Mapping[str, Hidden] = {
    "bouc_wen": BoucWen(),
    "flexible_coupling": FlexibleCoupling(),
    "rubber_buffer": newer_kinds.RubberBuffer(),
}


class PositionGain:
    """u (1 + a sin(k q + phase)) with q the state's first column."""

    def __init__(self, k: Values) -> None:
        self._k = k

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The varied command."""
        k = self._k
        return np.asarray(u * (1.0 + k["depth"] * np.sin(k["wave_number"] * s[:, 0] + k["phase"])))


class Quantised:
    """The command rounded to multiples of a step."""

    def __init__(self, k: Values) -> None:
        self._step = k["step"]

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The nearest level."""
        return np.asarray(self._step * np.round(u / self._step))


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


ACTUATORS: Mapping[str, Callable[[Values], Actuator]] = {
    "position_gain": PositionGain,
    "quantised_actuator": Quantised,
    "ringing_actuator": Ringing,
    **newer_kinds.ACTUATORS,
}


def _carpet(k: Values, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    far = ((s[:, 0] - k["x"]) ** 2 + (s[:, 1] - k["y"]) ** 2) / k["radius"] ** 2
    return v * (1.0 - k["depth"] * np.exp(-0.5 * far)), w


TWIST: Mapping[str, Callable[[Values, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]] = {
    "curve_slowdown": lambda k, v, w, s: (v * (1.0 - k["loss"] * np.minimum(np.abs(w), 2.5)), w),
    "heading_slope": lambda k, v, w, s: (v + k["amplitude"] * np.sin(s[:, 2] - k["phase"]), w),
    "carpet": _carpet,
    "wheel_speed_limit": newer_kinds.wheel_speed_limit,
}
"""f(values, v, w, state) -> (v, w)."""


def gyroscopic(k: Values, s: FloatArray) -> FloatArray:
    """(B, 2): forces on the cart and on the pole, each proportional to the other's speed; they do no work together."""
    return np.stack([k["coupling"] * s[:, 3], -k["coupling"] * s[:, 1]], axis=1)


def eccentric(k: Values, y: FloatArray) -> FloatArray:
    """What an encoder mounted off its axis reads."""
    return np.asarray(y + k["amplitude"] * np.sin(k["wave_number"] * y + k["phase"]))
