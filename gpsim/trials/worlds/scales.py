"""How large things are in a world, and a dial of strength: what parameters of concealed effects are drawn with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds.systems import SYSTEMS, dynamics
from gpsim.trials.worlds.world import Run, World

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
