"""Forces on both axes of a cart-pole at once."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import CoupledForce
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, rounded


class Gyroscopic(CoupledForce):
    """Each axis pushed in proportion to the other's speed; the two pushes do no work together."""

    name = "gyroscopic"
    since = 0

    def forces(self, s: FloatArray) -> FloatArray:
        k = self.k
        return np.stack([k["coupling"] * s[:, 3], -k["coupling"] * s[:, 1]], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"coupling": rounded(d.size(0.1, 0.5) * s.force("theta") / s.speed("x"))}


class TipSail(CoupledForce):
    """Drag on a ball at the pole's tip, -c |V| V with V the tip's own velocity, which the cart makes, too."""

    name = "tip_sail"
    since = 2029

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
        return {
            "drag": rounded(d.size(0.1, 0.7) * s.force("theta") / (length * pull)),
            "length": rounded(length),
        }


class TipTether(CoupledForce):
    """A rubber band from the pole's tip to the middle of the track, which pulls when longer than its rest.

    From the potential K max(d - rest, 0)^2 / 2 with the tip at (x + L sin theta, L cos theta) and d its distance.
    """

    name = "tip_tether"
    since = 2030

    def forces(self, s: FloatArray) -> FloatArray:
        k = self.k
        sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
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
        return {**unit, "stiffness": rounded(d.size(0.1, 0.7) * s.force("theta") / torque)}


class RubbingAxle(CoupledForce):
    """A disc on the pole's axle that rubs on the track, -F tanh(V / v0), V = x' - r theta' where they touch.

    It pushes the cart, and turns the pole by its lever r; none where the disc rolls.
    """

    name = "rubbing_axle"
    since = 2031

    def forces(self, s: FloatArray) -> FloatArray:
        k = self.k
        rubbing = k["force"] * np.tanh((s[:, 1] - k["radius"] * s[:, 3]) / k["speed"])
        return np.stack([-rubbing, k["radius"] * rubbing], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """A radius that gives the pole about as large a share of what moves it as the cart."""
        force = s.force("x")
        return {
            "force": rounded(d.size(0.08, 0.5) * force),
            "radius": rounded(d.any(0.5, 1.2) * s.force("theta") / force),
            "speed": rounded(d.any(0.05, 0.15) * s.speed("x")),
        }


class MagneticRack(CoupledForce):
    """A magnetic rack on the track and a pinion on the pole's axle: they slip past each other without touching.

    From the potential -K cos(theta - x / r). Halbach arrays as gears: Atallah, Wang and Howe (2005), A high-performance
    linear magnetic gear.
    """

    name = "magnetic_rack"
    since = 2040

    def forces(self, s: FloatArray) -> FloatArray:
        k = self.k
        torque = k["stiffness"] * np.sin(s[:, 2] - s[:, 0] / k["radius"])
        return np.stack([torque / k["radius"], -torque], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """A radius that gives the cart about as large a share of what moves it as the pole."""
        torque = s.force("theta")
        return {
            "stiffness": rounded(d.size(0.1, 0.6) * torque),
            "radius": rounded(d.any(0.6, 1.5) * torque / s.force("x")),
        }


KINDS = (Gyroscopic, TipSail, TipTether, RubbingAxle, MagneticRack)
