"""Forces that depend on the clock on the wall."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import Force
from gpsim.trials.worlds import Dial, Scales, rounded


class Fan(Force):
    """A force periodic in time: A sin(2 pi f t + phase)."""

    name = "fan"
    since = None

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(k["amplitude"] * np.sin(2 * np.pi * k["frequency"] * wall + k["phase"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)),
            "frequency": d.any(0.4, 2.5),
            "phase": d.any(0, 6.28),
        }


class Gusts(Force):
    """A random force that wanders over seconds: twelve incommensurate waves between 0.1 and 3 Hz.

    Their frequencies and phases follow from k['phase'].
    """

    name = "gusts"
    since = None

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        waves = np.arange(12)
        frequency = 0.1 * 30.0 ** ((waves + 0.37 * np.sin(7.0 * waves + k["phase"])) / 11.5)
        phase = 1000.0 * np.sin((waves + 1) * (k["phase"] + 0.1))
        waves_now = np.sin(2 * np.pi * wall[:, None] * frequency + phase)
        return np.asarray(k["amplitude"] * np.sqrt(2.0 / 12) * waves_now.sum(axis=1))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"amplitude": rounded(d.size(0.1, 0.5) * s.force(on)), "phase": d.any(0, 6.28)}


class FadingDamping(Force):
    """Viscous friction that fades as the bearing warms up: -b v (0.1 + 2 e^(-t / T))."""

    name = "fading_damping"
    since = 0

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["damping"] * v * (0.1 + 2.0 * np.exp(-wall / k["time"])))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "damping": rounded(d.size(0.08, 0.5) * s.force(on) / s.speed(on)),
            "time": rounded(0.3 * s.wall),
        }


class VibratingPivot(Force):
    """Gravity modulated by a shaking support: -lever a sin(2 pi f t) sin q."""

    name = "vibrating_pivot"
    since = 0
    systems = ("pendulum",)

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        shaking = -k["lever"] * k["acceleration"] * np.sin(2 * np.pi * k["frequency"] * wall)
        return np.asarray(shaking * np.sin(q))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        p = s.world.parameters
        return {
            "lever": rounded(p["mass"] * p["length"]),
            "acceleration": rounded(d.size(0.1, 0.6) * p["gravity"]),
            "frequency": d.any(0.5, 3.0),
        }


KINDS = (Fan, Gusts, FadingDamping, VibratingPivot)
