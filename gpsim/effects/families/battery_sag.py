"""Battery sag: the gain falls with time, g = 1 - loss t.

Definition: a straight line in the place of a discharge curve (Shepherd 1965, "Design of primary and secondary
cells II. An equation describing battery discharge", Journal of the Electrochemical Society 112(7)). t: since
the clock began.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ActuatorEffect, FunctionOf, Needs, Values
from gpsim.effects.place import EffectParameter, Place, Plausible
from gpsim.simulators import Memory


class BatterySag(ActuatorEffect):
    """Battery sag: the gain falls with time, g = 1 - loss t."""

    family: ClassVar[str] = "battery_sag"
    sentence: ClassVar[str] = "{on} loses {loss_per_second} of its strength (battery sag)"
    function_of: ClassVar[FunctionOf] = "nothing"
    needs: ClassVar[Needs] = "command"
    order: ClassVar[int] = 60
    holds: ClassVar[bool] = False
    drifts: ClassVar[bool] = True
    plausible: ClassVar[Mapping[str, Plausible]] = {
        "loss_per_second": Plausible(
            0.0, 1.0, "1 / reach", "by reason: a battery that is empty at the end of the recording"
        ),
    }

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """loss_per_second [1/s]."""
        typical = 1.0 / max(place.reach, 1e-9)
        return (EffectParameter("loss_per_second", "1/s", 0.0, 2 * typical, (0.2 * typical,), 0.2 * typical),)

    def actuate(
        self, commands: FloatArray, values: Values, memory: Memory, step: FloatArray, t: FloatArray
    ) -> FloatArray:
        """The commands times what is left at time t."""
        return np.asarray(commands * np.maximum(1.0 - values["loss_per_second"] * t, 0.0))
