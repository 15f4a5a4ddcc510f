"""Ten kinds of physics outside the catalogue that no seed before 2028 draws, and only that one.

Nobody diagnosed a world with one of them before that measurement; they are tested as physics only.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.hidden import Hidden, HiddenTwist, Values
from gpsim.trials.outside.kind import EVERY, MECHANICAL, VEHICLE, Generation, Kind


def eddy_brake(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    """-2 A x / (1 + x^2), x = v / v0: A is the most it brakes with, at v0; faster than that it lets go.

    Smythe (1942), On eddy currents in a rotating disk.
    """
    x = v / k["speed"]
    return np.asarray(-2.0 * k["amplitude"] * x / (1.0 + x * x))


class RubberBuffer(Hidden):
    """A Maxwell element, a spring and a damper in a row: force -z, z' = k v - z / T."""

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Relaxed."""
        return np.zeros((len(q), 2))

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The spring's pull."""
        return np.asarray(-z[:, 0])

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Stretched by the motion, relaxed by the damper."""
        out = np.zeros_like(z)
        out[:, 0] = k["stiffness"] * v - z[:, 0] / k["time"]
        return out


def uneven_inertia(k: Values, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A cos(k q + phase), by which a coordinate's inertia differs from the base's, and its derivative by q."""
    angle = k["wave_number"] * q + k["phase"]
    return k["amplitude"] * np.cos(angle), -k["amplitude"] * k["wave_number"] * np.sin(angle)


class WormGear:
    """u - mu |u| tanh(v / v0): a gear whose friction grows with what it transmits; v is the driven coordinate's."""

    def __init__(self, k: Values) -> None:
        self._k = k

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What the gear lets through."""
        k = self._k
        return np.asarray(u - k["friction"] * np.abs(u) * np.tanh(s[:, 1] / k["speed"]))


class LostCommands:
    """Outages of a radio link: what acts is the last command that arrived. Which are lost follows from the moment."""

    def __init__(self, k: Values) -> None:
        self._k = k
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command; in a lost period, of which each is a few samples long, the last one before it."""
        k = self._k
        number = np.floor((t + h / 2) / k["outage"])
        # The usual one-line hash: digits behind the point of a large multiple of a sine.
        chance = np.abs(np.sin(12.9898 * number + k["phase"])) * 43758.5453 % 1.0
        self._level = np.where(chance < k["share"], self._level, u)
        return np.asarray(self._level)


class HotMotor:
    """A gain 1 - loss T that falls as the motor warms up: time T' = (u / U)^2 - T; cold at an episode's start."""

    def __init__(self, k: Values) -> None:
        self._k = k
        self._heat: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What is left of the command."""
        k = self._k
        out = u * np.maximum(1.0 - k["loss"] * self._heat, 0.0)
        goal = (u / k["rated"]) ** 2
        self._heat = goal + (self._heat - goal) * np.exp(-h / k["time"])
        return np.asarray(out)


def wheel_speed_limit(
    k: Values, v: FloatArray, w: FloatArray, s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Left and right wheel, v -+ b w, no faster than the limit: a fast curve costs speed and turn rate at once."""
    left, right = v - k["half_track"] * w, v + k["half_track"] * w
    left = np.maximum(np.minimum(left, k["limit"]), -k["limit"])
    right = np.maximum(np.minimum(right, k["limit"]), -k["limit"])
    return (left + right) / 2, (right - left) / (2 * k["half_track"])


class Trolley(HiddenTwist):
    """A trolley on a drawbar of length L that swivels freely; its angle phi behind the vehicle is the hidden state.

    Its wheels do not slip, so phi' = w - v / L sin(phi), and its pull turns the vehicle back: w - b v / L sin(phi).
    """

    def begin(self, s: FloatArray) -> FloatArray:
        """(B, 1): straight behind."""
        return np.zeros((len(s), 1))

    def twist(
        self, k: Values, v: FloatArray, w: FloatArray, z: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """v, w and z' (B, 1)."""
        swing = v / k["length"] * np.sin(z[:, 0])
        turning = w - k["pull"] * swing
        return v, turning, (turning - swing)[:, None]


def last_tick(k: Values, index: int, h: float) -> int:
    """The fine step at which a slow sensor read last, at or before `index`; its ticks begin with the episode."""
    ticks = np.floor((index + 0.5) * h / k["period"])
    return min(int(ticks * k["period"] / h + 0.5), index)


def slow_sensor(k: Values, past: FloatArray, h: float) -> FloatArray:
    """What was at the last tick."""
    return np.asarray(past[last_tick(k, len(past) - 1, h)])


def fisheye(k: Values, position: FloatArray) -> FloatArray:
    """(B, 2) positions by a camera at height H above the origin whose orthographic fisheye was taken for a pinhole.

    It sees the radius H sin(atan(r / H)) = r / sqrt(1 + (r / H)^2).
    """
    far = (position**2).sum(axis=1) / k["height"] ** 2
    return np.asarray(position / np.sqrt(1.0 + far)[:, None])


GENERATION = Generation(
    since=2028,
    kinds={
        "eddy_brake": Kind("force", MECHANICAL, "a magnetic brake that lets go when the body is fast"),
        "rubber_buffer": Kind(
            "hidden", MECHANICAL, "a spring and a damper in a row: it forgets where it began"
        ),
        "uneven_inertia": Kind(
            "inertia", MECHANICAL, "an unbalanced drive: the inertia varies with position"
        ),
        "worm_gear": Kind("actuator", MECHANICAL, "friction that grows with the force transmitted"),
        "lost_commands": Kind("actuator", EVERY, "outages in which the last command goes on"),
        "hot_motor": Kind("actuator", EVERY, "a gain that falls with the mean square of the command"),
        "wheel_speed_limit": Kind("twist", VEHICLE, "each of two wheels turns only so fast"),
        "towed_trolley": Kind("twist", VEHICLE, "a trolley on a drawbar pulls the vehicle straight"),
        "slow_sensor": Kind("sensor", EVERY, "a sensor that reads less often than recorded"),
        "fisheye_camera": Kind("sensor", VEHICLE, "a camera's radial distortion of the pose", ("pose",)),
    },
    forces={"eddy_brake": eddy_brake},
    hidden={"rubber_buffer": RubberBuffer()},
    inertia={"uneven_inertia": uneven_inertia},
    actuators={"worm_gear": WormGear, "lost_commands": LostCommands, "hot_motor": HotMotor},
    twist={"wheel_speed_limit": wheel_speed_limit},
    hidden_twist={"towed_trolley": Trolley()},
    bent={"fisheye_camera": fisheye},
    recalled={"slow_sensor": slow_sensor},
)
