"""Physics outside the catalogue that acts in a body: forces, some with a hidden state, and inertias.

Materials remember how they were moved, masses are measured by nobody, some forces act on both axes of a cart-pole at
once.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside_kind import CoupledForce, Draw, Force, HiddenForce, Inertia, middle, seconds
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, rounded, waves


class Cogging(Force, family="cogging_force"):
    """A torque ripple: -A sin(k q + phase)."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.6) * s.force(on),
        **waves(s, on, d, 4, 8),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["amplitude"] * np.sin(self.k["wave_number"] * q + self.k["phase"]))


class HardeningSpring(Force, family="cubic_spring"):
    """A force cubic in position: -c q^3."""

    strength: ClassVar[Draw] = lambda s, on, d: {"cubic": d.size(0.1, 0.6) * s.force(on) / s.reach(on) ** 3}

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["cubic"] * q**3)


class MagneticDetent(Force, since=0):
    """A magnet that pulls to one place and reaches not far: -A x exp((1 - x^2) / 2), A the most, at x = 1."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.3, 1.2) * s.force(on),
        "centre": middle(s, on, d, 0.5),
        "reach": d.any(0.2, 0.4) * s.reach(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        x = (q - self.k["centre"]) / self.k["reach"]
        return np.asarray(-self.k["amplitude"] * x * np.exp(0.5 * (1.0 - x * x)))


class SoftStop(Force, since=0):
    """A one-sided contact: -K x^1.5 (1 + loss v) for x = q - edge > 0, and it never pulls.

    Hunt and Crossley (1975), Coefficient of restitution interpreted as damping in vibroimpact.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "edge": float(np.quantile(s.column(on), 0.75)),
        "stiffness": d.size(0.4, 4.0) * s.force(on) / s.reach(on) ** 1.5,
        "loss": 0.6 / s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k, depth = self.k, np.maximum(q - self.k["edge"], 0.0)
        return np.asarray(-k["stiffness"] * depth**1.5 * np.maximum(1.0 + k["loss"] * v, 0.0))


class ToggleSpring(Force, since=2031):
    """A spring across the way that snaps to either side: -K x (1 - L / sqrt(x^2 + b^2)), b off the way, longer than b.

    x is the distance from its middle. von Mises (1923), Über die Stabilitätsprobleme der Elastizitätstheorie.
    """

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


class MagneticBumper(Force, since=2040):
    """A magnet at the end of the way that pushes a like pole on the body back: -A / (1 + (edge - q) / reach)^4.

    Two dipoles on one axis: the fourth power of their distance (Griffiths, Introduction to Electrodynamics, section
    6.1). No more than A beyond the edge.
    """

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


class SpeedRipple(Force, since=0):
    """A force periodic in speed: -A sin(v / v0)."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.5) * s.force(on),
        "speed": d.any(0.15, 0.3) * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["amplitude"] * np.sin(v / self.k["speed"]))


class EddyBrake(Force, since=2028):
    """A magnetic brake that lets go when the body is fast: -2 A x / (1 + x^2), x = v / v0, A the most, at v0.

    Smythe (1942), On eddy currents in a rotating disk.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.6) * s.force(on),
        "speed": d.any(0.3, 0.7) * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        x = v / self.k["speed"]
        return np.asarray(-2.0 * self.k["amplitude"] * x / (1.0 + x * x))


class ShearThinning(Force, since=2029):
    """A damper whose oil gets thinner the faster it is sheared: -b v (1 + (v / v0)^2)^((n - 1) / 2).

    Thick when slow; faster than v0 about |v|^n, n < 1. Carreau (1972), Rheological equations from molecular network
    theories.
    """

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


class OneWayDamper(Force, since=2030):
    """A damper with a check valve: -c v towards its side (1 or -1), nothing on the way back."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "damping": d.size(0.08, 0.7) * s.force(on) / s.speed(on),
        "side": d.sign(),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        return np.asarray(-k["damping"] * k["side"] * np.maximum(k["side"] * v, 0.0))


class DraggedCable(Force, since=2030):
    """A cable on the floor, more of it dragged the farther out: -w |q - anchor| tanh(v / v0).

    Anchored within the range, so that it goes slack on the way.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "drag": d.size(0.08, 0.5) * s.force(on) / s.reach(on),
        "anchor": middle(s, on, d, 0.8),
        "speed": d.any(0.05, 0.15) * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["drag"] * np.abs(q - self.k["anchor"]) * np.tanh(v / self.k["speed"]))


class RunningBelt(Force, since=2031):
    """Dry friction against a belt that runs, or of a pendulum on a shaft that turns: -F tanh((v - belt) / v0).

    It runs no faster than the body does as a rule, so that this moves to either side of it. Froude's pendulum: Rayleigh
    (1894), The Theory of Sound, vol. 1.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "force": d.size(0.08, 0.5) * s.force(on),
        "belt": d.sign() * d.any(0.3, 0.8) * s.speed(on),
        "speed": d.any(0.05, 0.15) * s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["force"] * np.tanh((v - self.k["belt"]) / self.k["speed"]))


class DragCrisis(Force, since=2040):
    """A bluff body whose wake narrows when it is fast: -c |v| v (1 - loss / (1 + e^(-(|v| - critical) / width))).

    Achenbach (1972), Experiments on the flow past spheres at very high Reynolds numbers.
    """

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


class FadingDamping(Force, since=0):
    """Viscous friction that fades as the bearing warms up: -b v (0.1 + 2 e^(-t / T))."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "damping": d.size(0.08, 0.5) * s.force(on) / s.speed(on),
        "time": 0.3 * s.wall,
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        return np.asarray(-self.k["damping"] * v * (0.1 + 2.0 * np.exp(-wall / self.k["time"])))


class VibratingPivot(Force, since=0, systems=("pendulum",)):
    """Gravity modulated by a shaking support: -lever a sin(2 pi f t) sin q."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "lever": s.world.parameters["mass"] * s.world.parameters["length"],
        "acceleration": d.size(0.1, 0.6) * s.world.parameters["gravity"],
        "frequency": d.any(0.5, 3.0),
    }

    def force(self, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
        k = self.k
        shaking = -k["lever"] * k["acceleration"] * np.sin(2 * np.pi * k["frequency"] * wall)
        return np.asarray(shaking * np.sin(q))


class _Material(HiddenForce):
    """What remembers one number, z."""

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.stack([self.rate(v, z[:, 0]), np.zeros_like(v)], axis=1)

    def rate(self, v: FloatArray, z: FloatArray) -> FloatArray:
        """(B,) of z (B,)."""
        raise NotImplementedError


class BoucWen(_Material):
    """Hysteresis: force -A z, z' = (v - (|v| z + v |z|) / 2) / width; loading stiff, unloading stiffer.

    Wen (1976), Method for random vibration of hysteretic systems, with n = 1.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.15, 0.7) * s.force(on),
        "width": d.any(0.2, 0.5) * s.reach(on),
    }

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(-self.k["amplitude"] * z[:, 0])

    def rate(self, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray((v - 0.5 * (np.abs(v) * z + v * np.abs(z))) / self.k["width"])


class RubberBuffer(_Material, since=2028):
    """A spring and a damper in a row, which forgets where it began: force -z, z' = k v - z / T (Maxwell's element).

    It forgets within about the time in which the body crosses its range.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "stiffness": d.size(0.15, 1.0) * s.force(on) / s.reach(on),
        "time": d.any(0.4, 1.2) * s.reach(on) / s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(-z[:, 0])

    def rate(self, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["stiffness"] * v - z / self.k["time"])


class ThixotropicGrease(_Material, since=2029, first=1.0):
    """Grease that gels at rest: force -b z v, z' = (1 - z) / T - |v| z / L, z in (0, 1]; motion breaks the gel down.

    It gels in about the time in which the body crosses its range, and breaks down in a part of that range. Moore
    (1959), The rheology of ceramic slips and bodies; Mewis and Wagner (2009), Thixotropy, section 4.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "damping": d.size(0.2, 1.6) * s.force(on) / s.speed(on),
        "time": d.any(0.5, 1.5) * s.reach(on) / s.speed(on),
        "way": d.any(0.2, 0.6) * s.reach(on),
    }

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(-self.k["damping"] * z[:, 0] * v)

    def rate(self, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray((1.0 - z) / self.k["time"] - np.abs(v) * z / self.k["way"])


class FadingBrake(_Material, since=2040):
    """A pad that grips less when it is hot: -F / (1 + z) tanh(v / v0), T z' = fade |v| / V - z; cold at the start.

    Hot after a part of an episode; then it grips with a third of its force. Brake fade (Limpert, Brake Design and
    Safety, chapter 4), the heat in proportion to the speed.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "force": d.size(0.15, 0.9) * s.force(on),
        "speed": 0.1 * s.speed(on),
        "fade": d.any(1.5, 3.0),
        "typical": s.speed(on),
        "time": seconds(s, d.any(0.1, 0.3)),
    }

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(-self.k["force"] / (1.0 + z[:, 0]) * np.tanh(v / self.k["speed"]))

    def rate(self, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray((self.k["fade"] * np.abs(v) / self.k["typical"] - z) / self.k["time"])


class _Mass(HiddenForce):
    """A second mass of k['inertia'], which pushes the body back; z is its place and velocity, the body's at first."""

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        return np.stack([q, v], axis=1)

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law."""
        return np.stack([z[:, 1], -(self.force(q, v, z) + self.own(z)) / self.k["inertia"]], axis=1)

    def own(self, z: FloatArray) -> FloatArray | float:
        """(B,) what resists the mass and does not act on the body."""
        return 0.0


class FlexibleAppendage(_Mass, since=0):
    """A second inertia that hangs on the body by a spring and a damper; a drive has it on its other side."""

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["stiffness"] * (z[:, 0] - q) + self.k["damping"] * (z[:, 1] - v))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        inertia, turn = d.size(0.2, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.5, 4.0)
        damping = 2 * d.any(0.02, 0.15) * inertia * turn
        return {"inertia": inertia, "stiffness": inertia * turn**2, "damping": damping}


class LooseLoad(_Mass, since=2029):
    """A load with play that knocks from one buffer to the other, `gap` to either side.

    Impact pair: Masri and Caughey (1966); the buffers are Hunt and Crossley's (1975) with n = 1, so they never pull.
    """

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        k, side = self.k, np.sign(z[:, 0] - q)
        depth = np.maximum(np.abs(z[:, 0] - q) - k["gap"], 0.0)
        resilience = np.maximum(1.0 + k["loss"] * side * (z[:, 1] - v), 0.0)
        return np.asarray(k["stiffness"] * side * depth * resilience)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Buffers that throw the load back within a few samples, and take part of its energy."""
        inertia, turn = d.size(0.15, 0.8) * s.inertia(on), 2 * np.pi * d.any(2.5, 5.0)
        gap, loss = d.any(0.05, 0.25) * s.reach(on), d.any(0.2, 0.8) / s.speed(on)
        return {"inertia": inertia, "gap": gap, "stiffness": inertia * turn**2, "loss": loss}


class SlippingFlywheel(_Mass, since=2030):
    """A flywheel behind a dry clutch that slips: it transmits F tanh((r - v) / v0), r its rate.

    What changes gently takes it along, what changes fast slips: the inertia seems to depend on the acceleration. It is
    as heavy as the body or less, and slips whenever the body is accelerated as a rule.
    """

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["grip"] * np.tanh((z[:, 1] - v) / self.k["speed"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        inertia, grip = d.any(0.4, 1.0) * s.inertia(on), d.size(0.05, 0.4) * s.force(on)
        return {"grip": grip, "inertia": inertia, "speed": d.any(0.05, 0.15) * s.speed(on)}


class TowedSledge(_Mass, since=2031):
    """A sledge on a rope with slack: it rubs on the floor, -F tanh(r / v0), and is towed to whichever side.

    r is its velocity; the rope's pull is K (distance - slack) if > 0.
    """

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        far = z[:, 0] - q
        return np.asarray(self.k["stiffness"] * np.sign(far) * np.maximum(np.abs(far) - self.k["slack"], 0.0))

    def own(self, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["friction"] * np.tanh(z[:, 1] / self.k["speed"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Lighter than the body, on a rope that jerks it along within a few samples."""
        inertia, turn = d.any(0.1, 0.3) * s.inertia(on), 2 * np.pi * d.any(2.5, 5.0)
        friction, slack = d.size(0.1, 0.6) * s.force(on), d.any(0.2, 0.5) * s.reach(on)
        own = {"friction": friction, "slack": slack, "inertia": inertia, "stiffness": inertia * turn**2}
        return {**own, "speed": d.any(0.05, 0.15) * s.speed(on)}


class EnergySink(_Mass, since=2040):
    """A small mass behind a spring that is cubic alone, and a damper: it has no frequency and takes what comes.

    As stiff as a spring of a few hertz where it is stretched by as much as the body moves. Vakakis (2001), Inducing
    passive nonlinear energy sinks in vibrating systems.
    """

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["cubic"] * (z[:, 0] - q) ** 3 + self.k["damping"] * (z[:, 1] - v))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        inertia, turn = d.size(0.15, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.0, 2.5)
        cubic = inertia * (turn / s.reach(on)) ** 2
        return {"inertia": inertia, "cubic": cubic, "damping": 0.2 * inertia * turn}


class Gyroscopic(CoupledForce, since=0):
    """Each axis pushed in proportion to the other's speed; the two pushes do no work together."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "coupling": d.size(0.1, 0.5) * s.force("theta") / s.speed("x")
    }

    def forces(self, s: FloatArray) -> FloatArray:
        return np.stack([self.k["coupling"] * s[:, 3], -self.k["coupling"] * s[:, 1]], axis=1)


class TipSail(CoupledForce, since=2029):
    """Drag on a ball at the pole's tip, -c |V| V with V the tip's own velocity, which the cart makes, too."""

    def forces(self, s: FloatArray) -> FloatArray:
        k = self.k
        x_rate, turn = s[:, 1], k["length"] * s[:, 3]
        ahead, up = x_rate + turn * np.cos(s[:, 2]), -turn * np.sin(s[:, 2])
        thrust = -k["drag"] * np.hypot(ahead, up)
        lever = k["length"] * (np.cos(s[:, 2]) * ahead - np.sin(s[:, 2]) * up)
        return np.stack([thrust * ahead, thrust * lever], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Its pull on the pole in proportion to what moves the pole."""
        length = 2 * s.world.parameters["pole_half_length"]
        turn, x_rate = length * s.column("theta_dot"), s.column("x_dot")
        square = x_rate**2 + turn**2 + 2 * x_rate * turn * np.cos(s.column("theta"))
        pull = float(np.sqrt(np.mean(square**2)))
        return {"drag": d.size(0.1, 0.7) * s.force("theta") / (length * pull), "length": length}


class TipTether(CoupledForce, since=2030):
    """A rubber band from the pole's tip to the middle of the track, which pulls when longer than its rest.

    From the potential K max(d - rest, 0)^2 / 2 with the tip at (x + L sin theta, L cos theta) and d its distance.
    """

    def forces(self, s: FloatArray) -> FloatArray:
        k, sin, cos = self.k, np.sin(s[:, 2]), np.cos(s[:, 2])
        ahead, up = s[:, 0] + k["length"] * sin, k["length"] * cos
        far = np.hypot(ahead, up)
        pull = k["stiffness"] * np.maximum(far - k["rest"], 0.0) / np.maximum(far, 1e-9)
        return np.stack([-pull * ahead, -pull * k["length"] * (cos * ahead - sin * up)], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Its pull on the pole in proportion to what moves the pole."""
        length = 2 * s.world.parameters["pole_half_length"]
        unit = {"stiffness": 1.0, "length": length, "rest": rounded(d.any(0.5, 0.9) * length)}
        states = np.stack([s.column(n) for n in SYSTEMS[s.world.system].names], axis=1)
        torque = float(np.sqrt(np.mean(TipTether(unit).forces(states)[:, 1] ** 2)))
        return {**unit, "stiffness": d.size(0.1, 0.7) * s.force("theta") / torque}


class RubbingAxle(CoupledForce, since=2031):
    """A disc on the pole's axle that rubs on the track, -F tanh(V / v0), V = x' - r theta' where they touch.

    It pushes the cart, and turns the pole by its lever r; none where the disc rolls. The radius gives the pole about as
    large a share of what moves it as the cart.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "force": d.size(0.08, 0.5) * s.force("x"),
        "radius": d.any(0.5, 1.2) * s.force("theta") / s.force("x"),
        "speed": d.any(0.05, 0.15) * s.speed("x"),
    }

    def forces(self, s: FloatArray) -> FloatArray:
        radius = self.k["radius"]
        rubbing = self.k["force"] * np.tanh((s[:, 1] - radius * s[:, 3]) / self.k["speed"])
        return np.stack([-rubbing, radius * rubbing], axis=1)


class MagneticRack(CoupledForce, since=2040):
    """A magnetic rack on the track and a pinion on the pole's axle: they slip past each other without touching.

    From the potential -K cos(theta - x / r). The radius gives the cart about as large a share of what moves it as the
    pole. Halbach arrays as gears: Atallah, Wang and Howe (2005), A high-performance linear magnetic gear.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "stiffness": d.size(0.1, 0.6) * s.force("theta"),
        "radius": d.any(0.6, 1.5) * s.force("theta") / s.force("x"),
    }

    def forces(self, s: FloatArray) -> FloatArray:
        torque = self.k["stiffness"] * np.sin(s[:, 2] - s[:, 0] / self.k["radius"])
        return np.stack([torque / self.k["radius"], -torque], axis=1)


class UnevenInertia(Inertia, since=2028):
    """An unbalanced drive, whose inertia varies with position: A cos(k q + phase)."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.5) * s.inertia(on),
        **waves(s, on, d, 1, 3),
    }

    def inertia(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = self.k
        angle = k["wave_number"] * q + k["phase"]
        return k["amplitude"] * np.cos(angle), -k["amplitude"] * k["wave_number"] * np.sin(angle)


class CentrifugalGovernor(
    HiddenForce, since=2029, systems=("cartpole", "pendulum"), on=("theta",), first=1.0
):
    """Two flyweights on springs that turn with the body: z is their radius r, 1 at rest, and its rate.

    Inertia J (r^2 - 1) more than at rest, force -2 J r r' v, r'' = r v^2 - w^2 (r - 1) - 2 zeta w r': Lagrange's
    equations of J (r'^2 + r^2 v^2) / 2 - J w^2 (r - 1)^2 / 2. The weights outrun their springs only when the body is
    much faster than it is as a rule. Maxwell (1868), On governors.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "inertia": d.size(0.08, 0.6) * s.inertia(on),
        "turn": d.any(1.5, 3.0) * s.speed(on),
        "damping_ratio": d.any(0.2, 0.6),
    }

    def inertia(self, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["inertia"] * (z[:, 0] ** 2 - 1.0))

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What it takes to speed weights up that move outwards."""
        return np.asarray(-2.0 * self.k["inertia"] * z[:, 0] * z[:, 1] * v)

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The weights: flung outwards, drawn back, damped."""
        turn = self.k["turn"]
        back = turn**2 * (z[:, 0] - 1.0) + 2.0 * self.k["damping_ratio"] * turn * z[:, 1]
        return np.stack([z[:, 1], z[:, 0] * v**2 - back], axis=1)


class LeakingTank(HiddenForce, since=2030, first=1.0):
    """A load that runs out, J e^(-t / T) from every episode's start; what leaves has the body's speed: no thrust.

    z is the share that is left; most of it is gone when the episode ends. Sommerfeld (1952), Mechanics, section 4: with
    v of what leaves the body's own, m dv/dt = F.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "inertia": d.size(0.08, 0.6) * s.inertia(on),
        "time": seconds(s, d.any(0.2, 0.5)),
    }

    def inertia(self, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["inertia"] * z[:, 0])

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.zeros_like(v)

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.stack([-z[:, 0] / self.k["time"], np.zeros_like(v)], axis=1)


class HeapedChain(HiddenForce, since=2031):
    """A chain drawn from a heap at `edge`, link by link with a jerk, and laid down again: inertia d (q - edge) if > 0.

    Drawn out, d/dt((m + d x) v) = F; laid down, the links take their momentum along: (m + d x) v' = F. z is the
    place q. Some of it is drawn out most of the time. Cayley (1857), On a class of dynamical problems.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "density": d.size(0.1, 0.8) * s.inertia(on) / s.reach(on),
        "edge": float(np.quantile(s.column(on), d.any(0.1, 0.4))),
    }

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        return np.stack([q, np.zeros_like(q)], axis=1)

    def inertia(self, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["density"] * np.maximum(z[:, 0] - self.k["edge"], 0.0))

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What it takes to set the next links in motion."""
        return np.asarray(-self.k["density"] * (z[:, 0] > self.k["edge"]) * np.maximum(v, 0.0) ** 2)

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.stack([v, np.zeros_like(v)], axis=1)
