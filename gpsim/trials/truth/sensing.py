"""What the sensors of a concealed world say along the true fine trajectory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue, outside
from gpsim.trials.worlds import TrueEffect

ORDER = catalogue.SENSORS
REMEMBERING, DISTORTING = outside.at_site(outside.SensorWithMemory), outside.at_site(outside.Distortion)


def sense(
    effects: Sequence[TrueEffect], names: tuple[str, ...], past: FloatArray, index: int, h: float
) -> FloatArray:
    """(E, S) readings at fine step `index`; past: (>= index + 1, E, S) true states every h s.

    What a delayed sensor saw before the start is the start: episodes begin at rest.
    """
    now = past[index].copy()
    ordered = sorted((e for e in effects if e.family in ORDER), key=lambda e: ORDER.index(e.family))
    for effect in (e for e in ordered if e.family == "sensor_delay"):
        column = names.index(effect.on)
        back = max(index - round(effect.values["delay"] / h), 0)
        now[:, column] = past[back, :, column]
    for effect in (e for e in effects if e.family in REMEMBERING):
        column = names.index(effect.on)
        now[:, column] = REMEMBERING[effect.family](effect.values).read(past[: index + 1, :, column], h)
    for effect in ordered:
        catalogue.read(effect, names, now)
    for effect in (e for e in effects if e.family in DISTORTING):
        part = slice(0, 2) if effect.on == "pose" else names.index(effect.on)
        now[:, part] = DISTORTING[effect.family](effect.values).read(now[:, part])
    return np.asarray(now)
