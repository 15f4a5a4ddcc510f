"""Forces that are functions of where the body is, of how fast it is, or of the clock on the wall."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import Draw, Force, middle
from gpsim.trials.worlds import Dial, Scales, rounded, waves


class Cogging(Force):
    """A torque ripple: -A sin(k q + phase)."""

    family = "cogging_force"
    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.6) * s.force(on),
        **waves(s, on, d, 4, 8),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["amplitude"] * np.sin(self.k["wave_number"] * q + self.k["phase"]))


class HardeningSpring(Force):
    """A force cubic in position: -c q^3."""

    family = "cubic_spring"
    strength: ClassVar[Draw] = lambda s, on, d: {"cubic": d.size(0.1, 0.6) * s.force(on) / s.reach(on) ** 3}

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["cubic"] * q**3)


class MagneticDetent(Force):
    """A magnet that pulls to one place and reaches not far: -A x exp((1 - x^2) / 2), A the most, at x = 1."""

    since = 0
    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.3, 1.2) * s.force(on),
        "centre": middle(s, on, d, 0.5),
        "reach": d.any(0.2, 0.4) * s.reach(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        x = (q - self.k["centre"]) / self.k["reach"]
        return np.asarray(-self.k["amplitude"] * x * np.exp(0.5 * (1.0 - x * x)))


class SoftStop(Force):
    """A one-sided contact: -K x^1.5 (1 + loss v) for x = q - edge > 0, and it never pulls.

    Hunt and Crossley (1975), Coefficient of restitution interpreted as damping in vibroimpact.
    """

    since = 0
    strength: ClassVar[Draw] = lambda s, on, d: {
        "edge": float(np.quantile(s.column(on), 0.75)),
        "stiffness": d.size(0.4, 4.0) * s.force(on) / s.reach(on) ** 1.5,
        "loss": 0.6 / s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k, depth = self.k, np.maximum(q - self.k["edge"], 0.0)
        return np.asarray(-k["stiffness"] * depth**1.5 * np.maximum(1.0 + k["loss"] * v, 0.0))


class ToggleSpring(Force):
    """A spring across the way that snaps to either side: -K x (1 - L / sqrt(x^2 + b^2)), b off the way, longer than b.

    x is the distance from its middle. von Mises (1923), Über die Stabilitätsprobleme der Elastizitätstheorie.
    """

    since = 2031

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k, x = self.k, q - self.k["centre"]
        return np.asarray(-k["stiffness"] * x * (1.0 - k["rest"] / np.hypot(x, k["aside"])))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """It snaps within the range; its typical force in proportion to what moves the body."""
        aside, q = d.any(0.2, 0.5) * s.reach(on), s.column(on)
        unit = {"stiffness": 1.0, "centre": rounded(middle(s, on, d, 0.5)), "aside": rounded(aside)}
        unit["rest"] = rounded(d.any(1.5, 3.0) * aside)
        typical = float(np.sqrt(np.mean(ToggleSpring(unit).force(q, q, q) ** 2)))
        return {**unit, "stiffness": d.size(0.1, 0.6) * s.force(on) / typical}


class MagneticBumper(Force):
    """A magnet at the end of the way that pushes a like pole on the body back: -A / (1 + (edge - q) / reach)^4.

    Two dipoles on one axis: the fourth power of their distance (Griffiths, Introduction to Electrodynamics, section
    6.1). No more than A beyond the edge.
    """

    since = 2040
    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.5, 3.0) * s.force(on),
        "edge": float(np.quantile(s.column(on), 0.9)),
        "reach": d.any(0.8, 1.8) * s.reach(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["amplitude"] / (1.0 + np.maximum(k["edge"] - q, 0.0) / k["reach"]) ** 4)


class ExponentialAero(Force):
    """-a (exp(|v| / v0) - 1) sgn v."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.5) * s.force(on) / np.expm1(1.5 / 0.35),
        "speed": 0.35 * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        grown = np.expm1(np.minimum(np.abs(v) / self.k["speed"], 30.0))
        return np.asarray(-self.k["amplitude"] * np.sign(v) * grown)


class SpeedRipple(Force):
    """A force periodic in speed: -A sin(v / v0)."""

    since = 0
    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.5) * s.force(on),
        "speed": d.any(0.15, 0.3) * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["amplitude"] * np.sin(v / self.k["speed"]))


class EddyBrake(Force):
    """A magnetic brake that lets go when the body is fast: -2 A x / (1 + x^2), x = v / v0, A the most, at v0.

    Smythe (1942), On eddy currents in a rotating disk.
    """

    since = 2028
    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.6) * s.force(on),
        "speed": d.any(0.3, 0.7) * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        x = v / self.k["speed"]
        return np.asarray(-2.0 * self.k["amplitude"] * x / (1.0 + x * x))


class ShearThinning(Force):
    """A damper whose oil gets thinner the faster it is sheared: -b v (1 + (v / v0)^2)^((n - 1) / 2).

    Thick when slow; faster than v0 about |v|^n, n < 1. Carreau (1972), Rheological equations from molecular network
    theories.
    """

    since = 2029

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        thinned = (1.0 + (v / self.k["speed"]) ** 2) ** ((self.k["exponent"] - 1.0) / 2.0)
        return np.asarray(-self.k["damping"] * thinned * v)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Thin already at a part of the typical speed; the strength is its resistance at that speed."""
        slow, exponent, speed = d.any(0.05, 0.2), d.any(0.2, 0.5), s.speed(on)
        thinned = (1.0 + slow**-2) ** ((exponent - 1.0) / 2.0)
        damping = d.size(0.1, 0.6) * s.force(on) / (speed * thinned)
        return {"damping": damping, "speed": slow * speed, "exponent": exponent}


class OneWayDamper(Force):
    """A damper with a check valve: -c v towards its side (1 or -1), nothing on the way back."""

    since = 2030
    strength: ClassVar[Draw] = lambda s, on, d: {
        "damping": d.size(0.08, 0.7) * s.force(on) / s.speed(on),
        "side": d.sign(),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["damping"] * k["side"] * np.maximum(k["side"] * v, 0.0))


class DraggedCable(Force):
    """A cable on the floor, more of it dragged the farther out: -w |q - anchor| tanh(v / v0).

    Anchored within the range, so that it goes slack on the way.
    """

    since = 2030
    strength: ClassVar[Draw] = lambda s, on, d: {
        "drag": d.size(0.08, 0.5) * s.force(on) / s.reach(on),
        "anchor": middle(s, on, d, 0.8),
        "speed": d.any(0.05, 0.15) * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["drag"] * np.abs(q - self.k["anchor"]) * np.tanh(v / self.k["speed"]))


class RunningBelt(Force):
    """Dry friction against a belt that runs, or of a pendulum on a shaft that turns: -F tanh((v - belt) / v0).

    It runs no faster than the body does as a rule, so that this moves to either side of it. Froude's pendulum: Rayleigh
    (1894), The Theory of Sound, vol. 1.
    """

    since = 2031
    strength: ClassVar[Draw] = lambda s, on, d: {
        "force": d.size(0.08, 0.5) * s.force(on),
        "belt": d.sign() * d.any(0.3, 0.8) * s.speed(on),
        "speed": d.any(0.05, 0.15) * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["force"] * np.tanh((v - self.k["belt"]) / self.k["speed"]))


class DragCrisis(Force):
    """A bluff body whose wake narrows when it is fast: -c |v| v (1 - loss / (1 + e^(-(|v| - critical) / width))).

    Achenbach (1972), Experiments on the flow past spheres at very high Reynolds numbers.
    """

    since = 2040

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k, speed = self.k, np.abs(v)
        # The same as with an exponential, and no overflow.
        narrow = 0.5 * (1.0 + np.tanh(0.5 * (speed - k["critical"]) / k["width"]))
        return np.asarray(-k["drag"] * speed * v * (1.0 - k["loss"] * narrow))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        critical, drag = d.any(0.8, 1.4) * s.speed(on), d.size(0.15, 1.0) * s.force(on) / s.speed(on) ** 2
        return {"drag": drag, "loss": d.any(0.7, 0.85), "critical": critical, "width": 0.08 * critical}


class Fan(Force):
    """A force periodic in time: A sin(2 pi f t + phase)."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.6) * s.force(on),
        "frequency": d.any(0.4, 2.5),
        "phase": d.any(0, 6.28),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(k["amplitude"] * np.sin(2 * np.pi * k["frequency"] * wall + k["phase"]))


class Gusts(Force):
    """A random force that wanders over seconds: twelve incommensurate waves between 0.1 and 3 Hz.

    Their frequencies and phases follow from k['phase'].
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.5) * s.force(on),
        "phase": d.any(0, 6.28),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k, number = self.k, np.arange(12)
        frequency = 0.1 * 30.0 ** ((number + 0.37 * np.sin(7.0 * number + k["phase"])) / 11.5)
        phase = 1000.0 * np.sin((number + 1) * (k["phase"] + 0.1))
        now = np.sin(2 * np.pi * wall[:, None] * frequency + phase)
        return np.asarray(k["amplitude"] * np.sqrt(2.0 / 12) * now.sum(axis=1))


class FadingDamping(Force):
    """Viscous friction that fades as the bearing warms up: -b v (0.1 + 2 e^(-t / T))."""

    since = 0
    strength: ClassVar[Draw] = lambda s, on, d: {
        "damping": d.size(0.08, 0.5) * s.force(on) / s.speed(on),
        "time": 0.3 * s.wall,
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["damping"] * v * (0.1 + 2.0 * np.exp(-wall / self.k["time"])))


class VibratingPivot(Force):
    """Gravity modulated by a shaking support: -lever a sin(2 pi f t) sin q."""

    since = 0
    systems = ("pendulum",)
    strength: ClassVar[Draw] = lambda s, on, d: {
        "lever": s.world.parameters["mass"] * s.world.parameters["length"],
        "acceleration": d.size(0.1, 0.6) * s.world.parameters["gravity"],
        "frequency": d.any(0.5, 3.0),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        shaking = -k["lever"] * k["acceleration"] * np.sin(2 * np.pi * k["frequency"] * wall)
        return np.asarray(shaking * np.sin(q))
