"""How strong the kinds of `kinds_2030.py` are; as in `strengths.py`, in proportion to what the system does."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.trials.catalogue.strengths import Dial, Draw, Scales, rounded
from gpsim.trials.outside.kinds_2030 import tip_tether
from gpsim.trials.worlds.systems import SYSTEMS


def _cable(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Anchored within the range, so that it goes slack on the way."""
    return {
        "drag": rounded(d.size(0.08, 0.5) * s.force(on) / s.reach(on)),
        "anchor": rounded(float(np.mean(s.column(on))) + d.any(-0.8, 0.8) * s.reach(on)),
        "speed": rounded(d.any(0.05, 0.15) * s.speed(on)),
    }


def _flywheel(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """As heavy as the body or less, behind a clutch that slips whenever the body is accelerated as a rule."""
    inertia = d.any(0.4, 1.0) * s.inertia(on)
    return {
        "grip": rounded(d.size(0.05, 0.4) * s.force(on)),
        "inertia": rounded(inertia),
        "speed": rounded(d.any(0.05, 0.15) * s.speed(on)),
    }


def _tank(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Most of it is gone when the episode ends."""
    return {
        "inertia": rounded(d.size(0.08, 0.6) * s.inertia(on)),
        "time": rounded(d.any(0.2, 0.5) * s.world.steps * s.world.dt),
    }


def _tether(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Its pull on the pole in proportion to what moves the pole."""
    length = 2 * s.world.parameters["pole_half_length"]
    unit = {"stiffness": 1.0, "length": length, "rest": rounded(d.any(0.5, 0.9) * length)}
    states = np.stack([s.column(n) for n in SYSTEMS[s.world.system].names], axis=1)
    torque = float(np.sqrt(np.mean(tip_tether(unit, states)[:, 1] ** 2)))
    return {**unit, "stiffness": rounded(d.size(0.1, 0.7) * s.force("theta") / torque)}


def _valve(s: Scales, on: str, d: Dial) -> dict[str, float]:
    vent = d.size(1.0, 8.0) * s.world.dt
    return {"fill": rounded(d.any(0.1, 0.3) * vent), "vent": rounded(vent)}


def _hill(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Where the vehicle is most of the time."""
    return {
        "loss": rounded(d.size(0.1, 0.5) * s.action("v_cmd")),
        "x": rounded(float(np.median(s.column("x")))),
        "y": rounded(float(np.median(s.column("y")))),
        "radius": rounded(0.6 * min(s.reach("x"), s.reach("y"))),
    }


def _warming(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Warm before the episode ends; a vehicle's heading goes round, so that its range says nothing."""
    size = d.size(0.05, 0.4) * (1.0 if SYSTEMS[s.world.system].vehicle else s.reach(on))
    return {
        "offset": rounded(d.sign() * size),
        "time": rounded(d.any(0.1, 0.4) * s.world.steps * s.world.dt),
    }


STRENGTHS: Mapping[str, Draw] = {
    "one_way_damper": lambda s, on, d: {
        "damping": rounded(d.size(0.08, 0.7) * s.force(on) / s.speed(on)), "side": d.sign()
    },
    "dragged_cable": _cable,
    "slipping_flywheel": _flywheel,
    "leaking_tank": _tank,
    "tip_tether": _tether,
    "pneumatic_valve": _valve,
    "expo_curve": lambda s, on, d: {
        "softness": d.size(0.15, 0.7), "full": rounded(s.action(on))
    },
    "hill": _hill,
    "coarse_encoder": lambda s, on, d: {
        "step": rounded(d.size(0.03, 0.3) * min(s.reach(on), 1.0))
    },
    "warming_sensor": _warming,
}  # fmt: skip
