"""Forces that depend on where the body is."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import Force
from gpsim.trials.worlds import Dial, Scales, rounded, waves


class Cogging(Force):
    """A torque ripple: -A sin(k q + phase)."""

    name = "cogging"
    family = "cogging_force"
    since = None

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["amplitude"] * np.sin(k["wave_number"] * q + k["phase"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"amplitude": rounded(d.size(0.1, 0.6) * s.force(on)), **waves(s, on, d, 4, 8)}


class HardeningSpring(Force):
    """A force cubic in position: -c q^3."""

    name = "hardening_spring"
    family = "cubic_spring"
    since = None

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["cubic"] * q**3)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"cubic": rounded(d.size(0.1, 0.6) * s.force(on) / s.reach(on) ** 3)}


class MagneticDetent(Force):
    """A magnet that pulls to one place and reaches not far: -A x exp((1 - x^2) / 2), A the most, at x = 1."""

    name = "magnetic_detent"
    since = 0

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        x = (q - k["centre"]) / k["reach"]
        return np.asarray(-k["amplitude"] * x * np.exp(0.5 * (1.0 - x * x)))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "amplitude": rounded(d.size(0.3, 1.2) * s.force(on)),
            "centre": rounded(float(np.mean(s.column(on))) + d.any(-0.5, 0.5) * s.reach(on)),
            "reach": rounded(d.any(0.2, 0.4) * s.reach(on)),
        }


class SoftStop(Force):
    """A one-sided contact: -K x^1.5 (1 + loss v) for x = q - edge > 0, and it never pulls.

    Hunt and Crossley (1975), Coefficient of restitution interpreted as damping in vibroimpact.
    """

    name = "soft_stop"
    since = 0

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        depth = np.maximum(q - k["edge"], 0.0)
        return np.asarray(-k["stiffness"] * depth**1.5 * np.maximum(1.0 + k["loss"] * v, 0.0))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "edge": rounded(float(np.quantile(s.column(on), 0.75))),
            "stiffness": rounded(d.size(0.4, 4.0) * s.force(on) / s.reach(on) ** 1.5),
            "loss": rounded(0.6 / s.speed(on)),
        }


class ToggleSpring(Force):
    """A spring across the way that snaps to either side: -K x (1 - L / sqrt(x^2 + b^2)), b off the way, longer than b.

    x is the distance from its middle. von Mises (1923), Über die Stabilitätsprobleme der Elastizitätstheorie.
    """

    name = "toggle_spring"
    since = 2031

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        x = q - k["centre"]
        return np.asarray(-k["stiffness"] * x * (1.0 - k["rest"] / np.hypot(x, k["aside"])))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """It snaps within the range; its typical force in proportion to what moves the body."""
        aside = d.any(0.2, 0.5) * s.reach(on)
        unit = {
            "stiffness": 1.0,
            "centre": rounded(float(np.mean(s.column(on))) + d.any(-0.5, 0.5) * s.reach(on)),
            "aside": rounded(aside),
            "rest": rounded(d.any(1.5, 3.0) * aside),
        }
        q = s.column(on)
        typical = float(np.sqrt(np.mean(ToggleSpring(unit).force(q, q, q) ** 2)))
        return {**unit, "stiffness": rounded(d.size(0.1, 0.6) * s.force(on) / typical)}


class MagneticBumper(Force):
    """A magnet at the end of the way that pushes a like pole on the body back: -A / (1 + (edge - q) / reach)^4.

    Two dipoles on one axis: the fourth power of their distance (Griffiths, Introduction to Electrodynamics, section
    6.1). No more than A beyond the edge.
    """

    name = "magnetic_bumper"
    since = 2040

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["amplitude"] / (1.0 + np.maximum(k["edge"] - q, 0.0) / k["reach"]) ** 4)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "amplitude": rounded(d.size(0.5, 3.0) * s.force(on)),
            "edge": rounded(float(np.quantile(s.column(on), 0.9))),
            "reach": rounded(d.any(0.8, 1.8) * s.reach(on)),
        }


KINDS = (Cogging, HardeningSpring, MagneticDetent, SoftStop, ToggleSpring, MagneticBumper)
