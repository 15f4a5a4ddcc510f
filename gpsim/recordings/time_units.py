"""Time columns that are not in seconds: told by their usual step and where they lie, never rescaled unasked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings.log_parts import Part

UNITS = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
_YEARS = (3e8, 1e10)  # s after 1970 in which clocks of today count: 1979 to 2286
_USUAL = 0.02  # s; a usual step of logs of what moves: a hundredth and a hundred times of it are usual, too


def dated(t: FloatArray) -> str | None:
    """The unit that times after 1970 tell by their size alone, if it is not seconds."""
    size = float(np.median(np.abs(t[np.isfinite(t)]))) if np.isfinite(t).any() else 0.0
    return next(
        (n for n, scale in UNITS.items() if size > _YEARS[1] and _YEARS[0] <= size * scale <= _YEARS[1]), None
    )


def likely_unit(t: FloatArray, step: float) -> str | None:
    """The unit that a time column (N,) with this usual step looks to be in; None where seconds are as likely.

    A date tells it; else a step that is 1 or more as seconds, and that of a log of something that moves in the unit.
    (A step of 20 may be 20 ms: the caller knows what speaks for it.)
    """
    if dated(t) is not None or step < 1.0:
        return dated(t)
    away = {name: abs(np.log10(step * scale / _USUAL)) for name, scale in UNITS.items()}
    nearest = min(away, key=lambda name: away[name])
    return nearest if away[nearest] <= 2.0 else None


def unit_hint(parts: Sequence[Part]) -> str:
    """What to write where no episode is left because the time column is in another unit; empty where it is not."""
    for part in parts:
        time = part.mapping.time
        if time is None or time.field is None or time.scale != 1.0:
            continue
        for track in part.tracks.values():
            step = float(np.median(np.diff(track.t))) if len(track.t) > 1 else 0.0
            unit = likely_unit(track.t + part.epoch, step)
            if unit is not None:
                return (
                    f"the time column '{time.field}' looks like {unit}: its usual step is {step:g}; write "
                    f"time: {{field: {time.field}, scale: {UNITS[unit]:.0e}}} in the mapping, or time.scale="
                    f"{UNITS[unit]:.0e} behind the command; if it is in seconds, raise gap_limit above {step:g}"
                )
    return ""
