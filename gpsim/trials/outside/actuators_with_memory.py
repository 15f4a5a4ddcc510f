"""Actuators whose output depends on what was commanded before."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import MECHANICAL, Actuator
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, Values, rounded


class RingingActuator(Actuator):
    """A second-order actuator that overshoots: a'' = w^2 (u - a) - 2 zeta w a', stepped exactly for a held command.

    Ogata, Modern Control Engineering, section 5-3.
    """

    name = "ringing_actuator"
    since = 0

    def __init__(self, k: Values) -> None:
        super().__init__(k)
        self._w, self._zeta = k["frequency"] * 2 * np.pi, k["damping_ratio"]
        self._a: FloatArray | float = 0.0
        self._rate: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The damped oscillation about the command; the mean of a step's two ends."""
        decay, turn = self._zeta * self._w, self._w * np.sqrt(1.0 - self._zeta**2)
        gap, rate = self._a - u, self._rate
        cos, sin, shrink = np.cos(turn * h), np.sin(turn * h), np.exp(-decay * h)
        before = self._a
        self._a = u + shrink * (gap * cos + (rate + decay * gap) / turn * sin)
        self._rate = shrink * (rate * cos - (decay * rate + self._w**2 * gap) / turn * sin)
        return np.asarray((before + self._a) / 2)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "frequency": rounded(1.0 / (d.size(6.0, 20.0) * s.world.dt)),
            "damping_ratio": d.any(0.1, 0.3),
        }


class LostCommands(Actuator):
    """Outages of a radio link: what acts is the last command that arrived. Which are lost follows from the moment."""

    name = "lost_commands"
    since = 2028
    unseen_under = ("sweep",)  # which holds its commands for longer than an outage

    def __init__(self, k: Values) -> None:
        super().__init__(k)
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command; in a lost period, of which each is a few samples long, the last one before it."""
        k = self.k
        number = np.floor((t + h / 2) / k["outage"])
        # The usual one-line hash: digits behind the point of a large multiple of a sine.
        chance = np.abs(np.sin(12.9898 * number + k["phase"])) * 43758.5453 % 1.0
        self._level = np.where(chance < k["share"], self._level, u)
        return np.asarray(self._level)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Outages of two to five samples."""
        outage = rounded(round(d.any(1.5, 5.49)) * s.world.dt)
        return {"share": d.size(0.06, 0.35), "outage": outage, "phase": d.any(0, 6.28)}


class HotMotor(Actuator):
    """A gain 1 - loss T that falls as the motor warms up: time T' = (u / U)^2 - T; cold at an episode's start."""

    name = "hot_motor"
    since = 2028

    def __init__(self, k: Values) -> None:
        super().__init__(k)
        self._heat: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What is left of the command."""
        k = self.k
        out = u * np.maximum(1.0 - k["loss"] * self._heat, 0.0)
        goal = (u / k["rated"]) ** 2
        self._heat = goal + (self._heat - goal) * np.exp(-h / k["time"])
        return np.asarray(out)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Warm after a part of an episode."""
        return {
            "loss": d.size(0.12, 0.6),
            "rated": rounded(s.action(on)),
            "time": rounded(d.any(0.15, 0.5) * s.world.steps * s.world.dt),
        }


class StickyValve(Actuator):
    """It stays where it is until the command is more than a band away, then it goes there in one jump.

    Stenman, Gustafsson and Forsman (2003), A segmentation-based method for detection of stiction in control valves.
    """

    name = "sticky_valve"
    since = 2029
    needs_levels = True

    def __init__(self, k: Values) -> None:
        super().__init__(k)
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """Where the valve is."""
        self._level = np.where(np.abs(u - self._level) > self.k["band"], u, self._level)
        return np.asarray(self._level)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"band": rounded(d.size(0.12, 0.7) * s.action(on))}


class PneumaticValve(Actuator):
    """A chamber that fills in one time and vents in another: T a' = u - a, T by whether |a| grows or falls.

    Exact for a command held while a keeps its side; the mean over the step.
    """

    name = "pneumatic_valve"
    since = 2030

    def __init__(self, k: Values) -> None:
        super().__init__(k)
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The mean of the exponential approach."""
        behind = self._level - u
        x = h / np.where(behind * self._level > 0.0, self.k["vent"], self.k["fill"])
        self._level = u + behind * np.exp(-x)
        return np.asarray(u - behind * np.expm1(-x) / x)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        vent = d.size(1.0, 8.0) * s.world.dt
        return {"fill": rounded(d.any(0.1, 0.3) * vent), "vent": rounded(vent)}


class OverloadFoldback(Actuator):
    """A drive that gives a share of its command once its heat reaches 1, until that is back at `reset`.

    Heat: T h' = (a / rated)^2 - h with a what it gives; cold at an episode's start.
    """

    name = "overload_foldback"
    since = 2031

    def __init__(self, k: Values) -> None:
        super().__init__(k)
        self._heat: FloatArray | float = 0.0
        self._folded: FloatArray | bool = False

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command or a share of it."""
        k = self.k
        out = np.where(self._folded, k["share"], 1.0) * u
        goal = (out / k["rated"]) ** 2
        self._heat = goal + (self._heat - goal) * np.exp(-h / k["time"])
        self._folded = np.where(self._folded, self._heat > k["reset"], self._heat >= 1.0)
        return np.asarray(out)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """The typical command heats it up to where it folds back, and that share of it lets it cool, over and over."""
        share = 1.0 - d.size(0.12, 0.6)
        column = list(SYSTEMS[s.world.system].action).index(on)
        typical = float(np.sqrt(np.mean(s.pilot.commands[..., column] ** 2)))
        hot, cool = (
            1.0 - 0.25 * (1.0 - share**2),
            1.0 - 0.75 * (1.0 - share**2),
        )  # between the two means of heat
        return {
            "share": rounded(share),
            "rated": rounded(typical * np.sqrt(hot)),
            "reset": rounded(cool / hot),
            "time": rounded(d.any(0.05, 0.12) * s.world.steps * s.world.dt),
        }


class ReversingContactor(Actuator):
    """A contactor that opens to reverse: for a pause after the command changed its sign nothing acts."""

    name = "reversing_contactor"
    since = 2040
    systems = MECHANICAL

    def __init__(self, k: Values) -> None:
        super().__init__(k)
        self._side: FloatArray | float = 0.0
        self._open: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command, for as long as it is closed in the step; the mean over it."""
        side = np.where(u == 0.0, self._side, np.sign(u))
        turned = side * self._side < 0.0
        left = np.where(turned, self.k["pause"], self._open)
        self._side, self._open = side, np.maximum(left - h, 0.0)
        return np.asarray(u * (1.0 - np.minimum(left, h) / h))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"pause": rounded(d.size(0.8, 6.0) * s.world.dt)}


KINDS = (
    RingingActuator,
    LostCommands,
    HotMotor,
    StickyValve,
    PneumaticValve,
    OverloadFoldback,
    ReversingContactor,
)
