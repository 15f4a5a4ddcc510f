"""Forces with a hidden state: materials that remember how they were moved, and masses that nobody measures."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import Draw, HiddenForce, seconds
from gpsim.trials.worlds import Dial, Scales


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


class RubberBuffer(_Material):
    """A spring and a damper in a row, which forgets where it began: force -z, z' = k v - z / T (Maxwell's element).

    It forgets within about the time in which the body crosses its range.
    """

    since = 2028
    strength: ClassVar[Draw] = lambda s, on, d: {
        "stiffness": d.size(0.15, 1.0) * s.force(on) / s.reach(on),
        "time": d.any(0.4, 1.2) * s.reach(on) / s.speed(on),
    }

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(-z[:, 0])

    def rate(self, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["stiffness"] * v - z / self.k["time"])


class ThixotropicGrease(_Material):
    """Grease that gels at rest: force -b z v, z' = (1 - z) / T - |v| z / L, z in (0, 1]; motion breaks the gel down.

    It gels in about the time in which the body crosses its range, and breaks down in a part of that range. Moore
    (1959), The rheology of ceramic slips and bodies; Mewis and Wagner (2009), Thixotropy, section 4.
    """

    since = 2029
    first = 1.0
    strength: ClassVar[Draw] = lambda s, on, d: {
        "damping": d.size(0.2, 1.6) * s.force(on) / s.speed(on),
        "time": d.any(0.5, 1.5) * s.reach(on) / s.speed(on),
        "way": d.any(0.2, 0.6) * s.reach(on),
    }

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(-self.k["damping"] * z[:, 0] * v)

    def rate(self, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray((1.0 - z) / self.k["time"] - np.abs(v) * z / self.k["way"])


class FadingBrake(_Material):
    """A pad that grips less when it is hot: -F / (1 + z) tanh(v / v0), T z' = fade |v| / V - z; cold at the start.

    Hot after a part of an episode; then it grips with a third of its force. Brake fade (Limpert, Brake Design and
    Safety, chapter 4), the heat in proportion to the speed.
    """

    since = 2040
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


class FlexibleAppendage(_Mass):
    """A second inertia that hangs on the body by a spring and a damper; a drive has it on its other side."""

    since = 0

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["stiffness"] * (z[:, 0] - q) + self.k["damping"] * (z[:, 1] - v))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        inertia, turn = d.size(0.2, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.5, 4.0)
        damping = 2 * d.any(0.02, 0.15) * inertia * turn
        return {"inertia": inertia, "stiffness": inertia * turn**2, "damping": damping}


class LooseLoad(_Mass):
    """A load with play that knocks from one buffer to the other, `gap` to either side.

    Impact pair: Masri and Caughey (1966); the buffers are Hunt and Crossley's (1975) with n = 1, so they never pull.
    """

    since = 2029

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


class SlippingFlywheel(_Mass):
    """A flywheel behind a dry clutch that slips: it transmits F tanh((r - v) / v0), r its rate.

    What changes gently takes it along, what changes fast slips: the inertia seems to depend on the acceleration. It is
    as heavy as the body or less, and slips whenever the body is accelerated as a rule.
    """

    since = 2030

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["grip"] * np.tanh((z[:, 1] - v) / self.k["speed"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        inertia, grip = d.any(0.4, 1.0) * s.inertia(on), d.size(0.05, 0.4) * s.force(on)
        return {"grip": grip, "inertia": inertia, "speed": d.any(0.05, 0.15) * s.speed(on)}


class TowedSledge(_Mass):
    """A sledge on a rope with slack: it rubs on the floor, -F tanh(r / v0), and is towed to whichever side.

    r is its velocity; the rope's pull is K (distance - slack) if > 0.
    """

    since = 2031

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


class EnergySink(_Mass):
    """A small mass behind a spring that is cubic alone, and a damper: it has no frequency and takes what comes.

    As stiff as a spring of a few hertz where it is stretched by as much as the body moves. Vakakis (2001), Inducing
    passive nonlinear energy sinks in vibrating systems.
    """

    since = 2040

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(self.k["cubic"] * (z[:, 0] - q) ** 3 + self.k["damping"] * (z[:, 1] - v))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        inertia, turn = d.size(0.15, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.0, 2.5)
        cubic = inertia * (turn / s.reach(on)) ** 2
        return {"inertia": inertia, "cubic": cubic, "damping": 0.2 * inertia * turn}
