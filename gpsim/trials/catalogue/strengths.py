"""How strong a concealed effect is: parameters drawn from subtle to plain, in proportion to what the system does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.truth.running import Run
from gpsim.trials.worlds.systems import SYSTEMS, dynamics
from gpsim.trials.worlds.world import World

LEVELS = ("subtle", "medium", "plain")
Rng = np.random.Generator
Draw = Callable[["Scales", str, "Dial"], dict[str, float]]
"""draw(scales, on, dial) -> parameters."""


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


def _milliseconds(value: float) -> float:
    return max(round(value, 3), 0.001)


def _stribeck(s: Scales, on: str, d: Dial) -> dict[str, float]:
    sliding = d.size(0.05, 0.3) * s.force(on)
    speed = d.any(0.1, 0.4) * s.speed(on)
    return {
        "force": rounded(sliding),
        "static_force": rounded(sliding * d.any(1.5, 2.5)),
        "stribeck_velocity": rounded(speed),
    }


def _coulomb(s: Scales, on: str, d: Dial) -> dict[str, float]:
    force = d.size(0.05, 0.5) * s.force(on)
    if s.world.system == "cartpole" and on == "x" and s.world.engine == "rk4" and d.rng.random() < 0.5:
        p = s.world.parameters
        return {"coefficient": rounded(force / ((p["cart_mass"] + p["pole_mass"]) * p["gravity"]))}
    return {"force": rounded(force)}


def _parameter(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {"ratio": d.ratio(0.1, 0.5) if on == "pole_mass" else d.ratio(0.04, 0.3)}


def _asymmetry(s: Scales, on: str, d: Dial) -> dict[str, float]:
    off, sign = d.size(0.04, 0.25), d.sign()
    return {
        "gain_positive": rounded(1.0 + sign * off),
        "gain_negative": rounded(1.0 - sign * off * d.any(0.3, 1.0)),
    }


def _sensor_bias(s: Scales, on: str, d: Dial) -> dict[str, float]:
    unit = SYSTEMS[s.world.system].state[on]
    size = d.size(0.02, 0.12) if unit in ("rad", "m") else d.size(0.05, 0.5) * s.reach(on)
    return {"offset": rounded(d.sign() * size)}


def _radius(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """So that a tenth (subtle) to a half (plain) of the commanded curves are too tight."""
    v, w = s.pilot.commands[..., 0].ravel(), np.abs(s.pilot.commands[..., 1].ravel())
    return {"radius": rounded(float(np.quantile(np.abs(v) / np.maximum(w, 1e-3), d.size(0.1, 0.5))))}


CATALOGUE: Mapping[str, Draw] = {
    "coulomb_friction": _coulomb,
    "viscous_friction": lambda s, on, d: {"damping": rounded(d.size(0.05, 0.5) * s.force(on) / s.speed(on))},
    "quadratic_drag": lambda s, on, d: {"drag": rounded(d.size(0.05, 0.4) * s.force(on) / s.speed(on) ** 2)},
    "stribeck_friction": _stribeck,
    "spring": lambda s, on, d: {
        "stiffness": rounded(d.size(0.05, 0.5) * s.force(on) / s.reach(on)),
        "rest_position": rounded(float(np.mean(s.column(on))) + d.any(-0.8, 0.8) * s.reach(on)),
    },
    "constant_force": lambda s, on, d: {"force": rounded(d.sign() * d.size(0.05, 0.4) * s.force(on))},
    "local_friction_patch": lambda s, on, d: {"force": rounded(d.size(0.15, 0.8) * s.force(on))},
    "parameter_offset": _parameter,
    "actuator_gain": lambda s, on, d: {"gain": d.ratio(0.04, 0.3)},
    "actuator_bias": lambda s, on, d: {"bias": rounded(d.sign() * d.size(0.03, 0.3) * s.action(on))},
    "actuator_dead_zone": lambda s, on, d: {"width": rounded(d.size(0.08, 0.4) * s.action(on))},
    "actuator_saturation": lambda s, on, d: {"limit": rounded((1.0 - d.size(0.12, 0.6)) * s.action(on))},
    "actuator_asymmetry": _asymmetry,
    "actuator_delay": lambda s, on, d: {"delay": _milliseconds(d.size(0.5, 5.0) * s.world.dt)},
    "actuator_lag": lambda s, on, d: {"time_constant": rounded(d.size(0.5, 6.0) * s.world.dt)},
    "actuator_rate_limit": lambda s, on, d: {"rate": rounded(s.action(on) / (d.size(0.8, 8.0) * s.world.dt))},
    "actuator_backlash": lambda s, on, d: {"half_width": rounded(d.size(0.03, 0.3) * s.action(on))},
    "battery_sag": lambda s, on, d: {"loss_per_second": rounded(d.size(0.1, 0.6) / s.duration)},
    "minimum_turning_radius": _radius,
    "understeer": lambda s, on, d: {"gradient": rounded(d.size(0.05, 0.8) / s.action("v_cmd") ** 2)},
    "steering_bias": lambda s, on, d: {"curvature": rounded(d.sign() * d.size(0.02, 0.4))},
    "lateral_slip": lambda s, on, d: {"slip": d.size(0.02, 0.3)},
    "sensor_bias": _sensor_bias,
    "sensor_scale": lambda s, on, d: {"scale": d.ratio(0.03, 0.2)},
    "sensor_delay": lambda s, on, d: {"delay": _milliseconds(d.size(0.5, 4.0) * s.world.dt)},
    "marker_offset": lambda s, on, d: {
        "forward": rounded(d.sign() * d.size(0.02, 0.2)),
        "left": rounded(d.sign() * d.size(0.01, 0.1)),
    },
    "frame_rotation": lambda s, on, d: {"angle": rounded(d.sign() * d.size(0.02, 0.25))},
}
"""Every family of the catalogue."""
