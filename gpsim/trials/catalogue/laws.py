"""The catalogue's laws as the truth has them, written anew and never shared with `gpsim.effects`.

q, v: (B,) a coordinate's position and velocity; k: the effect's values; all results (B,).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import Values

SMOOTH: Mapping[str, Callable[[Values, FloatArray, FloatArray], FloatArray]] = {
    "viscous_friction": lambda k, q, v: -k["damping"] * v,
    "quadratic_drag": lambda k, q, v: -k["drag"] * np.abs(v) * v,
    "spring": lambda k, q, v: -k["stiffness"] * (q - k["rest_position"]),
    "constant_force": lambda k, q, v: np.full_like(q, k["force"]),
}
"""Forces that are functions of position and velocity."""


def _stribeck(k: Values, v: FloatArray, load: FloatArray) -> FloatArray:
    rise = (k["static_force"] - k["force"]) * np.exp(-((v / k["stribeck_velocity"]) ** 2))
    return k["force"] + rise


def _coulomb(k: Values, v: FloatArray, load: FloatArray) -> FloatArray:
    if "coefficient" in k:
        return k["coefficient"] * np.maximum(load, 0.0)
    return np.full_like(v, k["force"])


GRIP: Mapping[str, Callable[[Values, FloatArray, FloatArray], FloatArray]] = {
    "coulomb_friction": _coulomb,
    "stribeck_friction": _stribeck,
    "local_friction_patch": lambda k, v, load: np.full_like(v, k["force"]),
}
"""Dry friction: the most it can resist with; it opposes motion and holds a body at rest."""


def _turning_radius(
    k: Values, v: FloatArray, lateral: FloatArray, w: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    most = np.abs(v) / k["radius"]
    return v, lateral, np.maximum(np.minimum(w, most), -most)


TWIST: Mapping[
    str,
    Callable[[Values, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]],
] = {
    "minimum_turning_radius": _turning_radius,
    "understeer": lambda k, v, lateral, w: (v, lateral, w / (1.0 + k["gradient"] * v * v)),
    "steering_bias": lambda k, v, lateral, w: (v, lateral, w + k["curvature"] * v),
    "lateral_slip": lambda k, v, lateral, w: (v, lateral - k["slip"] * v * w, w),
}
"""What becomes of a vehicle's twist; several act in this order."""
