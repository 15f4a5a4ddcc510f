"""How strong the kinds of `kinds_2028.py` are; as in `strengths.py`, in proportion to what the system does."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.trials.catalogue.strengths import Dial, Draw, Scales, rounded, waves
from gpsim.trials.worlds.systems import SYSTEMS


def _rubber(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """It forgets within about the time in which the body crosses its range."""
    return {
        "stiffness": rounded(d.size(0.15, 1.0) * s.force(on) / s.reach(on)),
        "time": rounded(d.any(0.4, 1.2) * s.reach(on) / s.speed(on)),
    }


def _worm(s: Scales, on: str, d: Dial) -> dict[str, float]:
    driven = SYSTEMS[s.world.system].coordinates[0]
    return {"friction": d.size(0.08, 0.45), "speed": rounded(0.1 * s.speed(driven))}


def _lost(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Outages of two to five samples."""
    outage = rounded(round(d.any(1.5, 5.49)) * s.world.dt)
    return {"share": d.size(0.06, 0.35), "outage": outage, "phase": d.any(0, 6.28)}


def _hot(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Warm after a part of an episode."""
    return {
        "loss": d.size(0.12, 0.6),
        "rated": rounded(s.action(on)),
        "time": rounded(d.any(0.15, 0.5) * s.world.steps * s.world.dt),
    }


def _wheels(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """A limit that part of the commanded curves exceed with their outer wheel."""
    half = d.any(0.12, 0.3)
    v, w = s.pilot.commands[..., 0].ravel(), s.pilot.commands[..., 1].ravel()
    most = float(np.quantile(np.abs(v) + half * np.abs(w), 0.95))
    return {"half_track": half, "limit": rounded((1.0 - d.size(0.08, 0.4)) * most)}


def _fisheye(s: Scales, on: str, d: Dial) -> dict[str, float]:
    far = float(np.sqrt(np.mean(s.column("x") ** 2 + s.column("y") ** 2)))
    return {"height": rounded(far / np.sqrt(d.size(0.04, 0.4)))}


STRENGTHS: Mapping[str, Draw] = {
    "eddy_brake": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)), "speed": rounded(d.any(0.3, 0.7) * s.speed(on))
    },
    "rubber_buffer": _rubber,
    "uneven_inertia": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.5) * s.inertia(on)), **waves(s, on, d, 1, 3)
    },
    "worm_gear": _worm,
    "lost_commands": _lost,
    "hot_motor": _hot,
    "wheel_speed_limit": _wheels,
    "towed_trolley": lambda s, on, d: {"length": d.any(0.2, 0.6), "pull": d.size(0.08, 0.6)},
    "slow_sensor": lambda s, on, d: {"period": rounded(d.size(1.3, 5.0) * s.world.dt)},
    "fisheye_camera": _fisheye,
}  # fmt: skip
