"""Actuators: functions of what is commanded now, then those whose output depends on what was commanded before."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import MECHANICAL, Actuator, Draw, seconds
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, Values, waves


class PositionGain(Actuator):
    """A gain that varies with position: u (1 + a sin(k q + phase)) with q the state's first column."""

    systems = MECHANICAL
    strength: ClassVar[Draw] = lambda s, on, d: {
        "depth": d.size(0.12, 0.6),
        **waves(s, SYSTEMS[s.world.system].names[0], d, 1, 3),
    }

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        k = self.k
        return np.asarray(u * (1.0 + k["depth"] * np.sin(k["wave_number"] * s[:, 0] + k["phase"])))


class QuantisedActuator(Actuator):
    """Commands rounded to coarse levels, the multiples of a step."""

    needs_levels = True
    strength: ClassVar[Draw] = lambda s, on, d: {"step": d.size(0.25, 0.9) * s.action(on)}

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        return np.asarray(self.k["step"] * np.round(u / self.k["step"]))


class WormGear(Actuator):
    """A gear whose friction grows with what it transmits: u - mu |u| tanh(v / v0), v the driven coordinate's."""

    since = 2028
    systems = MECHANICAL
    needs_levels = True
    strength: ClassVar[Draw] = lambda s, on, d: {
        "friction": d.size(0.08, 0.45),
        "speed": 0.1 * s.speed(SYSTEMS[s.world.system].coordinates[0]),
    }

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        return np.asarray(u - self.k["friction"] * np.abs(u) * np.tanh(s[:, 1] / self.k["speed"]))


class PowerLimit(Actuator):
    """A supply that gives only so much power: |u v| <= P while it drives, v the driven coordinate's.

    It brakes in full.
    """

    since = 2029
    systems = MECHANICAL

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        most = self.k["power"]
        return np.asarray(u * (most / np.maximum(u * s[:, 1], most)))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """A limit that the stronger part of what drives the body exceeds."""
        power = s.pilot.commands[..., 0].ravel() * s.column(SYSTEMS[s.world.system].names[1])
        return {"power": (1.0 - d.size(0.3, 0.9)) * float(np.quantile(power[power > 0], 0.9))}


class ExpoCurve(Actuator):
    """A stick's curve that is soft in the middle and right at full command U: u (1 - e + e (u / U)^2)."""

    since = 2030
    needs_levels = True
    strength: ClassVar[Draw] = lambda s, on, d: {"softness": d.size(0.15, 0.7), "full": s.action(on)}

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        soft = self.k["softness"]
        return np.asarray(u * (1.0 - soft + soft * (u / self.k["full"]) ** 2))


class PulsedThrusters(Actuator):
    """Thrusters that are open or shut: +-U for the share |u| / U of every period, then nothing.

    Sidi (1997), Spacecraft Dynamics and Control, chapter 9. The mean over the step.
    """

    since = 2031
    systems = MECHANICAL
    needs_levels = True
    strength: ClassVar[Draw] = lambda s, on, d: {
        "period": d.size(0.6, 4.0) * s.world.dt,
        "full": d.any(1.1, 1.5) * s.action(on),
    }

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


class SupplyRipple(Actuator):
    """A supply that is not smoothed: u (1 + a sin(2 pi f t + phase))."""

    since = 2040

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        k = self.k
        return np.asarray(u * (1.0 + k["depth"] * np.sin(2 * np.pi * k["frequency"] * t + k["phase"])))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Slower than the sampling by far: what is faster is only its mean."""
        fastest = 0.5 if SYSTEMS[s.world.system].vehicle else 1.5
        frequency = d.any(0.3 * fastest, fastest)
        return {"depth": d.size(0.15, 0.7), "frequency": frequency, "phase": d.any(0, 2 * np.pi)}


class RingingActuator(Actuator):
    """A second-order actuator that overshoots: a'' = w^2 (u - a) - 2 zeta w a', stepped exactly for a held command.

    Ogata, Modern Control Engineering, section 5-3.
    """

    since = 0
    rate: FloatArray | float = 0.0
    strength: ClassVar[Draw] = lambda s, on, d: {
        "frequency": 1.0 / (d.size(6.0, 20.0) * s.world.dt),
        "damping_ratio": d.any(0.1, 0.3),
    }

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The damped oscillation about the command; the mean of a step's two ends."""
        w, zeta = self.k["frequency"] * 2 * np.pi, self.k["damping_ratio"]
        decay, turn = zeta * w, w * np.sqrt(1.0 - zeta**2)
        before, gap, rate = self.level, self.level - u, self.rate
        cos, sin, shrink = np.cos(turn * h), np.sin(turn * h), np.exp(-decay * h)
        self.level = u + shrink * (gap * cos + (rate + decay * gap) / turn * sin)
        self.rate = shrink * (rate * cos - (decay * rate + w**2 * gap) / turn * sin)
        return np.asarray((before + self.level) / 2)


class LostCommands(Actuator):
    """Outages of a radio link: what acts is the last command that arrived. Which are lost follows from the moment.

    Outages last two to five samples.
    """

    since = 2028
    unseen_under = ("sweep",)  # which holds its commands for longer than an outage
    strength: ClassVar[Draw] = lambda s, on, d: {
        "share": d.size(0.06, 0.35),
        "outage": round(d.any(1.5, 5.49)) * s.world.dt,
        "phase": d.any(0, 6.28),
    }

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command; in a lost period, of which each is a few samples long, the last one before it."""
        number = np.floor((t + h / 2) / self.k["outage"])
        # The usual one-line hash: digits behind the point of a large multiple of a sine.
        chance = np.abs(np.sin(12.9898 * number + self.k["phase"])) * 43758.5453 % 1.0
        self.level = np.where(chance < self.k["share"], self.level, u)
        return np.asarray(self.level)


class _Warming(Actuator):
    """What warms up: time T' = (what it gives / rated)^2 - T with T its `level`; cold at an episode's start."""

    def warm(self, given: FloatArray, h: float) -> None:
        """Go on by h s."""
        goal = (given / self.k["rated"]) ** 2
        self.level = goal + (self.level - goal) * np.exp(-h / self.k["time"])


class HotMotor(_Warming):
    """A gain 1 - loss T that falls as the motor warms up by its commands, within a part of an episode."""

    since = 2028
    strength: ClassVar[Draw] = lambda s, on, d: {
        "loss": d.size(0.12, 0.6),
        "rated": s.action(on),
        "time": seconds(s, d.any(0.15, 0.5)),
    }

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        out = u * np.maximum(1.0 - self.k["loss"] * self.level, 0.0)
        self.warm(u, h)
        return np.asarray(out)


class StickyValve(Actuator):
    """It stays where it is until the command is more than a band away, then it goes there in one jump.

    Stenman, Gustafsson and Forsman (2003), A segmentation-based method for detection of stiction in control valves.
    """

    since = 2029
    needs_levels = True
    strength: ClassVar[Draw] = lambda s, on, d: {"band": d.size(0.12, 0.7) * s.action(on)}

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        self.level = np.where(np.abs(u - self.level) > self.k["band"], u, self.level)
        return np.asarray(self.level)


class PneumaticValve(Actuator):
    """A chamber that fills in one time and vents in another: T a' = u - a, T by whether |a| grows or falls.

    Exact for a command held while a keeps its side; the mean over the step.
    """

    since = 2030

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        behind = self.level - u
        x = h / np.where(behind * self.level > 0.0, self.k["vent"], self.k["fill"])
        self.level = u + behind * np.exp(-x)
        return np.asarray(u - behind * np.expm1(-x) / x)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        vent = d.size(1.0, 8.0) * s.world.dt
        return {"fill": d.any(0.1, 0.3) * vent, "vent": vent}


class OverloadFoldback(_Warming):
    """A drive that gives a share of its command once its heat reaches 1, until that is back at `reset`."""

    since = 2031

    def __init__(self, k: Values) -> None:
        super().__init__(k)
        self._folded: FloatArray | bool = False

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        out = np.where(self._folded, self.k["share"], 1.0) * u
        self.warm(out, h)
        self._folded = np.where(self._folded, self.level > self.k["reset"], self.level >= 1.0)
        return np.asarray(out)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """The typical command heats it up to where it folds back, and that share of it lets it cool, over and over."""
        share, column = 1.0 - d.size(0.12, 0.6), list(SYSTEMS[s.world.system].action).index(on)
        typical = float(np.sqrt(np.mean(s.pilot.commands[..., column] ** 2)))
        hot, cool = (1.0 - part * (1.0 - share**2) for part in (0.25, 0.75))  # between the two means of heat
        own = {"share": share, "rated": typical * np.sqrt(hot), "reset": cool / hot}
        return {**own, "time": seconds(s, d.any(0.05, 0.12))}


class ReversingContactor(Actuator):
    """A contactor that opens to reverse: for a pause after the command changed its sign nothing acts.

    level: the side on which it is closed.
    """

    since = 2040
    systems = MECHANICAL
    left: FloatArray | float = 0.0
    strength: ClassVar[Draw] = lambda s, on, d: {"pause": d.size(0.8, 6.0) * s.world.dt}

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command, for as long as it is closed in the step; the mean over it."""
        side = np.where(u == 0.0, self.level, np.sign(u))
        left = np.where(side * self.level < 0.0, self.k["pause"], self.left)
        self.level, self.left = side, np.maximum(left - h, 0.0)
        return np.asarray(u * (1.0 - np.minimum(left, h) / h))
