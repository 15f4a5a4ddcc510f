"""How strong an effect on a robot is: what the catalogue draws, and what only models of bodies know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue
from gpsim.trials.robots.models import layout_of, mujoco, spec_of
from gpsim.trials.worlds import Dial, Scales, rounded

Draw = Callable[[Scales, str, Dial], dict[str, float]]
"""draw(scales, on, dial) -> parameters."""


@dataclass(frozen=True)
class RobotScales(Scales):
    """How large things are in a run of the robot as it is believed."""

    @cached_property
    def model(self) -> Any:
        """The model as published."""
        return spec_of(self.world.system).compile()

    def column(self, name: str) -> FloatArray:
        """(N,) all values of a state channel."""
        return np.asarray(self._columns[:, self._index(name)])

    def speed(self, coordinate: str) -> float:
        """Root mean square velocity of a joint."""
        return float(np.sqrt(np.mean(self._columns[:, self._index(coordinate) + 1] ** 2)))

    def force(self, coordinate: str) -> float:
        """Root mean square of the force that would move the joint alone as it moved."""
        speeds = self.pilot.fine[:: self.pilot.per_sample, :, self._index(coordinate) + 1]
        acceleration = np.diff(speeds, axis=0) / self.world.dt
        return self.inertia(coordinate) * float(np.sqrt(np.mean(acceleration**2)))

    def inertia(self, coordinate: str) -> float:
        """What a force on a joint alone has to move, the others free, where the robot began."""
        model, mj = self.model, mujoco()
        data, c = mj.MjData(model), layout_of(self.world.system).joints.index(coordinate)
        data.qpos[:] = self.pilot.fine[0, 0, 0::2]
        mj.mj_forward(model, data)
        pushed, column = np.eye(model.nv)[c : c + 1], np.zeros((1, model.nv))
        mj.mj_solveM(model, data, column, pushed)
        return float(1.0 / column[0, c])

    def action(self, name: str) -> float:
        """What 95 % of the commands stay below."""
        column = list(layout_of(self.world.system).action).index(name)
        return float(np.quantile(np.abs(self.pilot.commands[..., column]), 0.95))

    def _index(self, name: str) -> int:
        return layout_of(self.world.system).names.index(name)


def _payload(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """A twentieth to half of what carries it, within its reach of the carrier's centre of mass."""
    model = _model(s)
    b = model.body(on).id
    mass, centre = float(model.body_mass[b]), np.asarray(model.body_ipos[b])
    size = float(np.sqrt(model.body_inertia[b].max() / mass))
    at = centre + size * np.array([d.any(-0.7, 0.7) for _ in range(3)])
    return {
        "mass": rounded(d.size(0.08, 0.6) * mass),
        **{a: rounded(float(x)) for a, x in zip("xyz", at, strict=True)},
    }


def _armature(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {"inertia": rounded(d.size(0.08, 0.8) * s.inertia(on))}


def _tilt(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {axis: rounded(d.sign() * d.size(0.02, 0.15) * d.any(0.7, 1.3)) for axis in ("roll", "pitch")}


def _parameter(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {"ratio": d.ratio(0.08, 0.4) if on.endswith(".mass") else d.ratio(0.05, 0.35)}


def _zero(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {"offset": rounded(d.sign() * d.size(0.02, 0.12))}


def _in_fine_steps(draw: Draw) -> Draw:
    """A delay is a whole number of the truth's steps."""

    def drawn(s: Scales, on: str, d: Dial) -> dict[str, float]:
        h = s.pilot.h
        return {k: round(max(round(v / h), 1) * h, 9) for k, v in draw(s, on, d).items()}

    return drawn


def _model(s: Scales) -> Any:
    assert isinstance(s, RobotScales)
    return s.model


AS_EVERYWHERE = (
    "coulomb_friction", "viscous_friction", "quadratic_drag", "stribeck_friction", "spring", "constant_force",
    "actuator_gain", "actuator_bias", "actuator_dead_zone", "actuator_saturation", "actuator_asymmetry", "actuator_lag",
    "actuator_backlash",
)  # fmt: skip
STRENGTHS: Mapping[str, Draw] = {
    **{family: catalogue.STRENGTHS[family] for family in AS_EVERYWHERE},
    "actuator_delay": _in_fine_steps(catalogue.STRENGTHS["actuator_delay"]),
    "sensor_delay": _in_fine_steps(catalogue.STRENGTHS["sensor_delay"]),
    "sensor_bias": _zero,
    "joint_offset": _zero,
    "payload": _payload,
    "armature": _armature,
    "gravity_tilt": _tilt,
    "parameter_offset": _parameter,
}
"""Every family that robots are given."""
