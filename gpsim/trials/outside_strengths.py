"""How strong physics outside the catalogue is; as in `strengths.py`, in proportion to what the system does."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.trials.strengths import Dial, Draw, Scales, rounded
from gpsim.trials.systems import SYSTEMS, dynamics


def _waves(s: Scales, on: str, d: Dial, low: float, high: float) -> dict[str, float]:
    """A wave number with `low` to `high` periods over two standard deviations either side, and a phase."""
    return {
        "wave_number": rounded(2 * np.pi * d.any(low, high) / (4 * s.reach(on))),
        "phase": d.any(0, 2 * np.pi),
    }


def _bouc_wen(s: Scales, on: str, d: Dial) -> dict[str, float]:
    return {
        "amplitude": rounded(d.size(0.15, 0.7) * s.force(on)),
        "width": rounded(d.any(0.2, 0.5) * s.reach(on)),
    }


def _own_inertia(s: Scales, on: str) -> float:
    """What a force on a coordinate alone has to move; of a cart-pole with the pole up, where that is least."""
    system = SYSTEMS[s.world.system]
    inverse, _ = dynamics(system.name, s.world.parameters, np.zeros((1, len(system.state))), np.zeros((1, 1)))
    return 1.0 / float(inverse[0, system.coordinates.index(on), system.coordinates.index(on)])


def _coupling(s: Scales, on: str, d: Dial) -> dict[str, float]:
    inertia, turn = d.size(0.2, 0.8) * _own_inertia(s, on), 2 * np.pi * d.any(1.5, 4.0)
    return {
        "inertia": rounded(inertia),
        "stiffness": rounded(inertia * turn**2),
        "damping": rounded(2 * d.any(0.02, 0.15) * inertia * turn),
    }


def _aero(s: Scales, on: str, d: Dial) -> dict[str, float]:
    speed = 0.35 * s.speed(on)
    return {
        "amplitude": rounded(d.size(0.1, 0.5) * s.force(on) / np.expm1(1.5 / 0.35)),
        "speed": rounded(speed),
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


OUTSIDE: Mapping[str, Draw] = {
    "cogging": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)), **_waves(s, on, d, 4, 8)
    },
    "hardening_spring": lambda s, on, d: {"cubic": rounded(d.size(0.1, 0.6) * s.force(on) / s.reach(on) ** 3)},
    "fan": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)), "frequency": d.any(0.4, 2.5), "phase": d.any(0, 6.28)
    },
    "bouc_wen": _bouc_wen,
    "gusts": lambda s, on, d: {"amplitude": rounded(d.size(0.1, 0.5) * s.force(on)), "phase": d.any(0, 6.28)},
    "exponential_aero": _aero,
    "position_gain": lambda s, on, d: {
        "depth": d.size(0.12, 0.6), **_waves(s, SYSTEMS[s.world.system].names[0], d, 1, 3)
    },
    "quantised_actuator": lambda s, on, d: {"step": rounded(d.size(0.25, 0.9) * s.action(on))},
    "curve_slowdown": lambda s, on, d: {"loss": d.size(0.04, 0.3)},
    "heading_slope": lambda s, on, d: {"amplitude": d.size(0.02, 0.2), "phase": d.any(0, 6.28)},
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
        **({"wave_number": 1.0, "phase": d.any(0, 6.28)} if on == "yaw" else _waves(s, on, d, 2, 4)),
    },
    "carpet": _carpet,
    "eddy_brake": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.6) * s.force(on)), "speed": rounded(d.any(0.3, 0.7) * s.speed(on))
    },
    "rubber_buffer": _rubber,
    "uneven_inertia": lambda s, on, d: {
        "amplitude": rounded(d.size(0.1, 0.5) * _own_inertia(s, on)), **_waves(s, on, d, 1, 3)
    },
    "worm_gear": _worm,
    "lost_commands": _lost,
    "hot_motor": _hot,
    "wheel_speed_limit": _wheels,
    "towed_trolley": lambda s, on, d: {"length": d.any(0.2, 0.6), "pull": d.size(0.08, 0.6)},
    "slow_sensor": lambda s, on, d: {"period": rounded(d.size(1.3, 5.0) * s.world.dt)},
    "fisheye_camera": _fisheye,
}  # fmt: skip
"""Every kind outside it."""
