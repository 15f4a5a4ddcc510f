"""What becomes of a vehicle's twist: on grounds and in winds, and by wheels, tyres and trailers that remember."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.kind import HiddenTwist, Twist
from gpsim.trials.worlds import Dial, Scales, rounded


class CurveSlowdown(Twist):
    """Curves cost speed: v (1 - a |w|)."""

    name = "curve_slowdown"
    since = None

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v * (1.0 - self.k["loss"] * np.minimum(np.abs(w), 2.5)), w

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"loss": d.size(0.04, 0.3)}


class HeadingSlope(Twist):
    """A sloping floor: v + a sin(yaw - phase)."""

    name = "heading_slope"
    since = None

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v + self.k["amplitude"] * np.sin(s[:, 2] - self.k["phase"]), w

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"amplitude": d.size(0.02, 0.2), "phase": d.any(0, 6.28)}


class Carpet(Twist):
    """A round carpet that slows the vehicle down towards its middle: v (1 - a e^(-r^2 / 2 R^2))."""

    name = "carpet"
    since = 0

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = self.k
        far = ((s[:, 0] - k["x"]) ** 2 + (s[:, 1] - k["y"]) ** 2) / k["radius"] ** 2
        return v * (1.0 - k["depth"] * np.exp(-0.5 * far)), w

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"depth": d.size(0.15, 0.6), **_where_it_drives(s)}


class WheelSpeedLimit(Twist):
    """Left and right wheel, v -+ b w, no faster than the limit: a fast curve costs speed and turn rate at once."""

    name = "wheel_speed_limit"
    family = "wheel_saturation"
    since = 2028
    needs_levels = True

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = self.k
        left, right = v - k["half_track"] * w, v + k["half_track"] * w
        left = np.maximum(np.minimum(left, k["limit"]), -k["limit"])
        right = np.maximum(np.minimum(right, k["limit"]), -k["limit"])
        return (left + right) / 2, (right - left) / (2 * k["half_track"])

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        """A limit that part of the commanded curves exceed with their outer wheel."""
        half = d.any(0.12, 0.3)
        v, w = s.pilot.commands[..., 0].ravel(), s.pilot.commands[..., 1].ravel()
        most = float(np.quantile(np.abs(v) + half * np.abs(w), 0.95))
        return {"half_track": half, "limit": rounded((1.0 - d.size(0.08, 0.4)) * most)}


class Hill(Twist):
    """A round hill of height e^(-r^2 / 2 R^2): slower uphill, faster downhill; `loss` m/s straight up its steepest."""

    name = "hill"
    since = 2030

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = self.k
        ahead = (s[:, 0] - k["x"]) * np.cos(s[:, 2]) + (s[:, 1] - k["y"]) * np.sin(s[:, 2])
        far = ((s[:, 0] - k["x"]) ** 2 + (s[:, 1] - k["y"]) ** 2) / k["radius"] ** 2
        return v + k["loss"] * ahead / k["radius"] * np.exp(0.5 * (1.0 - far)), w

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"loss": rounded(d.size(0.1, 0.5) * s.action("v_cmd")), **_where_it_drives(s)}


class Weathervane(Twist):
    """A wind that pushes the tail aside and so turns the vehicle into it: w + a sin(wind - yaw)."""

    name = "weathervane"
    since = 2031

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v, w + self.k["turn"] * np.sin(self.k["wind"] - s[:, 2])

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"turn": rounded(d.size(0.05, 0.4) * s.action("w_cmd")), "wind": d.any(0, 6.28)}


class TowedTrolley(HiddenTwist):
    """A trolley on a drawbar of length L that swivels freely; its angle phi behind the vehicle is the hidden state.

    Its wheels do not slip, so phi' = w - v / L sin(phi), and its pull turns the vehicle back: w - b v / L sin(phi).
    """

    name = "towed_trolley"
    since = 2028

    def begin(self, s: FloatArray) -> FloatArray:
        """Straight behind."""
        return np.zeros((len(s), 1))

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        swing = v / self.k["length"] * np.sin(z[:, 0])
        turning = w - self.k["pull"] * swing
        return v, turning, (turning - swing)[:, None]

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"length": d.any(0.2, 0.6), "pull": d.size(0.08, 0.6)}


class EccentricWheel(HiddenTwist):
    """The left wheel's axle is off its centre: it rolls (1 + a sin(phi)) as far, phi' = commanded speed / radius.

    phi, its angle, is the hidden state.
    """

    name = "eccentric_wheel"
    since = 2029

    def begin(self, s: FloatArray) -> FloatArray:
        """It is put down the same way every time."""
        return np.zeros((len(s), 1))

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Speed and turn rate at once, as only one of two wheels differs."""
        k = self.k
        rolling = v - k["half_track"] * w
        more = k["depth"] * np.sin(z[:, 0]) * rolling
        return v + more / 2, w - more / (2 * k["half_track"]), (rolling / k["radius"])[:, None]

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {
            "depth": d.size(0.03, 0.3),
            "half_track": d.any(0.1, 0.25),
            "radius": d.any(0.05, 0.12),
        }


class TyreRelaxation(HiddenTwist):
    """The side force of a tyre builds up over a way, not over a time: z' = |v| (w - z) / length, turn rate z.

    von Schlippe and Dietrich (1941); Pacejka (2012), Tire and Vehicle Dynamics, 3rd ed., section 7.2. Of a vehicle that
    drives: at rest z would stay; the speed commanded in these worlds is never 0.
    """

    name = "tyre_relaxation"
    since = 2029

    def begin(self, s: FloatArray) -> FloatArray:
        """Straight ahead."""
        return np.zeros((len(s), 1))

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """It turns as its tyres are bent."""
        return v, z[:, 0], (np.abs(v) * (w - z[:, 0]) / self.k["length"])[:, None]

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"length": d.size(0.02, 0.4)}


class LaggingWheel(HiddenTwist):
    """The left wheel's motor is slow: T z' = (v - b w) - z with z what the wheel rolls; the right one is quick."""

    name = "lagging_wheel"
    since = 2031

    def begin(self, s: FloatArray) -> FloatArray:
        """At rest."""
        return np.zeros((len(s), 1))

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Whenever the speed changes it turns, whenever the turn rate changes it slows down or speeds up."""
        k = self.k
        left, right = v - k["half_track"] * w, v + k["half_track"] * w
        rolls = z[:, 0]
        return (
            (rolls + right) / 2,
            (right - rolls) / (2 * k["half_track"]),
            ((left - rolls) / k["time"])[:, None],
        )

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"time": rounded(d.size(0.5, 6.0) * s.world.dt), "half_track": d.any(0.1, 0.25)}


def _where_it_drives(s: Scales) -> dict[str, float]:
    """Middle and radius of a place where the vehicle is most of the time."""
    return {
        "x": rounded(float(np.median(s.column("x")))),
        "y": rounded(float(np.median(s.column("y")))),
        "radius": rounded(0.6 * min(s.reach("x"), s.reach("y"))),
    }


class GroovedFloor(Twist):
    """A floor of boards whose grooves turn the wheels along, whichever way: w + a sin(2 (line - yaw))."""

    name = "grooved_floor"
    since = 2040

    def twist(self, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        return v, w + self.k["turn"] * np.sin(2 * (self.k["line"] - s[:, 2]))

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"turn": rounded(d.size(0.05, 0.4) * s.action("w_cmd")), "line": d.any(0, 3.14)}


class TwistingCable(HiddenTwist):
    """A cable from the ceiling that is wound up by turning and turns the vehicle back: w - k z, z' = w - k z.

    z, by how much it is wound up since the start, is the hidden state.
    """

    name = "twisting_cable"
    since = 2040

    def begin(self, s: FloatArray) -> FloatArray:
        """Unwound."""
        return np.zeros((len(s), 1))

    def twist(self, v: FloatArray, w: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Slower the more it is wound up, faster as it unwinds."""
        turning = w - self.k["rate"] * z[:, 0]
        return v, turning, turning[:, None]

    @staticmethod
    def strength(s: Scales, on: str, d: Dial) -> dict[str, float]:
        return {"rate": rounded(d.size(0.03, 0.4))}


KINDS = (
    CurveSlowdown,
    HeadingSlope,
    Carpet,
    WheelSpeedLimit,
    Hill,
    Weathervane,
    TowedTrolley,
    EccentricWheel,
    TyreRelaxation,
    LaggingWheel,
    GroovedFloor,
    TwistingCable,
)
