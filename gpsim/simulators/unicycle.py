"""The unicycle: a vehicle that does at once what it is told and never slips sideways."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators.planar import PlanarVehicle
from gpsim.simulators.simulator import Parameter, Parameters


class Unicycle(PlanarVehicle):
    """Actions v_cmd [m/s] and w_cmd [rad/s]; v = v_cmd, v_lateral = 0, w = w_cmd; only the pose is measured.

    Siegwart, Nourbakhsh and Scaramuzza, Introduction to Autonomous Mobile Robots, 2nd ed., section 3.2.
    """

    name: ClassVar[str] = "unicycle"
    action: ClassVar[Channels] = Channels.of({"v_cmd": "m/s", "w_cmd": "rad/s"})
    parameters: ClassVar[dict[str, Parameter]] = {}

    @property
    def kinematic(self) -> bool:
        """Yes; a vehicle derived from it that writes rates of its own has to say so itself."""
        return type(self).rates is Unicycle.rates

    def rates(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        forces: FloatArray | None = None,
    ) -> FloatArray:
        """The commanded twist (B, 3)."""
        out = np.zeros((len(state), 3))
        out[:, 0::2] = action
        return out
