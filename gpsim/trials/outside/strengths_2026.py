"""How strong the kinds of `kinds_2026.py` are; as in `strengths.py`, in proportion to what the system does."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.trials.catalogue.strengths import Dial, Draw, Scales, rounded, waves


def _coupling(s: Scales, on: str, d: Dial) -> dict[str, float]:
    inertia, turn = d.size(0.2, 0.8) * s.inertia(on), 2 * np.pi * d.any(1.5, 4.0)
    return {
        "inertia": rounded(inertia),
        "stiffness": rounded(inertia * turn**2),
        "damping": rounded(2 * d.any(0.02, 0.15) * inertia * turn),
    }


def _detent(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {
        "amplitude": rounded(d.size(0.3, 1.2) * s.force(on)),
        "centre": rounded(float(np.mean(s.column(on))) + d.any(-0.5, 0.5) * s.reach(on)),
        "reach": rounded(d.any(0.2, 0.4) * s.reach(on)),
    }


def _stop(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {
        "edge": rounded(float(np.quantile(s.column(on), 0.75))),
        "stiffness": rounded(d.size(0.4, 4.0) * s.force(on) / s.reach(on) ** 1.5),
        "loss": rounded(0.6 / s.speed(on)),
    }


def _pivot(s: Scales, on: str, d: Dial) -> dict[str, float]:
    p = s.world.parameters
    return {
        "lever": rounded(p["mass"] * p["length"]),
        "acceleration": rounded(d.size(0.1, 0.6) * p["gravity"]),
        "frequency": d.any(0.5, 3.0),
    }


def _carpet(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {
        "depth": d.size(0.15, 0.6),
        "x": rounded(float(np.median(s.column("x")))),
        "y": rounded(float(np.median(s.column("y")))),
        "radius": rounded(0.6 * min(s.reach("x"), s.reach("y"))),
    }


STRENGTHS: Mapping[str, Draw] = {
    "magnetic_detent": _detent,
    "flexible_coupling": _coupling,
    "gyroscopic": lambda s, on, d: {"coupling": rounded(d.size(0.1, 0.5) * s.force("theta") / s.speed("x"))},
    "fading_damping": lambda s, on, d: {
        "damping": rounded(d.size(0.08, 0.5) * s.force(on) / s.speed(on)), "time": rounded(0.3 * s.wall)
    },
    "soft_stop": _stop,
    "vibrating_pivot": _pivot,
    "speed_ripple": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.5) * s.force(on)), "speed": rounded(d.any(0.15, 0.3) * s.speed(on))
    },
    "ringing_actuator": lambda s, on, d: {
        "frequency": rounded(1.0 / (d.size(6.0, 20.0) * s.world.dt)), "damping_ratio": d.any(0.1, 0.3)
    },
    "eccentric_encoder": lambda s, on, d: {
        "amplitude": rounded(d.size(0.04, 0.2) * min(s.reach(on), 1.0)),
        **({"wave_number": 1.0, "phase": d.any(0, 6.28)} if on == "yaw" else waves(s, on, d, 2, 4)),
    },
    "carpet": _carpet,
}  # fmt: skip
