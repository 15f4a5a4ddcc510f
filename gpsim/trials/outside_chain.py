"""Physics outside the catalogue before and after a body: actuators, sensors, and what becomes of a vehicle's twist."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside_kind import (
    MECHANICAL,
    VEHICLE,
    Actuator,
    Distortion,
    Draw,
    HiddenTwist,
    SensorWithMemory,
    Twist,
    seconds,
)
from gpsim.trials.worlds import SYSTEMS, Dial, Scales, System, Values, waves


class PositionGain(Actuator, systems=MECHANICAL):
    """A gain that varies with position: u (1 + a sin(k q + phase)) with q the state's first column."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "depth": d.size(0.12, 0.6),
        **waves(s, SYSTEMS[s.world.system].names[0], d, 1, 3),
    }

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        k = self.k
        return np.asarray(u * (1.0 + k["depth"] * np.sin(k["wave_number"] * s[:, 0] + k["phase"])))


class QuantisedActuator(Actuator, needs_levels=True):
    """Commands rounded to coarse levels, the multiples of a step."""

    strength: ClassVar[Draw] = lambda s, on, d: {"step": d.size(0.25, 0.9) * s.action(on)}

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        return np.asarray(self.k["step"] * np.round(u / self.k["step"]))


class WormGear(Actuator, since=2028, systems=MECHANICAL, needs_levels=True):
    """A gear whose friction grows with what it transmits: u - mu |u| tanh(v / v0), v the driven coordinate's."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "friction": d.size(0.08, 0.45),
        "speed": 0.1 * s.speed(SYSTEMS[s.world.system].coordinates[0]),
    }

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        return np.asarray(u - self.k["friction"] * np.abs(u) * np.tanh(s[:, 1] / self.k["speed"]))


class PowerLimit(Actuator, since=2029, systems=MECHANICAL):
    """A supply that gives only so much power: |u v| <= P while it drives, v the driven coordinate's.

    It brakes in full.
    """

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        most = self.k["power"]
        return np.asarray(u * (most / np.maximum(u * s[:, 1], most)))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """A limit that the stronger part of what drives the body exceeds."""
        power = s.pilot.commands[..., 0].ravel() * s.column(SYSTEMS[s.world.system].names[1])
        return {"power": (1.0 - d.size(0.3, 0.9)) * float(np.quantile(power[power > 0], 0.9))}


class ExpoCurve(Actuator, since=2030, needs_levels=True):
    """A stick's curve that is soft in the middle and right at full command U: u (1 - e + e (u / U)^2)."""

    strength: ClassVar[Draw] = lambda s, on, d: {"softness": d.size(0.15, 0.7), "full": s.action(on)}

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        soft = self.k["softness"]
        return np.asarray(u * (1.0 - soft + soft * (u / self.k["full"]) ** 2))


class PulsedThrusters(Actuator, since=2031, systems=MECHANICAL, needs_levels=True):
    """Thrusters that are open or shut: +-U for the share |u| / U of every period, then nothing.

    Sidi (1997), Spacecraft Dynamics and Control, chapter 9. The mean over the step.
    """

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


class SupplyRipple(Actuator, since=2040):
    """A supply that is not smoothed: u (1 + a sin(2 pi f t + phase))."""

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        k = self.k
        return np.asarray(u * (1.0 + k["depth"] * np.sin(2 * np.pi * k["frequency"] * t + k["phase"])))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Slower than the sampling by far: what is faster is only its mean."""
        fastest = 0.5 if SYSTEMS[s.world.system].vehicle else 1.5
        frequency = d.any(0.3 * fastest, fastest)
        return {"depth": d.size(0.15, 0.7), "frequency": frequency, "phase": d.any(0, 2 * np.pi)}


class RingingActuator(Actuator, since=0):
    """A second-order actuator that overshoots: a'' = w^2 (u - a) - 2 zeta w a', stepped exactly for a held command.

    Ogata, Modern Control Engineering, section 5-3.
    """

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


class LostCommands(Actuator, since=2028, unseen_under=("sweep",)):
    """Outages of a radio link: what acts is the last command that arrived. Which are lost follows from the moment.

    Outages last two to five samples.
    """

    # which holds its commands for longer than an outage
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


class HotMotor(_Warming, since=2028):
    """A gain 1 - loss T that falls as the motor warms up by its commands, within a part of an episode."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "loss": d.size(0.12, 0.6),
        "rated": s.action(on),
        "time": seconds(s, d.any(0.15, 0.5)),
    }

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        out = u * np.maximum(1.0 - self.k["loss"] * self.level, 0.0)
        self.warm(u, h)
        return np.asarray(out)


class StickyValve(Actuator, since=2029, needs_levels=True):
    """It stays where it is until the command is more than a band away, then it goes there in one jump.

    Stenman, Gustafsson and Forsman (2003), A segmentation-based method for detection of stiction in control valves.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {"band": d.size(0.12, 0.7) * s.action(on)}

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        self.level = np.where(np.abs(u - self.level) > self.k["band"], u, self.level)
        return np.asarray(self.level)


class PneumaticValve(Actuator, since=2030):
    """A chamber that fills in one time and vents in another: T a' = u - a, T by whether |a| grows or falls.

    Exact for a command held while a keeps its side; the mean over the step.
    """

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        behind = self.level - u
        x = h / np.where(behind * self.level > 0.0, self.k["vent"], self.k["fill"])
        self.level = u + behind * np.exp(-x)
        return np.asarray(u - behind * np.expm1(-x) / x)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        vent = d.size(1.0, 8.0) * s.world.dt
        return {"fill": d.any(0.1, 0.3) * vent, "vent": vent}


class OverloadFoldback(_Warming, since=2031):
    """A drive that gives a share of its command once its heat reaches 1, until that is back at `reset`."""

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


class ReversingContactor(Actuator, since=2040, systems=MECHANICAL):
    """A contactor that opens to reverse: for a pause after the command changed its sign nothing acts.

    level: the side on which it is closed.
    """

    left: FloatArray | float = 0.0
    strength: ClassVar[Draw] = lambda s, on, d: {"pause": d.size(0.8, 6.0) * s.world.dt}

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command, for as long as it is closed in the step; the mean over it."""
        side = np.where(u == 0.0, self.level, np.sign(u))
        left = np.where(side * self.level < 0.0, self.k["pause"], self.left)
        self.level, self.left = side, np.maximum(left - h, 0.0)
        return np.asarray(u * (1.0 - np.minimum(left, h) / h))


class EccentricEncoder(Distortion, since=0):
    """An encoder mounted off its axis: y + A sin(k y + phase)."""

    def read(self, y: FloatArray) -> FloatArray:
        return np.asarray(y + self.k["amplitude"] * np.sin(self.k["wave_number"] * y + self.k["phase"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        once = {"wave_number": 1.0, "phase": d.any(0, 6.28)} if on == "yaw" else waves(s, on, d, 2, 4)
        return {"amplitude": d.size(0.04, 0.2) * min(s.reach(on), 1.0), **once}


class FisheyeCamera(Distortion, since=2028, systems=VEHICLE, on=("pose",)):
    """Positions by a camera at height H above the origin whose orthographic fisheye was taken for a pinhole.

    It sees the radius H sin(atan(r / H)) = r / sqrt(1 + (r / H)^2).
    """

    def read(self, y: FloatArray) -> FloatArray:
        far = (y**2).sum(axis=1) / self.k["height"] ** 2
        return np.asarray(y / np.sqrt(1.0 + far)[:, None])

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        far = float(np.sqrt(np.mean(s.column("x") ** 2 + s.column("y") ** 2)))
        return {"height": far / np.sqrt(d.size(0.04, 0.4))}


class CoarseEncoder(Distortion, since=2030):
    """An encoder of few lines: multiples of its step."""

    strength: ClassVar[Draw] = lambda s, on, d: {"step": d.size(0.03, 0.3) * min(s.reach(on), 1.0)}

    def read(self, y: FloatArray) -> FloatArray:
        return np.asarray(self.k["step"] * np.floor(y / self.k["step"] + 0.5))


class StuckBit(Distortion, since=2040):
    """An encoder with a bit that is always 0: where it should be 1, the reading is too small by the bit's worth."""

    strength: ClassVar[Draw] = CoarseEncoder.strength

    def read(self, y: FloatArray) -> FloatArray:
        return np.asarray(y - self.k["step"] * (np.floor(y / self.k["step"]) % 2.0))


class SlowSensor(SensorWithMemory, since=2028):
    """A sensor that reads less often than recorded: what was at its last tick; ticks begin with the episode."""

    strength: ClassVar[Draw] = lambda s, on, d: {"period": d.size(1.3, 5.0) * s.world.dt}

    @classmethod
    def places(cls, system: System, velocities: str | None) -> list[str]:
        """None where velocities are differentiated: a reading that repeats is no speed of 0."""
        return [] if velocities == "differentiated" else super().places(system, velocities)

    def read(self, past: FloatArray, h: float) -> FloatArray:
        period, index = self.k["period"], len(past) - 1
        ticks = np.floor((index + 0.5) * h / period)
        return np.asarray(past[min(int(ticks * period / h + 0.5), index)])


class LooseMarker(SensorWithMemory, since=2029):
    """A marker on a springy stalk: p'' = w^2 (q - p) + 2 zeta w (q' - p'), what is read is p.

    Base excitation (Inman, Engineering Vibration, section 2.4): the sum of its responses to a past of small moves,
    each taken half a fine step after it began.
    """

    def read(self, past: FloatArray, h: float) -> FloatArray:
        turn, zeta = 2 * np.pi * self.k["frequency"], self.k["damping_ratio"]
        decay, ring = zeta * turn, turn * np.sqrt(1.0 - zeta**2)
        age = h * (np.arange(len(past) - 1)[::-1] + 0.5)
        behind = np.exp(-decay * age) * (np.cos(ring * age) - decay / ring * np.sin(ring * age))
        return np.asarray(past[-1] - (behind[:, None] * np.diff(past, axis=0)).sum(axis=0))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """The slower it sways the more; a vehicle, which is slower, carries a longer stalk."""
        period = d.size(0.1, 0.5) * (4.0 if SYSTEMS[s.world.system].vehicle else 1.0)
        return {"frequency": 1.0 / period, "damping_ratio": d.any(0.1, 0.3)}


class WarmingSensor(SensorWithMemory, since=2030):
    """A zero that moves as the sensor warms up: y + A (1 - e^(-t / T)), t s after the episode's start."""

    def read(self, past: FloatArray, h: float) -> FloatArray:
        return np.asarray(past[-1] - self.k["offset"] * np.expm1(-h * (len(past) - 1) / self.k["time"]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """Warm before the episode ends; a vehicle's heading goes round, so that its range says nothing."""
        size = d.size(0.05, 0.4) * (1.0 if SYSTEMS[s.world.system].vehicle else s.reach(on))
        return {"offset": d.sign() * size, "time": seconds(s, d.any(0.1, 0.4))}


class EncoderPlay(SensorWithMemory, since=2031):
    """An encoder behind a gear with play: it reads on only when an end of the gap, `gap` to either side, pushes it.

    What lies between the gap's lower end and the body, a path held between 0 and 2 gap: Kruk, Lehoczky, Ramanan and
    Shreve (2007), An explicit formula for the Skorokhod map on [0, a]. In the middle of the gap at the start.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {"gap": d.size(0.03, 0.25) * min(s.reach(on), 1.0)}

    def read(self, past: FloatArray, h: float) -> FloatArray:
        gap = self.k["gap"]
        free = past - past[0] + gap
        held = free + np.maximum(np.maximum.accumulate(-free), 0.0)
        least = np.minimum.accumulate(held[::-1])[::-1]  # from every moment until now
        over = np.minimum(np.maximum(held - 2.0 * gap, 0.0), least).max(axis=0)
        return np.asarray(past[-1] - (held[-1] - over - gap))


def _where_it_drives(s: Scales) -> dict[str, float]:
    """Middle and radius of a place where the vehicle is most of the time."""
    x, y = (float(np.median(s.column(name))) for name in ("x", "y"))
    return {"x": x, "y": y, "radius": 0.6 * min(s.reach("x"), s.reach("y"))}


class _Place(Twist):
    """Of a round place: by how far the vehicle is from its middle."""

    def off(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(B,) how far it is off in x and y, and the square of its distance in radii."""
        x, y = s[:, 0] - self.k["x"], s[:, 1] - self.k["y"]
        return x, y, (x**2 + y**2) / self.k["radius"] ** 2


class CurveSlowdown(Twist):
    """Curves cost speed: v (1 - a |w|)."""

    strength: ClassVar[Draw] = lambda s, on, d: {"loss": d.size(0.04, 0.3)}

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v * (1.0 - self.k["loss"] * np.minimum(np.abs(w), 2.5)), w


class HeadingSlope(Twist):
    """A sloping floor: v + a sin(yaw - phase)."""

    strength: ClassVar[Draw] = lambda s, on, d: {"amplitude": d.size(0.02, 0.2), "phase": d.any(0, 6.28)}

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v + self.k["amplitude"] * np.sin(s[:, 2] - self.k["phase"]), w


class Carpet(_Place, since=0):
    """A round carpet that slows the vehicle down towards its middle: v (1 - a e^(-r^2 / 2 R^2))."""

    strength: ClassVar[Draw] = lambda s, on, d: {"depth": d.size(0.15, 0.6), **_where_it_drives(s)}

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v * (1.0 - self.k["depth"] * np.exp(-0.5 * self.off(s)[2])), w


class Hill(_Place, since=2030):
    """A round hill of height e^(-r^2 / 2 R^2): slower uphill, faster downhill; `loss` m/s straight up its steepest."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "loss": d.size(0.1, 0.5) * s.action("v_cmd"),
        **_where_it_drives(s),
    }

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        x, y, far = self.off(s)
        ahead = x * np.cos(s[:, 2]) + y * np.sin(s[:, 2])
        return v + self.k["loss"] * ahead / self.k["radius"] * np.exp(0.5 * (1.0 - far)), w


class WheelSpeedLimit(Twist, family="wheel_saturation", since=2028, needs_levels=True):
    """Left and right wheel, v -+ b w, no faster than the limit: a fast curve costs speed and turn rate at once."""

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        limit, half = self.k["limit"], self.k["half_track"]
        left, right = (np.maximum(np.minimum(x, limit), -limit) for x in (v - half * w, v + half * w))
        return (left + right) / 2, (right - left) / (2 * half)

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """A limit that part of the commanded curves exceed with their outer wheel."""
        half, (v, w) = d.any(0.12, 0.3), s.pilot.commands.reshape(-1, 2).T
        most = float(np.quantile(np.abs(v) + half * np.abs(w), 0.95))
        return {"half_track": half, "limit": (1.0 - d.size(0.08, 0.4)) * most}


class Weathervane(Twist, since=2031):
    """A wind that pushes the tail aside and so turns the vehicle into it: w + a sin(wind - yaw)."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "turn": d.size(0.05, 0.4) * s.action("w_cmd"),
        "wind": d.any(0, 6.28),
    }

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v, w + self.k["turn"] * np.sin(self.k["wind"] - s[:, 2])


class GroovedFloor(Twist, since=2040):
    """A floor of boards whose grooves turn the wheels along, whichever way: w + a sin(2 (line - yaw))."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "turn": d.size(0.05, 0.4) * s.action("w_cmd"),
        "line": d.any(0, 3.14),
    }

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v, w + self.k["turn"] * np.sin(2 * (self.k["line"] - s[:, 2]))


class TowedTrolley(HiddenTwist, since=2028):
    """A trolley on a drawbar of length L that swivels freely; its angle phi behind the vehicle is the hidden state.

    Its wheels do not slip, so phi' = w - v / L sin(phi), and its pull turns the vehicle back: w - b v / L sin(phi).
    """

    strength: ClassVar[Draw] = lambda s, on, d: {"length": d.any(0.2, 0.6), "pull": d.size(0.08, 0.6)}

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        swing = v / self.k["length"] * np.sin(z[:, 0])
        turning = w - self.k["pull"] * swing
        return v, turning, (turning - swing)[:, None]


class EccentricWheel(HiddenTwist, since=2029):
    """The left wheel's axle is off its centre: it rolls (1 + a sin(phi)) as far, phi' = commanded speed / radius.

    phi, its angle, is the hidden state; it is put down the same way every time.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {
        "depth": d.size(0.03, 0.3),
        "half_track": d.any(0.1, 0.25),
        "radius": d.any(0.05, 0.12),
    }

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Speed and turn rate at once, as only one of two wheels differs."""
        half = self.k["half_track"]
        rolling = v - half * w
        more = self.k["depth"] * np.sin(z[:, 0]) * rolling
        return v + more / 2, w - more / (2 * half), (rolling / self.k["radius"])[:, None]


class TyreRelaxation(HiddenTwist, since=2029):
    """The side force of a tyre builds up over a way, not over a time: z' = |v| (w - z) / length, turn rate z.

    von Schlippe and Dietrich (1941); Pacejka (2012), Tire and Vehicle Dynamics, 3rd ed., section 7.2. Of a vehicle that
    drives: at rest z would stay; the speed commanded in these worlds is never 0.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {"length": d.size(0.02, 0.4)}

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """It turns as its tyres are bent."""
        return v, z[:, 0], (np.abs(v) * (w - z[:, 0]) / self.k["length"])[:, None]


class LaggingWheel(HiddenTwist, since=2031):
    """The left wheel's motor is slow: T z' = (v - b w) - z with z what the wheel rolls; the right one is quick."""

    strength: ClassVar[Draw] = lambda s, on, d: {
        "time": d.size(0.5, 6.0) * s.world.dt,
        "half_track": d.any(0.1, 0.25),
    }

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Whenever the speed changes it turns, whenever the turn rate changes it slows down or speeds up."""
        half, rolls = self.k["half_track"], z[:, 0]
        left, right = v - half * w, v + half * w
        return (rolls + right) / 2, (right - rolls) / (2 * half), ((left - rolls) / self.k["time"])[:, None]


class TwistingCable(HiddenTwist, since=2040):
    """A cable from the ceiling that is wound up by turning and turns the vehicle back: w - k z, z' = w - k z.

    z, by how much it is wound up since the start, is the hidden state.
    """

    strength: ClassVar[Draw] = lambda s, on, d: {"rate": d.size(0.03, 0.4)}

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Slower the more it is wound up, faster as it unwinds."""
        turning = w - self.k["rate"] * z[:, 0]
        return v, turning, turning[:, None]
