"""Actuators that give a function of what is commanded now."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import MECHANICAL, Actuator
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, rounded, waves


class PositionGain(Actuator):
    """A gain that varies with position: u (1 + a sin(k q + phase)) with q the state's first column."""

    name = "position_gain"
    since = None
    systems = MECHANICAL

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        k = self.k
        return np.asarray(u * (1.0 + k["depth"] * np.sin(k["wave_number"] * s[:, 0] + k["phase"])))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"depth": d.size(0.12, 0.6), **waves(s, SYSTEMS[s.world.system].names[0], d, 1, 3)}


class QuantisedActuator(Actuator):
    """Commands rounded to coarse levels, the multiples of a step."""

    name = "quantised_actuator"
    since = None
    needs_levels = True

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        return np.asarray(self.k["step"] * np.round(u / self.k["step"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"step": rounded(d.size(0.25, 0.9) * s.action(on))}


class WormGear(Actuator):
    """A gear whose friction grows with what it transmits: u - mu |u| tanh(v / v0), v the driven coordinate's."""

    name = "worm_gear"
    since = 2028
    systems = MECHANICAL
    needs_levels = True

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What the gear lets through."""
        k = self.k
        return np.asarray(u - k["friction"] * np.abs(u) * np.tanh(s[:, 1] / k["speed"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        driven = SYSTEMS[s.world.system].coordinates[0]
        return {"friction": d.size(0.08, 0.45), "speed": rounded(0.1 * s.speed(driven))}


class PowerLimit(Actuator):
    """A supply that gives only so much power: |u v| <= P while it drives, v the driven coordinate's.

    It brakes in full.
    """

    name = "power_limit"
    since = 2029
    systems = MECHANICAL

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What the supply can feed."""
        most = self.k["power"]
        return np.asarray(u * (most / np.maximum(u * s[:, 1], most)))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """A limit that the stronger part of what drives the body exceeds."""
        names = SYSTEMS[s.world.system].names
        power = s.pilot.commands[..., 0].ravel() * s.column(names[1])
        return {"power": rounded((1.0 - d.size(0.3, 0.9)) * float(np.quantile(power[power > 0], 0.9)))}


class ExpoCurve(Actuator):
    """A stick's curve that is soft in the middle and right at full command U: u (1 - e + e (u / U)^2)."""

    name = "expo_curve"
    since = 2030
    needs_levels = True

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        soft = self.k["softness"]
        return np.asarray(u * (1.0 - soft + soft * (u / self.k["full"]) ** 2))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"softness": d.size(0.15, 0.7), "full": rounded(s.action(on))}


class PulsedThrusters(Actuator):
    """Thrusters that are open or shut: +-U for the share |u| / U of every period, then nothing.

    Sidi (1997), Spacecraft Dynamics and Control, chapter 9. The mean over the step.
    """

    name = "pulsed_thrusters"
    since = 2031
    systems = MECHANICAL
    needs_levels = True

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """As long as they are open in the step; more than U they cannot give."""
        full = self.k["full"]
        share = np.minimum(np.abs(u) / full, 1.0)
        opened = self._opened(t + h, share) - self._opened(t, share)
        return np.asarray(np.sign(u) * full * opened / h)

    def _opened(self, t: FloatArray, share: FloatArray) -> FloatArray:
        """(B,) s that they were open until t."""
        period = self.k["period"]
        periods = np.floor(t / period)
        return np.asarray(period * (periods * share + np.minimum(t / period - periods, share)))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "period": rounded(d.size(0.6, 4.0) * s.world.dt),
            "full": rounded(d.any(1.1, 1.5) * s.action(on)),
        }


class SupplyRipple(Actuator):
    """A supply that is not smoothed: u (1 + a sin(2 pi f t + phase))."""

    name = "supply_ripple"
    since = 2040

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        k = self.k
        return np.asarray(u * (1.0 + k["depth"] * np.sin(2 * np.pi * k["frequency"] * t + k["phase"])))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Slower than the sampling by far: what is faster is only its mean."""
        fastest = 0.5 if SYSTEMS[s.world.system].vehicle else 1.5
        return {
            "depth": d.size(0.15, 0.7),
            "frequency": d.any(0.3 * fastest, fastest),
            "phase": d.any(0, 2 * np.pi),
        }


KINDS = (PositionGain, QuantisedActuator, WormGear, PowerLimit, ExpoCurve, PulsedThrusters, SupplyRipple)
