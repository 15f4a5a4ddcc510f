"""The kinematic bicycle: a car that steers its front wheel and rolls without slip, seen from its rear axle."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators.planar import PlanarVehicle
from gpsim.simulators.simulator import SMALLEST, Parameter, Parameters


class Ackermann(PlanarVehicle):
    """Actions v_cmd [m/s] and steering [rad, + left]; w = v tan(steering) / wheelbase, v_lateral = 0 at the rear axle.

    Rajamani, Vehicle Dynamics and Control, 2nd ed., section 2.2 (with the reference point on the rear axle).
    """

    name: ClassVar[str] = "ackermann"
    action: ClassVar[Channels] = Channels.of({"v_cmd": "m/s", "steering": "rad"})
    parameters: ClassVar[dict[str, Parameter]] = {
        "wheelbase": Parameter("m", 0.2, SMALLEST, math.inf, "distance between the axles")
    }

    @property
    def kinematic(self) -> bool:
        """Yes; a vehicle derived from it that writes rates of its own has to say so itself."""
        return type(self).rates is Ackermann.rates

    def rates(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        forces: FloatArray | None = None,
    ) -> FloatArray:
        """The twist (B, 3)."""
        out = np.zeros((len(state), 3))
        out[:, 0] = action[:, 0]
        out[:, 2] = action[:, 0] * np.tan(np.ascontiguousarray(action[:, 1])) / parameters["wheelbase"]
        return out
