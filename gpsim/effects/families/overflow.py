"""An overflow: at its rim a level rises no further, whatever flows in.

Definition: what comes in beyond the rim is lost, as in a vessel that spills (the cascaded tanks of Schoukens, Mattsson,
Wigren and Noel 2016 do). It acts on states of the first order, and is asked of channels whose readings stand at their
highest value.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import RateEffect, Values
from gpsim.effects.place import EffectParameter, Place
from gpsim.simulators import Simulator


class Overflow(RateEffect):
    """An overflow: at its rim a level rises no further, whatever flows in."""

    family: ClassVar[str] = "overflow"
    sentence: ClassVar[str] = "{on} overflows at {rim}"
    gated: ClassVar[bool] = False

    def places(self, simulator: Simulator) -> tuple[str, ...]:
        """States whose rate is their own: neither a coordinate nor its velocity."""
        if hasattr(simulator, "rolled"):  # it owns its integration (see `gpsim.effects.closed_step`)
            return ()
        return tuple(n for n in simulator.state.names if f"{n}_rate" in simulator.rate.names)

    def parameters(self, place: Place, variant: str = "") -> tuple[EffectParameter, ...]:
        """Rim [the channel's]."""
        return (place.reading_end("rim", highest=True),)

    def offers(self, place: Place, variant: str) -> bool:
        """Where readings stand at the highest."""
        return variant == "" and place.stands[1]

    def added(
        self,
        simulator: Simulator,
        state: FloatArray,
        action: FloatArray,
        parameters: Mapping[str, float | FloatArray],
        values: Values,
        on: str,
    ) -> FloatArray:
        """Minus what the full vessel would rise by."""
        column, out = simulator.rate.index(f"{on}_rate"), np.zeros((len(state), len(simulator.rate)))
        full = state[:, simulator.state.index(on)] >= values["rim"]
        rising = np.maximum(simulator.rates(state, action, parameters)[:, column], 0.0)
        out[:, column] = np.where(full, -rising, 0.0)
        return out
