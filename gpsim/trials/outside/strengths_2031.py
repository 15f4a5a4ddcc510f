"""How strong the kinds of `kinds_2031.py` are; as in `strengths.py`, in proportion to what the system does."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.trials.catalogue.strengths import Dial, Draw, Scales, rounded
from gpsim.trials.outside.kinds_2031 import toggle_spring
from gpsim.trials.worlds.systems import SYSTEMS


def _belt(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """It runs no faster than the body does as a rule, so that this moves to either side of it."""
    return {
        "force": rounded(d.size(0.08, 0.5) * s.force(on)),
        "belt": rounded(d.sign() * d.any(0.3, 0.8) * s.speed(on)),
        "speed": rounded(d.any(0.05, 0.15) * s.speed(on)),
    }


def _toggle(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """It snaps within the range; its typical force in proportion to what moves the body."""
    aside = d.any(0.2, 0.5) * s.reach(on)
    unit = {
        "stiffness": 1.0,
        "centre": rounded(float(np.mean(s.column(on))) + d.any(-0.5, 0.5) * s.reach(on)),
        "aside": rounded(aside),
        "rest": rounded(d.any(1.5, 3.0) * aside),
    }
    q = s.column(on)
    typical = float(np.sqrt(np.mean(toggle_spring(unit, q, q, q) ** 2)))
    return {**unit, "stiffness": rounded(d.size(0.1, 0.6) * s.force(on) / typical)}


def _chain(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Some of it is drawn out most of the time."""
    return {
        "density": rounded(d.size(0.1, 0.8) * s.inertia(on) / s.reach(on)),
        "edge": rounded(float(np.quantile(s.column(on), d.any(0.1, 0.4)))),
    }


def _sledge(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """Lighter than the body, on a rope that jerks it along within a few samples."""
    inertia, turn = d.any(0.1, 0.3) * s.inertia(on), 2 * np.pi * d.any(2.5, 5.0)
    return {
        "friction": rounded(d.size(0.1, 0.6) * s.force(on)),
        "slack": rounded(d.any(0.2, 0.5) * s.reach(on)),
        "inertia": rounded(inertia),
        "stiffness": rounded(inertia * turn**2),
        "speed": rounded(d.any(0.05, 0.15) * s.speed(on)),
    }


def _axle(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """A radius that gives the pole about as large a share of what moves it as the cart."""
    force = s.force("x")
    return {
        "force": rounded(d.size(0.08, 0.5) * force),
        "radius": rounded(d.any(0.5, 1.2) * s.force("theta") / force),
        "speed": rounded(d.any(0.05, 0.15) * s.speed("x")),
    }


def _foldback(s: Scales, on: str, d: Dial) -> dict[str, float]:
    """The typical command heats it up to where it folds back, and that share of it lets it cool, again and again."""
    share = 1.0 - d.size(0.12, 0.6)
    column = list(SYSTEMS[s.world.system].action).index(on)
    typical = float(np.sqrt(np.mean(s.pilot.commands[..., column] ** 2)))
    hot, cool = 1.0 - 0.25 * (1.0 - share**2), 1.0 - 0.75 * (1.0 - share**2)  # between the two means of heat
    return {
        "share": rounded(share),
        "rated": rounded(typical * np.sqrt(hot)),
        "reset": rounded(cool / hot),
        "time": rounded(d.any(0.05, 0.12) * s.world.steps * s.world.dt),
    }


STRENGTHS: Mapping[str, Draw] = {
    "running_belt": _belt,
    "toggle_spring": _toggle,
    "heaped_chain": _chain,
    "towed_sledge": _sledge,
    "rubbing_axle": _axle,
    "overload_foldback": _foldback,
    "pulsed_thrusters": lambda s, on, d: {
        "period": rounded(d.size(0.6, 4.0) * s.world.dt), "full": rounded(d.any(1.1, 1.5) * s.action(on))
    },
    "weathervane": lambda s, on, d: {
        "turn": rounded(d.size(0.05, 0.4) * s.action("w_cmd")), "wind": d.any(0, 6.28)
    },
    "lagging_wheel": lambda s, on, d: {
        "time": rounded(d.size(0.5, 6.0) * s.world.dt), "half_track": d.any(0.1, 0.25)
    },
    "encoder_play": lambda s, on, d: {
        "gap": rounded(d.size(0.03, 0.25) * min(s.reach(on), 1.0))
    },
}  # fmt: skip
