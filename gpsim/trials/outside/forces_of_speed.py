"""Forces that depend on how fast the body is: friction and drag of sorts that the catalogue does not hold."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import Force
from gpsim.trials.worlds import Dial, Scales, rounded


class ExponentialAero(Force):
    """-a (exp(|v| / v0) - 1) sgn v."""

    name = "exponential_aero"
    since = None

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        grown = np.expm1(np.minimum(np.abs(v) / k["speed"], 30.0))
        return np.asarray(-k["amplitude"] * np.sign(v) * grown)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        speed = 0.35 * s.speed(on)
        return {
            "amplitude": rounded(d.size(0.1, 0.5) * s.force(on) / np.expm1(1.5 / 0.35)),
            "speed": rounded(speed),
        }


class SpeedRipple(Force):
    """A force periodic in speed: -A sin(v / v0)."""

    name = "speed_ripple"
    since = 0

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["amplitude"] * np.sin(v / self.k["speed"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "amplitude": rounded(d.size(0.1, 0.5) * s.force(on)),
            "speed": rounded(d.any(0.15, 0.3) * s.speed(on)),
        }


class EddyBrake(Force):
    """A magnetic brake that lets go when the body is fast: -2 A x / (1 + x^2), x = v / v0, A the most, at v0.

    Smythe (1942), On eddy currents in a rotating disk.
    """

    name = "eddy_brake"
    since = 2028

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        x = v / self.k["speed"]
        return np.asarray(-2.0 * self.k["amplitude"] * x / (1.0 + x * x))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)),
            "speed": rounded(d.any(0.3, 0.7) * s.speed(on)),
        }


class ShearThinning(Force):
    """A damper whose oil gets thinner the faster it is sheared: -b v (1 + (v / v0)^2)^((n - 1) / 2).

    Thick when slow; faster than v0 about |v|^n, n < 1. Carreau (1972), Rheological equations from molecular network
    theories.
    """

    name = "shear_thinning"
    since = 2029

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        thinned = (1.0 + (v / k["speed"]) ** 2) ** ((k["exponent"] - 1.0) / 2.0)
        return np.asarray(-k["damping"] * thinned * v)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Thin already at a part of the typical speed; the strength is its resistance at that speed."""
        slow, exponent = d.any(0.05, 0.2), d.any(0.2, 0.5)
        thinned = (1.0 + slow**-2) ** ((exponent - 1.0) / 2.0)
        return {
            "damping": rounded(d.size(0.1, 0.6) * s.force(on) / (s.speed(on) * thinned)),
            "speed": rounded(slow * s.speed(on)),
            "exponent": exponent,
        }


class OneWayDamper(Force):
    """A damper with a check valve: -c v towards its side (1 or -1), nothing on the way back."""

    name = "one_way_damper"
    since = 2030

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["damping"] * k["side"] * np.maximum(k["side"] * v, 0.0))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"damping": rounded(d.size(0.08, 0.7) * s.force(on) / s.speed(on)), "side": d.sign()}


class DraggedCable(Force):
    """A cable on the floor, more of it dragged the farther out: -w |q - anchor| tanh(v / v0)."""

    name = "dragged_cable"
    since = 2030

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["drag"] * np.abs(q - k["anchor"]) * np.tanh(v / k["speed"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Anchored within the range, so that it goes slack on the way."""
        return {
            "drag": rounded(d.size(0.08, 0.5) * s.force(on) / s.reach(on)),
            "anchor": rounded(float(np.mean(s.column(on))) + d.any(-0.8, 0.8) * s.reach(on)),
            "speed": rounded(d.any(0.05, 0.15) * s.speed(on)),
        }


class RunningBelt(Force):
    """Dry friction against a belt that runs, or of a pendulum on a shaft that turns: -F tanh((v - belt) / v0).

    Froude's pendulum: Rayleigh (1894), The Theory of Sound, vol. 1.
    """

    name = "running_belt"
    since = 2031

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["force"] * np.tanh((v - k["belt"]) / k["speed"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """It runs no faster than the body does as a rule, so that this moves to either side of it."""
        return {
            "force": rounded(d.size(0.08, 0.5) * s.force(on)),
            "belt": rounded(d.sign() * d.any(0.3, 0.8) * s.speed(on)),
            "speed": rounded(d.any(0.05, 0.15) * s.speed(on)),
        }


class DragCrisis(Force):
    """A bluff body whose wake narrows when it is fast: -c |v| v (1 - loss / (1 + e^(-(|v| - critical) / width))).

    Achenbach (1972), Experiments on the flow past spheres at very high Reynolds numbers.
    """

    name = "drag_crisis"
    since = 2040

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        speed = np.abs(v)
        narrow = 0.5 * (
            1.0 + np.tanh(0.5 * (speed - k["critical"]) / k["width"])
        )  # the same, and no overflow
        return np.asarray(-k["drag"] * speed * v * (1.0 - k["loss"] * narrow))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        critical = d.any(0.8, 1.4) * s.speed(on)
        return {
            "drag": rounded(d.size(0.15, 1.0) * s.force(on) / s.speed(on) ** 2),
            "loss": d.any(0.7, 0.85),
            "critical": rounded(critical),
            "width": rounded(0.08 * critical),
        }


KINDS = (
    ExponentialAero,
    SpeedRipple,
    EddyBrake,
    ShearThinning,
    OneWayDamper,
    DraggedCable,
    RunningBelt,
    DragCrisis,
)
