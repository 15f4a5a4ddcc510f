"""Ten kinds of physics outside the catalogue that no seed before 2029 draws.

Nobody diagnosed a world with one of them before that measurement; they are tested as physics only.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.hidden import Hidden, HiddenTwist, Values
from gpsim.trials.outside.kind import EVERY, MECHANICAL, VEHICLE, Generation, Kind


def shear_thinning(k: Values, q: FloatArray, v: FloatArray, wall: FloatArray) -> FloatArray:
    """-b v (1 + (v / v0)^2)^((n - 1) / 2): a damper's oil, thick when slow; faster than v0 about |v|^n, n < 1.

    Carreau (1972), Rheological equations from molecular network theories.
    """
    thinned = (1.0 + (v / k["speed"]) ** 2) ** ((k["exponent"] - 1.0) / 2.0)
    return np.asarray(-k["damping"] * thinned * v)


class Grease(Hidden):
    """Grease that gels at rest: force -b z v, z' = (1 - z) / T - |v| z / L, z in (0, 1]; motion breaks the gel down.

    Moore (1959), The rheology of ceramic slips and bodies; Mewis and Wagner (2009), Thixotropy, section 4.
    """

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Gelled."""
        return np.stack([np.ones_like(q), np.zeros_like(q)], axis=1)

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Viscous, as stiff as the gel is."""
        return np.asarray(-k["damping"] * z[:, 0] * v)

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """It builds up with time and breaks down with the way."""
        out = np.zeros_like(z)
        out[:, 0] = (1.0 - z[:, 0]) / k["time"] - np.abs(v) * z[:, 0] / k["way"]
        return out


class LooseLoad(Hidden):
    """A mass that is free between two buffers, `gap` to either side: z is its position and velocity.

    Impact pair: Masri and Caughey (1966); the buffers are Hunt and Crossley's (1975) with n = 1, so they never pull.
    """

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """In the middle, moving along."""
        return np.stack([q, v], axis=1)

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What the buffer that is touched transmits."""
        off = z[:, 0] - q
        side = np.sign(off)
        depth = np.maximum(np.abs(off) - k["gap"], 0.0)
        return np.asarray(
            k["stiffness"] * side * depth * np.maximum(1.0 + k["loss"] * side * (z[:, 1] - v), 0.0)
        )

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Newton's law of the loose mass."""
        return np.stack([z[:, 1], -self.force(k, q, v, z) / k["inertia"]], axis=1)


class Governor(Hidden):
    """Two flyweights on springs that turn with the body: z is their radius r, 1 at rest, and its rate.

    Inertia J (r^2 - 1) more than at rest, force -2 J r r' v, r'' = r v^2 - w^2 (r - 1) - 2 zeta w r': Lagrange's
    equations of J (r'^2 + r^2 v^2) / 2 - J w^2 (r - 1)^2 / 2. Maxwell (1868), On governors.
    """

    def begin(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Drawn in."""
        return np.stack([np.ones_like(q), np.zeros_like(q)], axis=1)

    def inertia(self, k: Values, z: FloatArray) -> FloatArray:
        """More the farther they are out."""
        return np.asarray(k["inertia"] * (z[:, 0] ** 2 - 1.0))

    def force(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """What it takes to speed weights up that move outwards."""
        return np.asarray(-2.0 * k["inertia"] * z[:, 0] * z[:, 1] * v)

    def drift(self, k: Values, q: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """The weights: flung outwards, drawn back, damped."""
        turn = k["turn"]
        back = turn**2 * (z[:, 0] - 1.0) + 2.0 * k["damping_ratio"] * turn * z[:, 1]
        return np.stack([z[:, 1], z[:, 0] * v**2 - back], axis=1)


def tip_sail(k: Values, s: FloatArray) -> FloatArray:
    """(B, 2): a ball at the pole's tip in still air, -c |V| V with V the tip's own velocity, which is both axes'."""
    x_rate, turn = s[:, 1], k["length"] * s[:, 3]
    ahead, up = x_rate + turn * np.cos(s[:, 2]), -turn * np.sin(s[:, 2])
    thrust = -k["drag"] * np.hypot(ahead, up)
    lever = k["length"] * (np.cos(s[:, 2]) * ahead - np.sin(s[:, 2]) * up)
    return np.stack([thrust * ahead, thrust * lever], axis=1)


class StickyValve:
    """It stays where it is until the command is more than a band away, then it goes there in one jump.

    Stenman, Gustafsson and Forsman (2003), A segmentation-based method for detection of stiction in control valves.
    """

    def __init__(self, k: Values) -> None:
        self._band = k["band"]
        self._level: FloatArray | float = 0.0

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """Where the valve is."""
        self._level = np.where(np.abs(u - self._level) > self._band, u, self._level)
        return np.asarray(self._level)


class PowerLimit:
    """|u v| <= P while it drives: a supply that gives only so much; v is the driven coordinate's. It brakes in full."""

    def __init__(self, k: Values) -> None:
        self._most = k["power"]

    def act(self, u: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """What the supply can feed."""
        return np.asarray(u * (self._most / np.maximum(u * s[:, 1], self._most)))


class EccentricWheel(HiddenTwist):
    """The left wheel's axle is off its centre: it rolls (1 + a sin(phi)) as far, phi' = commanded speed / radius.

    phi, its angle, is the hidden state.
    """

    def begin(self, s: FloatArray) -> FloatArray:
        """(B, 1): it is put down the same way every time."""
        return np.zeros((len(s), 1))

    def twist(
        self, k: Values, v: FloatArray, w: FloatArray, z: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Speed and turn rate at once, as only one of two wheels differs."""
        rolling = v - k["half_track"] * w
        more = k["depth"] * np.sin(z[:, 0]) * rolling
        return v + more / 2, w - more / (2 * k["half_track"]), (rolling / k["radius"])[:, None]


class TyreRelaxation(HiddenTwist):
    """The side force of a tyre builds up over a way, not over a time: z' = |v| (w - z) / length, turn rate z.

    von Schlippe and Dietrich (1941); Pacejka (2012), Tire and Vehicle Dynamics, 3rd ed., section 7.2. Of a vehicle that
    drives: at rest z would stay; the speed commanded in these worlds is never 0.
    """

    def begin(self, s: FloatArray) -> FloatArray:
        """(B, 1): straight ahead."""
        return np.zeros((len(s), 1))

    def twist(
        self, k: Values, v: FloatArray, w: FloatArray, z: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """It turns as its tyres are bent."""
        return v, z[:, 0], (np.abs(v) * (w - z[:, 0]) / k["length"])[:, None]


def loose_marker(k: Values, past: FloatArray, h: float) -> FloatArray:
    """A marker on a springy stalk: p'' = w^2 (q - p) + 2 zeta w (q' - p'), what is read is p.

    Base excitation (Inman, Engineering Vibration, section 2.4): the sum of its responses to a past of small moves,
    each taken half a fine step after it began.
    """
    turn = 2 * np.pi * k["frequency"]
    decay, ring = k["damping_ratio"] * turn, turn * np.sqrt(1.0 - k["damping_ratio"] ** 2)
    age = h * (np.arange(len(past) - 1)[::-1] + 0.5)
    behind = np.exp(-decay * age) * (np.cos(ring * age) - decay / ring * np.sin(ring * age))
    moves = np.diff(past, axis=0)
    return np.asarray(past[-1] - (behind[:, None] * moves).sum(axis=0))


GENERATION = Generation(
    since=2029,
    kinds={
        "shear_thinning": Kind(
            "force", MECHANICAL, "a damper whose oil gets thinner the faster it is sheared"
        ),
        "thixotropic_grease": Kind("hidden", MECHANICAL, "grease that gels at rest and gives way to motion"),
        "loose_load": Kind("hidden", MECHANICAL, "a load with play that knocks from one buffer to the other"),
        "centrifugal_governor": Kind(
            "hidden", ("cartpole", "pendulum"), "flyweights: the inertia grows with speed", ("theta",)
        ),
        "tip_sail": Kind("coupled", ("cartpole",), "drag on the pole's tip, which the cart moves, too"),
        "sticky_valve": Kind(
            "actuator", EVERY, "an actuator that stays until the command is far, then jumps"
        ),
        "power_limit": Kind("actuator", MECHANICAL, "a supply that gives only so much power"),
        "eccentric_wheel": Kind("twist", VEHICLE, "one of two wheels runs out of true"),
        "tyre_relaxation": Kind("twist", VEHICLE, "the turn rate follows over a way, not over a time"),
        "loose_marker": Kind("sensor", EVERY, "a marker on a springy stalk that sways"),
    },
    forces={"shear_thinning": shear_thinning},
    hidden={"thixotropic_grease": Grease(), "loose_load": LooseLoad(), "centrifugal_governor": Governor()},
    coupled={"tip_sail": tip_sail},
    actuators={"sticky_valve": StickyValve, "power_limit": PowerLimit},
    hidden_twist={"eccentric_wheel": EccentricWheel(), "tyre_relaxation": TyreRelaxation()},
    recalled={"loose_marker": loose_marker},
)
