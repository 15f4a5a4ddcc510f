"""The systems of the trials: channels, base parameters, equations of motion, and how large things are in a world.

The equations are written as inverse mass matrix times generalised force, solved by Cramer's rule; the simulators that
will be diagnosed are written differently, on purpose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds.world import Run, World

Parameters = Mapping[str, float | FloatArray]


@dataclass(frozen=True)
class System:
    """One system. parameters: name -> range of the base's value; steps: possible dt [s]; sensors: a decent one's noise.

    coordinates: the position channels, each followed by its velocity; empty for a vehicle. rates: what integration
    turns into the next state.
    """

    name: str
    state: Mapping[str, str]
    action: Mapping[str, str]
    coordinates: tuple[str, ...]
    rates: tuple[str, ...]
    parameters: Mapping[str, tuple[float, float]]
    steps: tuple[float, ...]
    sensors: Mapping[str, float]

    @property
    def vehicle(self) -> bool:
        """Whether it moves in the plane and only its pose is measured."""
        return not self.coordinates

    @property
    def names(self) -> tuple[str, ...]:
        """State channels in column order."""
        return tuple(self.state)


SYSTEMS: Mapping[str, System] = {
    "cartpole": System(
        "cartpole",
        {"x": "m", "x_dot": "m/s", "theta": "rad", "theta_dot": "rad/s"},
        {"force": "N"},
        ("x", "theta"),
        ("x_acc", "theta_acc"),
        {
            "gravity": (9.8, 9.81),
            "cart_mass": (0.7, 1.5),
            "pole_mass": (0.1, 0.3),
            "pole_half_length": (0.3, 0.6),
        },
        (0.02, 0.02, 0.01),
        {"x": 0.0005, "x_dot": 0.005, "theta": 0.001, "theta_dot": 0.01},
    ),
    "slider": System(
        "slider",
        {"q": "m", "q_dot": "m/s"},
        {"force": "N"},
        ("q",),
        ("q_acc",),
        {"mass": (1.0, 4.0)},
        (0.02, 0.01),
        {"q": 0.0005, "q_dot": 0.005},
    ),
    "pendulum": System(
        "pendulum",
        {"theta": "rad", "theta_dot": "rad/s"},
        {"torque": "N m"},
        ("theta",),
        ("theta_acc",),
        {"gravity": (9.8, 9.81), "mass": (0.5, 1.5), "length": (0.3, 0.7)},
        (0.02, 0.02, 0.05),
        {"theta": 0.001, "theta_dot": 0.01},
    ),
    "unicycle": System(
        "unicycle",
        {"x": "m", "y": "m", "yaw": "rad"},
        {"v_cmd": "m/s", "w_cmd": "rad/s"},
        (),
        ("v", "v_lateral", "w"),
        {},
        (0.1, 0.02),
        {"x": 0.002, "y": 0.002, "yaw": 0.004},
    ),
}


def dynamics(system: str, p: Parameters, s: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Inverse mass matrix (B, C, C) and generalised forces (B, C) of state s (B, S) under the action u (B, A)."""
    if system == "slider":
        return np.broadcast_to(1.0 / np.asarray(p["mass"]), (len(s),)).reshape(-1, 1, 1), u.copy()
    if system == "pendulum":
        weight = p["mass"] * p["length"]
        inverse = np.broadcast_to(1.0 / np.asarray(weight * p["length"]), (len(s),)).reshape(-1, 1, 1)
        return inverse, (u[:, 0] - weight * p["gravity"] * np.sin(s[:, 0]))[:, None]
    lever = p["pole_mass"] * p["pole_half_length"]
    sin, cos = np.sin(s[:, 2]), np.cos(s[:, 2])
    across = lever * cos
    # A uniform rod of length 2 l about its end: m l^2 + m (2 l)^2 / 12.
    turning = lever * p["pole_half_length"] * (1.0 + 1.0 / 3.0)
    total = p["cart_mass"] + p["pole_mass"]
    determinant = total * turning - across**2
    inverse = np.empty((len(s), 2, 2))
    inverse[:, 0, 0], inverse[:, 1, 1] = turning / determinant, total / determinant
    inverse[:, 0, 1] = inverse[:, 1, 0] = -across / determinant
    forces = np.empty((len(s), 2))
    forces[:, 0] = u[:, 0] + lever * s[:, 3] ** 2 * sin
    forces[:, 1] = lever * p["gravity"] * sin
    return inverse, forces


def load_on_track(p: Parameters, s: FloatArray, acceleration: FloatArray) -> FloatArray:
    """(B,) N: the track's force on the cart, from the vertical acceleration of the pole's centre of mass."""
    half, m = p["pole_half_length"], p["pole_mass"]
    rise = -half * (acceleration[:, 1] * np.sin(s[:, 2]) + s[:, 3] ** 2 * np.cos(s[:, 2]))
    return np.asarray(p["cart_mass"] * p["gravity"] + m * (p["gravity"] + rise))


LEVELS = ("subtle", "medium", "plain")
Rng = np.random.Generator


@dataclass(frozen=True)
class Dial:
    """Draws numbers whose size follows one strength in [0, 1]."""

    rng: Rng
    strength: float

    @property
    def level(self) -> str:
        """The strength in words."""
        return LEVELS[min(int(3 * self.strength), 2)]

    def size(self, low: float, high: float) -> float:
        """Between low (subtle) and high (plain), evenly in the logarithm."""
        return float(rounded(low * (high / low) ** self.strength))

    def any(self, low: float, high: float) -> float:
        """Between low and high whatever the strength."""
        return float(rounded(self.rng.uniform(low, high)))

    def sign(self) -> float:
        """-1 or 1."""
        return 1.0 if self.rng.random() < 0.5 else -1.0

    def ratio(self, low: float, high: float) -> float:
        """A factor above or below 1, off by between low and high."""
        off = self.size(low, high)
        return float(rounded(1.0 + off if self.rng.random() < 0.5 else 1.0 - off))


@dataclass(frozen=True)
class Scales:
    """How large things are in a run of the base system under the world's excitation."""

    world: World
    pilot: Run

    @cached_property
    def _columns(self) -> FloatArray:
        states = self.pilot.clean[:-1]
        return states.reshape(-1, states.shape[2])

    def column(self, name: str) -> FloatArray:
        """(N,) all values of a state channel."""
        return np.asarray(self._columns[:, SYSTEMS[self.world.system].names.index(name)])

    def reach(self, name: str) -> float:
        """Standard deviation of a channel; of a vehicle's positions, which wander, that of all episodes together."""
        return float(np.std(self.column(name)))

    def speed(self, coordinate: str) -> float:
        """Root mean square velocity of a coordinate."""
        names = SYSTEMS[self.world.system].names
        return float(np.sqrt(np.mean(self.column(names[names.index(coordinate) + 1]) ** 2)))

    def force(self, coordinate: str) -> float:
        """Root mean square of the generalised force that would move the coordinate alone as it moved."""
        system = SYSTEMS[self.world.system]
        actions = self.pilot.commands.reshape(-1, len(system.action))
        inverse, force = dynamics(system.name, self.world.parameters, self._columns, actions)
        acceleration = (inverse * force[:, None, :]).sum(axis=2)
        c = system.coordinates.index(coordinate)
        return float(np.sqrt(np.mean((acceleration[:, c] / inverse[:, c, c]) ** 2)))

    def inertia(self, coordinate: str) -> float:
        """What a force on a coordinate alone has to move; of a cart-pole with the pole up, where that is least."""
        system = SYSTEMS[self.world.system]
        rest = np.zeros((1, len(system.state)))
        inverse, _ = dynamics(system.name, self.world.parameters, rest, np.zeros((1, 1)))
        c = system.coordinates.index(coordinate)
        return 1.0 / float(inverse[0, c, c])

    def action(self, name: str) -> float:
        """What 95 % of the commands stay below."""
        column = list(SYSTEMS[self.world.system].action).index(name)
        return float(np.quantile(np.abs(self.pilot.commands[..., column]), 0.95))

    @property
    def duration(self) -> float:
        """The last moment [s] of the recording's clock."""
        return float(self.world.clock_offsets[-1] + self.world.steps * self.world.dt)

    @property
    def wall(self) -> float:
        """All episodes together [s]."""
        return float(self.world.offsets[-1] + self.world.steps * self.world.dt)


def rounded(value: float) -> float:
    """Four significant digits, so that the answers can be read."""
    return float(f"{value:.4g}")


def waves(s: Scales, on: str, d: Dial, low: float, high: float) -> dict[str, float]:
    """A wave number with `low` to `high` periods over two standard deviations either side, and a phase."""
    return {
        "wave_number": rounded(2 * np.pi * d.any(low, high) / (4 * s.reach(on))),
        "phase": d.any(0, 2 * np.pi),
    }
