"""How strong everybody's kinds of physics outside the catalogue are; as in `strengths.py`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.trials.catalogue.strengths import Dial, Draw, Scales, rounded, waves
from gpsim.trials.worlds.systems import SYSTEMS


def _bouc_wen(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {
        "amplitude": rounded(d.size(0.15, 0.7) * s.force(on)),
        "width": rounded(d.any(0.2, 0.5) * s.reach(on)),
    }


def _aero(s: Scales, on: str, d: Dial) -> dict[str, float]:
    speed = 0.35 * s.speed(on)
    return {
        "amplitude": rounded(d.size(0.1, 0.5) * s.force(on) / np.expm1(1.5 / 0.35)),
        "speed": rounded(speed),
    }


STRENGTHS: Mapping[str, Draw] = {
    "cogging": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)), **waves(s, on, d, 4, 8)
    },
    "hardening_spring": lambda s, on, d: {"cubic": rounded(d.size(0.1, 0.6) * s.force(on) / s.reach(on) ** 3)},
    "fan": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)), "frequency": d.any(0.4, 2.5), "phase": d.any(0, 6.28)
    },
    "bouc_wen": _bouc_wen,
    "gusts": lambda s, on, d: {"amplitude": rounded(d.size(0.1, 0.5) * s.force(on)), "phase": d.any(0, 6.28)},
    "exponential_aero": _aero,
    "position_gain": lambda s, on, d: {
        "depth": d.size(0.12, 0.6), **waves(s, SYSTEMS[s.world.system].names[0], d, 1, 3)
    },
    "quantised_actuator": lambda s, on, d: {"step": rounded(d.size(0.25, 0.9) * s.action(on))},
    "curve_slowdown": lambda s, on, d: {"loss": d.size(0.04, 0.3)},
    "heading_slope": lambda s, on, d: {"amplitude": d.size(0.02, 0.2), "phase": d.any(0, 6.28)},
}  # fmt: skip
