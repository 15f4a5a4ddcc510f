"""What the sensors of a concealed world say: the catalogue's laws written anew, along the true fine trajectory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.outside.registry import BENT, RECALLED
from gpsim.trials.worlds.world import TrueEffect

FAMILIES = ("marker_offset", "frame_rotation", "sensor_scale", "sensor_bias", "sensor_delay")


def sense(
    effects: Sequence[TrueEffect], names: tuple[str, ...], past: FloatArray, index: int, h: float
) -> FloatArray:
    """(E, S) readings at fine step `index`; past: (>= index + 1, E, S) true states every h s.

    What a delayed sensor saw before the start is the start: episodes begin at rest.
    """
    now = past[index].copy()
    ordered = sorted((e for e in effects if e.family in FAMILIES), key=lambda e: FAMILIES.index(e.family))
    for effect in (e for e in ordered if e.family == "sensor_delay"):
        column = names.index(effect.on)
        back = max(index - round(effect.values["delay"] / h), 0)
        now[:, column] = past[back, :, column]
    for effect in (e for e in effects if e.family in RECALLED):
        column = names.index(effect.on)
        now[:, column] = RECALLED[effect.family](effect.values, past[: index + 1, :, column], h)
    for effect in ordered:
        _read(effect, names, now)
    for effect in (e for e in effects if e.family in BENT):
        part = slice(0, 2) if effect.on == "pose" else names.index(effect.on)
        now[:, part] = BENT[effect.family](effect.values, now[:, part])
    return np.asarray(now)


def _read(effect: TrueEffect, names: tuple[str, ...], now: FloatArray) -> None:
    k = effect.values
    if effect.family == "marker_offset":
        sin, cos = np.sin(now[:, 2]), np.cos(now[:, 2])
        now[:, 0] += k["forward"] * cos - k["left"] * sin
        now[:, 1] += k["forward"] * sin + k["left"] * cos
    elif effect.family == "frame_rotation":
        now[:, 2] += k["angle"]
    elif effect.family == "sensor_bias":
        now[:, names.index(effect.on)] += k["offset"]
    elif effect.family == "sensor_scale":
        now[:, names.index(effect.on)] *= k["scale"]
