"""How strong an effect of the catalogue is: drawn from subtle to plain, in proportion to what the system does."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from gpsim.trials.worlds import SYSTEMS, Dial, Scales, rounded

Draw = Callable[["Scales", str, "Dial"], dict[str, float]]
"""draw(scales, on, dial) -> parameters."""


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


STRENGTHS: Mapping[str, Draw] = {
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
