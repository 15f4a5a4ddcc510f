"""Inertias that differ from the base's and vary: with position, with speed, with time."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import HiddenForce, Inertia
from gpsim.trials.worlds import Dial, Scales, rounded, waves


class UnevenInertia(Inertia):
    """An unbalanced drive, whose inertia varies with position: A cos(k q + phase)."""

    name = "uneven_inertia"
    since = 2028

    def inertia(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = self.k
        angle = k["wave_number"] * q + k["phase"]
        return k["amplitude"] * np.cos(angle), -k["amplitude"] * k["wave_number"] * np.sin(angle)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"amplitude": rounded(d.size(0.1, 0.5) * s.inertia(on)), **waves(s, on, d, 1, 3)}


class CentrifugalGovernor(HiddenForce):
    """Two flyweights on springs that turn with the body: z is their radius r, 1 at rest, and its rate.

    Inertia J (r^2 - 1) more than at rest, force -2 J r r' v, r'' = r v^2 - w^2 (r - 1) - 2 zeta w r': Lagrange's
    equations of J (r'^2 + r^2 v^2) / 2 - J w^2 (r - 1)^2 / 2. Maxwell (1868), On governors.
    """

    name = "centrifugal_governor"
    since = 2029
    systems = ("cartpole", "pendulum")
    on = ("theta",)

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Drawn in."""
        return np.stack([np.ones_like(q), np.zeros_like(q)], axis=1)

    def inertia(self, z: FloatArray) -> FloatArray:
        """More the farther they are out."""
        return np.asarray(self.k["inertia"] * (z[:, 0] ** 2 - 1.0))

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What it takes to speed weights up that move outwards."""
        return np.asarray(-2.0 * self.k["inertia"] * z[:, 0] * z[:, 1] * v)

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The weights: flung outwards, drawn back, damped."""
        turn = self.k["turn"]
        back = turn**2 * (z[:, 0] - 1.0) + 2.0 * self.k["damping_ratio"] * turn * z[:, 1]
        return np.stack([z[:, 1], z[:, 0] * v**2 - back], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Springs that the weights outrun only when the body is much faster than it is as a rule."""
        return {
            "inertia": rounded(d.size(0.08, 0.6) * s.inertia(on)),
            "turn": rounded(d.any(1.5, 3.0) * s.speed(on)),
            "damping_ratio": d.any(0.2, 0.6),
        }


class LeakingTank(HiddenForce):
    """A load that runs out, J e^(-t / T) from every episode's start; what leaves has the body's speed: no thrust.

    z is the share that is left. Sommerfeld (1952), Mechanics, section 4: with v of what leaves the body's own,
    m dv/dt = F.
    """

    name = "leaking_tank"
    since = 2030

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Full."""
        return np.stack([np.ones_like(q), np.zeros_like(q)], axis=1)

    def inertia(self, z: FloatArray) -> FloatArray:
        """What is left in it."""
        return np.asarray(self.k["inertia"] * z[:, 0])

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """None."""
        return np.zeros_like(v)

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The less is in it, the less runs out."""
        return np.stack([-z[:, 0] / self.k["time"], np.zeros_like(v)], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Most of it is gone when the episode ends."""
        return {
            "inertia": rounded(d.size(0.08, 0.6) * s.inertia(on)),
            "time": rounded(d.any(0.2, 0.5) * s.world.steps * s.world.dt),
        }


class HeapedChain(HiddenForce):
    """A chain drawn from a heap at `edge`, link by link with a jerk, and laid down again: inertia d (q - edge) if > 0.

    Drawn out, d/dt((m + d x) v) = F; laid down, the links take their momentum along: (m + d x) v' = F. z is the
    place q. Cayley (1857), On a class of dynamical problems.
    """

    name = "heaped_chain"
    since = 2031

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Where the body is."""
        return np.stack([q, np.zeros_like(q)], axis=1)

    def inertia(self, z: FloatArray) -> FloatArray:
        """What is drawn out."""
        return np.asarray(self.k["density"] * np.maximum(z[:, 0] - self.k["edge"], 0.0))

    def force(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What it takes to set the next links in motion."""
        k = self.k
        return np.asarray(-k["density"] * (z[:, 0] > k["edge"]) * np.maximum(v, 0.0) ** 2)

    def drift(self, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """It follows the body."""
        return np.stack([v, np.zeros_like(v)], axis=1)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Some of it is drawn out most of the time."""
        return {
            "density": rounded(d.size(0.1, 0.8) * s.inertia(on) / s.reach(on)),
            "edge": rounded(float(np.quantile(s.column(on), d.any(0.1, 0.4)))),
        }


KINDS = (UnevenInertia, CentrifugalGovernor, LeakingTank, HeapedChain)
