"""Second masses that nobody measures and that push the body back: z is their position and velocity."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import HiddenForce
from gpsim.trials.worlds import Dial, Scales, rounded


class FlexibleCoupling(HiddenForce):
    """A second inertia behind a spring and a damper."""

    name = "flexible_coupling"
    since = 0

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """At rest against the first."""
        return np.stack([q, v], axis=1)

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What the spring and the damper transmit."""
        return np.asarray(self.k["stiffness"] * (z[:, 0] - q) + self.k["damping"] * (z[:, 1] - v))

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the second inertia."""
        return np.stack([z[:, 1], -self.force(q, v, z) / self.k["inertia"]], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        inertia, turn = d.size(0.2, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.5, 4.0)
        return {
            "inertia": rounded(inertia),
            "stiffness": rounded(inertia * turn**2),
            "damping": rounded(2 * d.any(0.02, 0.15) * inertia * turn),
        }


class LooseLoad(HiddenForce):
    """A load with play that knocks from one buffer to the other, `gap` to either side.

    Impact pair: Masri and Caughey (1966); the buffers are Hunt and Crossley's (1975) with n = 1, so they never pull.
    """

    name = "loose_load"
    since = 2029

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """In the middle, moving along."""
        return np.stack([q, v], axis=1)

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What the buffer that is touched transmits."""
        k = self.k
        off = z[:, 0] - q
        side = np.sign(off)
        depth = np.maximum(np.abs(off) - k["gap"], 0.0)
        return np.asarray(
            k["stiffness"] * side * depth * np.maximum(1.0 + k["loss"] * side * (z[:, 1] - v), 0.0)
        )

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the loose mass."""
        return np.stack([z[:, 1], -self.force(q, v, z) / self.k["inertia"]], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Buffers that throw the load back within a few samples, and take part of its energy."""
        inertia, turn = d.size(0.15, 0.8) * s.inertia(on), 2 * np.pi * d.any(2.5, 5.0)
        return {
            "inertia": rounded(inertia),
            "gap": rounded(d.any(0.05, 0.25) * s.reach(on)),
            "stiffness": rounded(inertia * turn**2),
            "loss": rounded(d.any(0.2, 0.8) / s.speed(on)),
        }


class SlippingFlywheel(HiddenForce):
    """A flywheel behind a dry clutch that slips: it transmits F tanh((r - v) / v0), r its rate.

    What changes gently takes it along, what changes fast slips: the inertia seems to depend on the acceleration.
    """

    name = "slipping_flywheel"
    since = 2030

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Turning along."""
        return np.stack([q, v], axis=1)

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What the clutch transmits."""
        return np.asarray(self.k["grip"] * np.tanh((z[:, 1] - v) / self.k["speed"]))

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the flywheel."""
        return np.stack([z[:, 1], -self.force(q, v, z) / self.k["inertia"]], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """As heavy as the body or less, behind a clutch that slips whenever the body is accelerated as a rule."""
        inertia = d.any(0.4, 1.0) * s.inertia(on)
        return {
            "grip": rounded(d.size(0.05, 0.4) * s.force(on)),
            "inertia": rounded(inertia),
            "speed": rounded(d.any(0.05, 0.15) * s.speed(on)),
        }


class TowedSledge(HiddenForce):
    """A sledge on a rope with slack: it rubs on the floor, -F tanh(r / v0), and is towed to whichever side.

    r is its velocity; the rope's pull is K (distance - slack) if > 0.
    """

    name = "towed_sledge"
    since = 2031

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """In the middle of the slack, moving along."""
        return np.stack([q, v], axis=1)

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The rope's pull."""
        far = z[:, 0] - q
        return np.asarray(self.k["stiffness"] * np.sign(far) * np.maximum(np.abs(far) - self.k["slack"], 0.0))

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the sledge."""
        rubbing = self.k["friction"] * np.tanh(z[:, 1] / self.k["speed"])
        return np.stack([z[:, 1], -(self.force(q, v, z) + rubbing) / self.k["inertia"]], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Lighter than the body, on a rope that jerks it along within a few samples."""
        inertia, turn = d.any(0.1, 0.3) * s.inertia(on), 2 * np.pi * d.any(2.5, 5.0)
        return {
            "friction": rounded(d.size(0.1, 0.6) * s.force(on)),
            "slack": rounded(d.any(0.2, 0.5) * s.reach(on)),
            "inertia": rounded(inertia),
            "stiffness": rounded(inertia * turn**2),
            "speed": rounded(d.any(0.05, 0.15) * s.speed(on)),
        }


class EnergySink(HiddenForce):
    """A small mass behind a spring that is cubic alone, and a damper: it has no frequency and takes what comes.

    Vakakis (2001), Inducing passive nonlinear energy sinks in vibrating systems.
    """

    name = "energy_sink"
    since = 2040

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Moving along."""
        return np.stack([q, v], axis=1)

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What the spring and the damper transmit."""
        return np.asarray(self.k["cubic"] * (z[:, 0] - q) ** 3 + self.k["damping"] * (z[:, 1] - v))

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the small mass."""
        return np.stack([z[:, 1], -self.force(q, v, z) / self.k["inertia"]], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """As stiff as a spring of a few hertz where it is stretched by as much as the body moves."""
        inertia, turn = d.size(0.15, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.0, 2.5)
        return {
            "inertia": rounded(inertia),
            "cubic": rounded(inertia * (turn / s.reach(on)) ** 2),
            "damping": rounded(0.2 * inertia * turn),
        }


KINDS = (FlexibleCoupling, LooseLoad, SlippingFlywheel, TowedSledge, EnergySink)
