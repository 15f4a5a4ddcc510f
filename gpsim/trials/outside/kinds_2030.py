"""Ten kinds of physics outside the catalogue that no seed before 2030 draws.

Nobody diagnosed a world with one of them before that measurement; they are tested as physics only.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.hidden import Hidden, Values
from gpsim.trials.outside.kind import EVERY, MECHANICAL, VEHICLE, Generation, Kind


def one_way_damper(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    """A damper with a check valve: -c v towards its side (1 or -1), nothing on the way back."""
    return np.asarray(-k["damping"] * k["side"] * np.maximum(k["side"] * v, 0.0))


def dragged_cable(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    """-w |q - anchor| tanh(v / v0): a cable that lies on the floor; the farther out, the more of it is dragged."""
    return np.asarray(-k["drag"] * np.abs(q - k["anchor"]) * np.tanh(v / k["speed"]))


class SlippingFlywheel(Hidden):
    """A flywheel behind a dry clutch, which transmits at most F: F tanh((r - v) / v0); z is its angle and rate r.

    What changes gently takes it along, what changes fast slips: the inertia seems to depend on the acceleration.
    """

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Turning along."""
        return np.stack([q, v], axis=1)

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What the clutch transmits."""
        return np.asarray(k["grip"] * np.tanh((z[:, 1] - v) / k["speed"]))

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the flywheel."""
        return np.stack([z[:, 1], -self.force(k, q, v, z) / k["inertia"]], axis=1)


class LeakingTank(Hidden):
    """A load that runs out, J e^(-t / T) from every episode's start; what leaves has the body's speed: no thrust.

    Sommerfeld (1952), Mechanics, section 4: with v of what leaves the body's own, m dv/dt = F.
    """

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Full."""
        return np.stack([np.ones_like(q), np.zeros_like(q)], axis=1)

    def inertia(self, k: Values, z: FloatArray) -> FloatArray:
        """What is left in it."""
        return np.asarray(k["inertia"] * z[:, 0])

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """None."""
        return np.zeros_like(v)

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The less is in it, the less runs out."""
        return np.stack([-z[:, 0] / k["time"], np.zeros_like(v)], axis=1)


def tip_tether(k: Values, s: FloatArray) -> FloatArray:
    """(B, 2): a rubber band from the pole's tip to the middle of the track, which pulls when longer than its rest.

    From the potential K max(d - rest, 0)^2 / 2 with the tip at (x + L sin theta, L cos theta) and d its distance.
    """
    sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
    ahead, up = s[:, 0] + k["length"] * sin, k["length"] * cos
    far = np.hypot(ahead, up)
    pull = k["stiffness"] * np.maximum(far - k["rest"], 0.0) / np.maximum(far, 1e-9)
    return np.stack([-pull * ahead, -pull * k["length"] * (cos * ahead - sin * up)], axis=1)


class PneumaticValve:
    """A chamber that fills in one time and vents in another: T a' = u - a, T by whether |a| grows or falls.

    Exact for a command held while a keeps its side; the mean over the step.
    """

    def __init__(self, k: Values) -> None:
        self._fill, self._vent = k["fill"], k["vent"]
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The mean of the exponential approach."""
        behind = self._level - u
        x = h / np.where(behind * self._level > 0.0, self._vent, self._fill)
        self._level = u + behind * np.exp(-x)
        return np.asarray(u - behind * np.expm1(-x) / x)


class ExpoCurve:
    """u (1 - e + e (u / U)^2): a stick's curve that is soft in the middle and right at full command U."""

    def __init__(self, k: Values) -> None:
        self._soft, self._full = k["softness"], k["full"]

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """The curve."""
        return np.asarray(u * (1.0 - self._soft + self._soft * (u / self._full) ** 2))


def hill(k: Values, v: FloatArray, w: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A round hill of height e^(-r^2 / 2 R^2): slower uphill, faster downhill; `loss` m/s straight up its steepest."""
    ahead = (s[:, 0] - k["x"]) * np.cos(s[:, 2]) + (s[:, 1] - k["y"]) * np.sin(s[:, 2])
    far = ((s[:, 0] - k["x"]) ** 2 + (s[:, 1] - k["y"]) ** 2) / k["radius"] ** 2
    return v + k["loss"] * ahead / k["radius"] * np.exp(0.5 * (1.0 - far)), w


def coarse_encoder(k: Values, y: FloatArray) -> FloatArray:
    """What an encoder of few lines counts: multiples of its step."""
    return np.asarray(k["step"] * np.floor(y / k["step"] + 0.5))


def warming_sensor(k: Values, past: FloatArray, h: float) -> FloatArray:
    """A zero that moves as the sensor warms up: y + A (1 - e^(-t / T)), t s after the episode's start."""
    return np.asarray(past[-1] - k["offset"] * np.expm1(-h * (len(past) - 1) / k["time"]))


GENERATION = Generation(
    since=2030,
    kinds={
        "one_way_damper": Kind("force", MECHANICAL, "a damper with a check valve: it resists one way only"),
        "dragged_cable": Kind(
            "force", MECHANICAL, "a cable on the floor, more of it dragged the farther out"
        ),
        "slipping_flywheel": Kind("hidden", MECHANICAL, "a flywheel behind a clutch that slips"),
        "leaking_tank": Kind("hidden", MECHANICAL, "a load that runs out in every episode"),
        "tip_tether": Kind("coupled", ("cartpole",), "a rubber band from the pole's tip to the track"),
        "pneumatic_valve": Kind("actuator", EVERY, "an actuator that fills fast and vents slowly"),
        "expo_curve": Kind("actuator", EVERY, "a command curve that is soft in the middle"),
        "hill": Kind("twist", VEHICLE, "a round hill: slower up, faster down"),
        "coarse_encoder": Kind("sensor", EVERY, "an encoder of few lines"),
        "warming_sensor": Kind("sensor", EVERY, "a sensor whose zero moves as it warms up"),
    },
    forces={"one_way_damper": one_way_damper, "dragged_cable": dragged_cable},
    hidden={"slipping_flywheel": SlippingFlywheel(), "leaking_tank": LeakingTank()},
    coupled={"tip_tether": tip_tether},
    actuators={"pneumatic_valve": PneumaticValve, "expo_curve": ExpoCurve},
    twist={"hill": hill},
    bent={"coarse_encoder": coarse_encoder},
    recalled={"warming_sensor": warming_sensor},
)
