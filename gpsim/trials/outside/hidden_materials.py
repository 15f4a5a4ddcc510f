"""Forces of materials that remember how they were moved."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import HiddenForce
from gpsim.trials.worlds import Dial, Scales, rounded


class BoucWen(HiddenForce):
    """Hysteresis: force -A z, z' = (v - (|v| z + v |z|) / 2) / width; loading stiff, unloading stiffer.

    Wen (1976), Method for random vibration of hysteretic systems, with n = 1.
    """

    name = "bouc_wen"
    since = None

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Relaxed."""
        return np.zeros((len(q), 2))

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        return np.asarray(-self.k["amplitude"] * z[:, 0])

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        out = np.zeros_like(z)
        out[:, 0] = (v - 0.5 * (np.abs(v) * z[:, 0] + v * np.abs(z[:, 0]))) / self.k["width"]
        return out

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "amplitude": rounded(d.size(0.15, 0.7) * s.force(on)),
            "width": rounded(d.any(0.2, 0.5) * s.reach(on)),
        }


class RubberBuffer(HiddenForce):
    """A spring and a damper in a row, which forgets where it began: force -z, z' = k v - z / T (Maxwell's element)."""

    name = "rubber_buffer"
    since = 2028

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Relaxed."""
        return np.zeros((len(q), 2))

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The spring's pull."""
        return np.asarray(-z[:, 0])

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Stretched by the motion, relaxed by the damper."""
        out = np.zeros_like(z)
        out[:, 0] = self.k["stiffness"] * v - z[:, 0] / self.k["time"]
        return out

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """It forgets within about the time in which the body crosses its range."""
        return {
            "stiffness": rounded(d.size(0.15, 1.0) * s.force(on) / s.reach(on)),
            "time": rounded(d.any(0.4, 1.2) * s.reach(on) / s.speed(on)),
        }


class ThixotropicGrease(HiddenForce):
    """Grease that gels at rest: force -b z v, z' = (1 - z) / T - |v| z / L, z in (0, 1]; motion breaks the gel down.

    Moore (1959), The rheology of ceramic slips and bodies; Mewis and Wagner (2009), Thixotropy, section 4.
    """

    name = "thixotropic_grease"
    since = 2029

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Gelled."""
        return np.stack([np.ones_like(q), np.zeros_like(q)], axis=1)

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Viscous, as stiff as the gel is."""
        return np.asarray(-self.k["damping"] * z[:, 0] * v)

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """It builds up with time and breaks down with the way."""
        out = np.zeros_like(z)
        out[:, 0] = (1.0 - z[:, 0]) / self.k["time"] - np.abs(v) * z[:, 0] / self.k["way"]
        return out

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """It gels in about the time in which the body crosses its range, and breaks down in a part of that range."""
        return {
            "damping": rounded(d.size(0.2, 1.6) * s.force(on) / s.speed(on)),
            "time": rounded(d.any(0.5, 1.5) * s.reach(on) / s.speed(on)),
            "way": rounded(d.any(0.2, 0.6) * s.reach(on)),
        }


class FadingBrake(HiddenForce):
    """A pad that grips less when it is hot: -F / (1 + z) tanh(v / v0), T z' = fade |v| / V - z; cold at the start.

    Brake fade (Limpert, Brake Design and Safety, chapter 4), the heat in proportion to the speed.
    """

    name = "fading_brake"
    since = 2040

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Cold."""
        return np.zeros((len(q), 2))

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """As much as the pad grips."""
        return np.asarray(-self.k["force"] / (1.0 + z[:, 0]) * np.tanh(v / self.k["speed"]))

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Warmed by rubbing, cooled by the air."""
        out = np.zeros_like(z)
        out[:, 0] = (self.k["fade"] * np.abs(v) / self.k["typical"] - z[:, 0]) / self.k["time"]
        return out

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Hot after a part of an episode; then it grips with a third of its force."""
        return {
            "force": rounded(d.size(0.15, 0.9) * s.force(on)),
            "speed": rounded(0.1 * s.speed(on)),
            "fade": d.any(1.5, 3.0),
            "typical": rounded(s.speed(on)),
            "time": rounded(d.any(0.1, 0.3) * s.world.steps * s.world.dt),
        }


KINDS = (BoucWen, RubberBuffer, ThixotropicGrease, FadingBrake)
