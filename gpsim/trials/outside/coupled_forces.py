"""Forces on both axes of a cart-pole at once, and inertias that vary: with position, with speed, with time."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import CoupledForce, Draw, HiddenForce, Inertia, seconds
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, rounded, waves


class Gyroscopic(CoupledForce):
    """Each axis pushed in proportion to the other's speed; the two pushes do no work together."""

    since = 0
    strength: ClassVar[Draw] = lambda s, on, d: {
        "coupling": d.size(0.1, 0.5) * s.force("theta") / s.speed("x")
    }

    def forces(self, s: FloatArray) -> FloatArray:
        return np.stack([self.k["coupling"] * s[:, 3], -self.k["coupling"] * s[:, 1]], axis=1)


class TipSail(CoupledForce):
    """Drag on a ball at the pole's tip, -c |V| V with V the tip's own velocity, which the cart makes, too."""

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
        return {"drag": d.size(0.1, 0.7) * s.force("theta") / (length * pull), "length": length}


class TipTether(CoupledForce):
    """A rubber band from the pole's tip to the middle of the track, which pulls when longer than its rest.

    From the potential K max(d - rest, 0)^2 / 2 with the tip at (x + L sin theta, L cos theta) and d its distance.
    """

    since = 2030

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


class RubbingAxle(CoupledForce):
    """A disc on the pole's axle that rubs on the track, -F tanh(V / v0), V = x' - r theta' where they touch.

    It pushes the cart, and turns the pole by its lever r; none where the disc rolls. The radius gives the pole about as
    large a share of what moves it as the cart.
    """

    since = 2031
    strength: ClassVar[Draw] = lambda s, on, d: {
        "force": d.size(0.08, 0.5) * s.force("x"),
        "radius": d.any(0.5, 1.2) * s.force("theta") / s.force("x"),
        "speed": d.any(0.05, 0.15) * s.speed("x"),
    }

    def forces(self, s: FloatArray) -> FloatArray:
        radius = self.k["radius"]
        rubbing = self.k["force"] * np.tanh((s[:, 1] - radius * s[:, 3]) / self.k["speed"])
        return np.stack([-rubbing, radius * rubbing], axis=1)


class MagneticRack(CoupledForce):
    """A magnetic rack on the track and a pinion on the pole's axle: they slip past each other without touching.

    From the potential -K cos(theta - x / r). The radius gives the cart about as large a share of what moves it as the
    pole. Halbach arrays as gears: Atallah, Wang and Howe (2005), A high-performance linear magnetic gear.
    """

    since = 2040
    strength: ClassVar[Draw] = lambda s, on, d: {
        "stiffness": d.size(0.1, 0.6) * s.force("theta"),
        "radius": d.any(0.6, 1.5) * s.force("theta") / s.force("x"),
    }

    def forces(self, s: FloatArray) -> FloatArray:
        torque = self.k["stiffness"] * np.sin(s[:, 2] - s[:, 0] / self.k["radius"])
        return np.stack([torque / self.k["radius"], -torque], axis=1)


class UnevenInertia(Inertia):
    """An unbalanced drive, whose inertia varies with position: A cos(k q + phase)."""

    since = 2028
    strength: ClassVar[Draw] = lambda s, on, d: {
        "amplitude": d.size(0.1, 0.5) * s.inertia(on),
        **waves(s, on, d, 1, 3),
    }

    def inertia(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = self.k
        angle = k["wave_number"] * q + k["phase"]
        return k["amplitude"] * np.cos(angle), -k["amplitude"] * k["wave_number"] * np.sin(angle)


class CentrifugalGovernor(HiddenForce):
    """Two flyweights on springs that turn with the body: z is their radius r, 1 at rest, and its rate.

    Inertia J (r^2 - 1) more than at rest, force -2 J r r' v, r'' = r v^2 - w^2 (r - 1) - 2 zeta w r': Lagrange's
    equations of J (r'^2 + r^2 v^2) / 2 - J w^2 (r - 1)^2 / 2. The weights outrun their springs only when the body is
    much faster than it is as a rule. Maxwell (1868), On governors.
    """

    since = 2029
    systems = ("cartpole", "pendulum")
    on = ("theta",)
    first = 1.0
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


class LeakingTank(HiddenForce):
    """A load that runs out, J e^(-t / T) from every episode's start; what leaves has the body's speed: no thrust.

    z is the share that is left; most of it is gone when the episode ends. Sommerfeld (1952), Mechanics, section 4: with
    v of what leaves the body's own, m dv/dt = F.
    """

    since = 2030
    first = 1.0
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


class HeapedChain(HiddenForce):
    """A chain drawn from a heap at `edge`, link by link with a jerk, and laid down again: inertia d (q - edge) if > 0.

    Drawn out, d/dt((m + d x) v) = F; laid down, the links take their momentum along: (m + d x) v' = F. z is the
    place q. Some of it is drawn out most of the time. Cayley (1857), On a class of dynamical problems.
    """

    since = 2031
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
