"""Ten kinds of physics outside the catalogue that no seed before 2031 draws.

Nobody diagnosed a world with one of them before that measurement; they are tested as physics only.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.hidden import Hidden, HiddenTwist, Values
from gpsim.trials.outside.kind import EVERY, MECHANICAL, VEHICLE, Generation, Kind


def running_belt(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    """-F tanh((v - belt) / v0): dry friction against a belt that runs, or of a pendulum on a shaft that turns.

    Froude's pendulum: Rayleigh (1894), The Theory of Sound, vol. 1.
    """
    return np.asarray(-k["force"] * np.tanh((v - k["belt"]) / k["speed"]))


def toggle_spring(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    """-K x (1 - L / sqrt(x^2 + b^2)): a spring across the way, b off it and longer than b, that snaps to either side.

    x is the distance from its middle. von Mises (1923), Über die Stabilitätsprobleme der Elastizitätstheorie.
    """
    x = q - k["centre"]
    return np.asarray(-k["stiffness"] * x * (1.0 - k["rest"] / np.hypot(x, k["aside"])))


class HeapedChain(Hidden):
    """A chain drawn from a heap at `edge`, link by link with a jerk, and laid down again: inertia d (q - edge) if > 0.

    Drawn out, d/dt((m + d x) v) = F; laid down, the links take their momentum along: (m + d x) v' = F. z is the
    place q. Cayley (1857), On a class of dynamical problems.
    """

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Where the body is."""
        return np.stack([q, np.zeros_like(q)], axis=1)

    def inertia(self, k: Values, z: FloatArray) -> FloatArray:
        """What is drawn out."""
        return np.asarray(k["density"] * np.maximum(z[:, 0] - k["edge"], 0.0))

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What it takes to set the next links in motion."""
        return np.asarray(-k["density"] * (z[:, 0] > k["edge"]) * np.maximum(v, 0.0) ** 2)

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """It follows the body."""
        return np.stack([v, np.zeros_like(v)], axis=1)


class TowedSledge(Hidden):
    """A sledge on a rope with slack: it rubs on the floor, -F tanh(r / v0), and is towed to whichever side.

    z is its position and rate r; the rope's pull is K (distance - slack) if > 0.
    """

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """In the middle of the slack, moving along."""
        return np.stack([q, v], axis=1)

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The rope's pull."""
        far = z[:, 0] - q
        return np.asarray(k["stiffness"] * np.sign(far) * np.maximum(np.abs(far) - k["slack"], 0.0))

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the sledge."""
        rubbing = k["friction"] * np.tanh(z[:, 1] / k["speed"])
        return np.stack([z[:, 1], -(self.force(k, q, v, z) + rubbing) / k["inertia"]], axis=1)


def rubbing_axle(k: Values, s: FloatArray) -> FloatArray:
    """(B, 2): a disc on the pole's axle that rubs on the track, -F tanh(V / v0), V = x' - r theta' where they touch.

    It pushes the cart, and turns the pole by its lever r; none where the disc rolls.
    """
    rubbing = k["force"] * np.tanh((s[:, 1] - k["radius"] * s[:, 3]) / k["speed"])
    return np.stack([-rubbing, k["radius"] * rubbing], axis=1)


class OverloadFoldback:
    """A drive that gives a share of its command once its heat reaches 1, until that is back at `reset`.

    Heat: T h' = (a / rated)^2 - h with a what it gives; cold at an episode's start.
    """

    def __init__(self, k: Values) -> None:
        self._k = k
        self._heat: FloatArray | float = 0.0
        self._folded: FloatArray | bool = False

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The command or a share of it."""
        k = self._k
        out = np.where(self._folded, k["share"], 1.0) * u
        goal = (out / k["rated"]) ** 2
        self._heat = goal + (self._heat - goal) * np.exp(-h / k["time"])
        self._folded = np.where(self._folded, self._heat > k["reset"], self._heat >= 1.0)
        return np.asarray(out)


class PulsedThrusters:
    """Thrusters that are open or shut: +-U for the share |u| / U of every period, then nothing.

    Sidi (1997), Spacecraft Dynamics and Control, chapter 9. The mean over the step.
    """

    def __init__(self, k: Values) -> None:
        self._full, self._period = k["full"], k["period"]

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """As long as they are open in the step; more than U they cannot give."""
        share = np.minimum(np.abs(u) / self._full, 1.0)
        opened = self._opened(t + h, share) - self._opened(t, share)
        return np.asarray(np.sign(u) * self._full * opened / h)

    def _opened(self, t: FloatArray, share: FloatArray) -> FloatArray:
        """(B,) s that they were open until t."""
        periods = np.floor(t / self._period)
        return np.asarray(self._period * (periods * share + np.minimum(t / self._period - periods, share)))


def weathervane(k: Values, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A wind that pushes the tail aside and so turns the vehicle into it: w + a sin(wind - yaw)."""
    return v, w + k["turn"] * np.sin(k["wind"] - s[:, 2])


class LaggingWheel(HiddenTwist):
    """The left wheel's motor is slow: T z' = (v - b w) - z with z what the wheel rolls; the right one is quick."""

    def begin(self, s: FloatArray) -> FloatArray:
        """(B, 1): at rest."""
        return np.zeros((len(s), 1))

    def twist(
        self, k: Values, v: FloatArray, w: FloatArray, z: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Whenever the speed changes it turns, whenever the turn rate changes it slows down or speeds up."""
        left, right = v - k["half_track"] * w, v + k["half_track"] * w
        rolls = z[:, 0]
        return (
            (rolls + right) / 2,
            (right - rolls) / (2 * k["half_track"]),
            ((left - rolls) / k["time"])[:, None],
        )


def encoder_play(k: Values, past: FloatArray, h: float) -> FloatArray:
    """An encoder behind a gear with play: it reads on only when an end of the gap, `gap` to either side, pushes it.

    What lies between the gap's lower end and the body, a path held between 0 and 2 gap: Kruk, Lehoczky, Ramanan and
    Shreve (2007), An explicit formula for the Skorokhod map on [0, a]. In the middle of the gap at the start.
    """
    free = past - past[0] + k["gap"]
    held = free + np.maximum(np.maximum.accumulate(-free), 0.0)
    least = np.minimum.accumulate(held[::-1])[::-1]  # from every moment until now
    over = np.minimum(np.maximum(held - 2.0 * k["gap"], 0.0), least).max(axis=0)
    return np.asarray(past[-1] - (held[-1] - over - k["gap"]))


GENERATION = Generation(
    since=2031,
    kinds={
        "running_belt": Kind("force", MECHANICAL, "dry friction against a belt that runs"),
        "toggle_spring": Kind("force", MECHANICAL, "a spring across the way that snaps to either side"),
        "heaped_chain": Kind("hidden", MECHANICAL, "a chain drawn from a heap and laid down again"),
        "towed_sledge": Kind("hidden", MECHANICAL, "a sledge that rubs, on a rope with slack"),
        "rubbing_axle": Kind("coupled", ("cartpole",), "a disc on the pole's axle that rubs on the track"),
        "overload_foldback": Kind("actuator", EVERY, "a drive that gives less until it has cooled down"),
        "pulsed_thrusters": Kind(
            "actuator", MECHANICAL, "thrusters that are open or shut: pulses of some width"
        ),
        "weathervane": Kind("twist", VEHICLE, "a wind that turns the vehicle into it"),
        "lagging_wheel": Kind("twist", VEHICLE, "one of two wheels follows late"),
        "encoder_play": Kind("sensor", EVERY, "an encoder behind a gear with play"),
    },
    forces={"running_belt": running_belt, "toggle_spring": toggle_spring},
    hidden={"heaped_chain": HeapedChain(), "towed_sledge": TowedSledge()},
    coupled={"rubbing_axle": rubbing_axle},
    actuators={"overload_foldback": OverloadFoldback, "pulsed_thrusters": PulsedThrusters},
    twist={"weathervane": weathervane},
    hidden_twist={"lagging_wheel": LaggingWheel()},
    recalled={"encoder_play": encoder_play},
)
