"""What the catalogue's sensors say, written anew."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.worlds import TrueEffect

SENSORS = ("marker_offset", "frame_rotation", "sensor_scale", "sensor_bias", "sensor_delay")
"""Several act in this order, a delay before all others."""


def read(effect: TrueEffect, names: tuple[str, ...], now: FloatArray) -> None:
    """Change the readings `now` (E, S), in place, to what the sensor says; a delay is not one of these."""
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
