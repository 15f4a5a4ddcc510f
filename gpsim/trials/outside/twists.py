"""What becomes of a vehicle's twist: on grounds and in winds, and by wheels, tyres and trailers that remember."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import Draw, HiddenTwist, Twist
from gpsim.trials.worlds import Dial, Scales


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


class Carpet(_Place):
    """A round carpet that slows the vehicle down towards its middle: v (1 - a e^(-r^2 / 2 R^2))."""

    since = 0
    strength: ClassVar[Draw] = lambda s, on, d: {"depth": d.size(0.15, 0.6), **_where_it_drives(s)}

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v * (1.0 - self.k["depth"] * np.exp(-0.5 * self.off(s)[2])), w


class Hill(_Place):
    """A round hill of height e^(-r^2 / 2 R^2): slower uphill, faster downhill; `loss` m/s straight up its steepest."""

    since = 2030
    strength: ClassVar[Draw] = lambda s, on, d: {
        "loss": d.size(0.1, 0.5) * s.action("v_cmd"),
        **_where_it_drives(s),
    }

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        x, y, far = self.off(s)
        ahead = x * np.cos(s[:, 2]) + y * np.sin(s[:, 2])
        return v + self.k["loss"] * ahead / self.k["radius"] * np.exp(0.5 * (1.0 - far)), w


class WheelSpeedLimit(Twist):
    """Left and right wheel, v -+ b w, no faster than the limit: a fast curve costs speed and turn rate at once."""

    family = "wheel_saturation"
    since = 2028
    needs_levels = True

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


class Weathervane(Twist):
    """A wind that pushes the tail aside and so turns the vehicle into it: w + a sin(wind - yaw)."""

    since = 2031
    strength: ClassVar[Draw] = lambda s, on, d: {
        "turn": d.size(0.05, 0.4) * s.action("w_cmd"),
        "wind": d.any(0, 6.28),
    }

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v, w + self.k["turn"] * np.sin(self.k["wind"] - s[:, 2])


class GroovedFloor(Twist):
    """A floor of boards whose grooves turn the wheels along, whichever way: w + a sin(2 (line - yaw))."""

    since = 2040
    strength: ClassVar[Draw] = lambda s, on, d: {
        "turn": d.size(0.05, 0.4) * s.action("w_cmd"),
        "line": d.any(0, 3.14),
    }

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v, w + self.k["turn"] * np.sin(2 * (self.k["line"] - s[:, 2]))


class TowedTrolley(HiddenTwist):
    """A trolley on a drawbar of length L that swivels freely; its angle phi behind the vehicle is the hidden state.

    Its wheels do not slip, so phi' = w - v / L sin(phi), and its pull turns the vehicle back: w - b v / L sin(phi).
    """

    since = 2028
    strength: ClassVar[Draw] = lambda s, on, d: {"length": d.any(0.2, 0.6), "pull": d.size(0.08, 0.6)}

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        swing = v / self.k["length"] * np.sin(z[:, 0])
        turning = w - self.k["pull"] * swing
        return v, turning, (turning - swing)[:, None]


class EccentricWheel(HiddenTwist):
    """The left wheel's axle is off its centre: it rolls (1 + a sin(phi)) as far, phi' = commanded speed / radius.

    phi, its angle, is the hidden state; it is put down the same way every time.
    """

    since = 2029
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


class TyreRelaxation(HiddenTwist):
    """The side force of a tyre builds up over a way, not over a time: z' = |v| (w - z) / length, turn rate z.

    von Schlippe and Dietrich (1941); Pacejka (2012), Tire and Vehicle Dynamics, 3rd ed., section 7.2. Of a vehicle that
    drives: at rest z would stay; the speed commanded in these worlds is never 0.
    """

    since = 2029
    strength: ClassVar[Draw] = lambda s, on, d: {"length": d.size(0.02, 0.4)}

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """It turns as its tyres are bent."""
        return v, z[:, 0], (np.abs(v) * (w - z[:, 0]) / self.k["length"])[:, None]


class LaggingWheel(HiddenTwist):
    """The left wheel's motor is slow: T z' = (v - b w) - z with z what the wheel rolls; the right one is quick."""

    since = 2031
    strength: ClassVar[Draw] = lambda s, on, d: {
        "time": d.size(0.5, 6.0) * s.world.dt,
        "half_track": d.any(0.1, 0.25),
    }

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Whenever the speed changes it turns, whenever the turn rate changes it slows down or speeds up."""
        half, rolls = self.k["half_track"], z[:, 0]
        left, right = v - half * w, v + half * w
        return (rolls + right) / 2, (right - rolls) / (2 * half), ((left - rolls) / self.k["time"])[:, None]


class TwistingCable(HiddenTwist):
    """A cable from the ceiling that is wound up by turning and turns the vehicle back: w - k z, z' = w - k z.

    z, by how much it is wound up since the start, is the hidden state.
    """

    since = 2040
    strength: ClassVar[Draw] = lambda s, on, d: {"rate": d.size(0.03, 0.4)}

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Slower the more it is wound up, faster as it unwinds."""
        turning = w - self.k["rate"] * z[:, 0]
        return v, turning, turning[:, None]
