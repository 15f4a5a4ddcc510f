"""How strong the kinds of `kinds_2029.py` are; as in `strengths.py`, in proportion to what the system does."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.trials.catalogue.strengths import Dial, Draw, Scales, rounded
from gpsim.trials.worlds.systems import SYSTEMS


def _thinning(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Thin already at a part of the typical speed; the strength is its resistance at that speed."""
    slow, exponent = d.any(0.05, 0.2), d.any(0.2, 0.5)
    thinned = (1.0 + slow**-2) ** ((exponent - 1.0) / 2.0)
    return {
        "damping": rounded(d.size(0.1, 0.6) * s.force(on) / (s.speed(on) * thinned)),
        "speed": rounded(slow * s.speed(on)),
        "exponent": exponent,
    }


def _grease(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """It gels in about the time in which the body crosses its range, and breaks down in a part of that range."""
    return {
        "damping": rounded(d.size(0.2, 1.6) * s.force(on) / s.speed(on)),
        "time": rounded(d.any(0.5, 1.5) * s.reach(on) / s.speed(on)),
        "way": rounded(d.any(0.2, 0.6) * s.reach(on)),
    }


def _load(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Buffers that throw the load back within a few samples, and take part of its energy."""
    inertia, turn = d.size(0.15, 0.8) * s.inertia(on), 2 * np.pi * d.any(2.5, 5.0)
    return {
        "inertia": rounded(inertia),
        "gap": rounded(d.any(0.05, 0.25) * s.reach(on)),
        "stiffness": rounded(inertia * turn**2),
        "loss": rounded(d.any(0.2, 0.8) / s.speed(on)),
    }


def _governor(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Springs that the weights outrun only when the body is much faster than it is as a rule."""
    return {
        "inertia": rounded(d.size(0.08, 0.6) * s.inertia(on)),
        "turn": rounded(d.any(1.5, 3.0) * s.speed(on)),
        "damping_ratio": d.any(0.2, 0.6),
    }


def _sail(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Its pull on the pole in proportion to what moves the pole."""
    length = 2 * s.world.parameters["pole_half_length"]
    turn, x_rate = length * s.column("theta_dot"), s.column("x_dot")
    square = x_rate**2 + turn**2 + 2 * x_rate * turn * np.cos(s.column("theta"))
    pull = float(np.sqrt(np.mean(square**2)))
    return {"drag": rounded(d.size(0.1, 0.7) * s.force("theta") / (length * pull)), "length": rounded(length)}


def _power(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """A limit that the stronger part of what drives the body exceeds."""
    names = SYSTEMS[s.world.system].names
    power = s.pilot.commands[..., 0].ravel() * s.column(names[1])
    return {"power": rounded((1.0 - d.size(0.3, 0.9)) * float(np.quantile(power[power > 0], 0.9)))}


def _marker(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """The slower it sways the more; a vehicle, which is slower, carries a longer stalk."""
    period = d.size(0.1, 0.5) * (4.0 if SYSTEMS[s.world.system].vehicle else 1.0)
    return {"frequency": rounded(1.0 / period), "damping_ratio": d.any(0.1, 0.3)}


STRENGTHS: Mapping[str, Draw] = {
    "shear_thinning": _thinning,
    "thixotropic_grease": _grease,
    "loose_load": _load,
    "centrifugal_governor": _governor,
    "tip_sail": _sail,
    "sticky_valve": lambda s, on, d: {"band": rounded(d.size(0.12, 0.7) * s.action(on))},
    "power_limit": _power,
    "eccentric_wheel": lambda s, on, d: {
        "depth": d.size(0.03, 0.3), "half_track": d.any(0.1, 0.25), "radius": d.any(0.05, 0.12)
    },
    "tyre_relaxation": lambda s, on, d: {"length": d.size(0.02, 0.4)},
    "loose_marker": _marker,
}  # fmt: skip
