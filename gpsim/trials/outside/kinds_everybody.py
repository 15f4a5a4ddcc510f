"""Everybody's ten kinds of physics outside the catalogue: every seed draws them, those for tuning draw no other."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.hidden import Hidden, Values
from gpsim.trials.outside.kind import EVERY, MECHANICAL, VEHICLE, Generation, Kind


def _gusts(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    """Twelve incommensurate waves between 0.1 and 3 Hz with random phases from k['phase']."""
    waves = np.arange(12)
    frequency = 0.1 * 30.0 ** ((waves + 0.37 * np.sin(7.0 * waves + k["phase"])) / 11.5)
    phase = 1000.0 * np.sin((waves + 1) * (k["phase"] + 0.1))
    waves_now = np.sin(2 * np.pi * wall[:, None] * frequency + phase)
    return np.asarray(k["amplitude"] * np.sqrt(2.0 / 12) * waves_now.sum(axis=1))


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


EVERYBODYS = Generation(
    since=0,
    kinds={
        "cogging": Kind("force", MECHANICAL, "a torque ripple: -A sin(k q + phase)"),
        "hardening_spring": Kind("force", MECHANICAL, "a force cubic in position: -c q^3"),
        "fan": Kind("force", MECHANICAL, "a force periodic in time"),
        "bouc_wen": Kind("hidden", MECHANICAL, "hysteresis: Wen (1976), n = 1"),
        "gusts": Kind("force", MECHANICAL, "a random force that wanders over seconds"),
        "exponential_aero": Kind("force", MECHANICAL, "-a (exp(|v|/v0) - 1) sgn v"),
        "position_gain": Kind("actuator", MECHANICAL, "a gain that varies with position"),
        "quantised_actuator": Kind("actuator", EVERY, "commands rounded to coarse levels"),
        "curve_slowdown": Kind("twist", VEHICLE, "v (1 - a |w|)"),
        "heading_slope": Kind("twist", VEHICLE, "a sloping floor: v + a sin(yaw - phase)"),
    },
    forces={
        "cogging": lambda k, q, v, wall: -k["amplitude"] * np.sin(k["wave_number"] * q + k["phase"]),
        "hardening_spring": lambda k, q, v, wall: -k["cubic"] * q**3,
        "fan": lambda k, q, v, wall: k["amplitude"] * np.sin(2 * np.pi * k["frequency"] * wall + k["phase"]),
        "gusts": _gusts,
        "exponential_aero": lambda k, q, v, wall: (
            -k["amplitude"] * np.sign(v) * np.expm1(np.minimum(np.abs(v) / k["speed"], 30.0))
        ),
    },
    hidden={"bouc_wen": BoucWen()},
    actuators={"position_gain": PositionGain, "quantised_actuator": Quantised},
    twist={
        "curve_slowdown": lambda k, v, w, s: (v * (1.0 - k["loss"] * np.minimum(np.abs(w), 2.5)), w),
        "heading_slope": lambda k, v, w, s: (v + k["amplitude"] * np.sin(s[:, 2] - k["phase"]), w),
    },
)
