"""The slider: one body on a straight, frictionless guide, pushed by a force. Newton's second law, nothing else."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.simulators.simulator import SMALLEST, Coordinate, MechanicalSimulator, Parameter, Parameters


class Slider(MechanicalSimulator):
    """State (q [m], q_dot [m/s]); action force [N]; rate q_acc = force / mass [m/s^2]."""

    name: ClassVar[str] = "slider"
    state: ClassVar[Channels] = Channels.of({"q": "m", "q_dot": "m/s"})
    action: ClassVar[Channels] = Channels.of({"force": "N"})
    rate: ClassVar[Channels] = Channels.of({"q_acc": "m/s^2"})
    coordinates: ClassVar[tuple[Coordinate, ...]] = (Coordinate("q", "q_dot", "q_acc", "N"),)
    parameters: ClassVar[dict[str, Parameter]] = {
        "mass": Parameter("kg", 1.0, SMALLEST, math.inf, "moving mass")
    }

    def rates(
        self,
        state: FloatArray,
        action: FloatArray,
        parameters: Parameters,
        forces: FloatArray | None = None,
    ) -> FloatArray:
        """Acceleration (B, 1)."""
        push = action if forces is None else action + forces
        return push / _column(parameters["mass"])

    def mobility(self, state: FloatArray, parameters: Parameters, coordinate: int) -> FloatArray:
        """One over the mass."""
        out = np.empty((len(state), 1))
        out[:, 0] = 1.0 / parameters["mass"]
        return out


def _column(value: float | FloatArray) -> float | FloatArray:
    return value if isinstance(value, float | int) else value[:, None]
