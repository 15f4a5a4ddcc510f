"""What happens to a command before it reaches the body: every actuator of a world, one after another."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import catalogue, outside
from gpsim.trials.worlds import SYSTEMS, TrueEffect, Values

ACTUATORS: Mapping[str, Callable[[Values], catalogue.Actuator]] = {
    **catalogue.ACTUATORS,
    **outside.at_site(outside.Actuator),
}
ORDER = tuple(ACTUATORS)


class ActuatorChain:
    """The actuators of every action, in their order, with their memory."""

    def __init__(self, system: str, effects: Sequence[TrueEffect]) -> None:
        names = tuple(SYSTEMS[system].action)
        ordered = sorted((e for e in effects if e.family in ACTUATORS), key=lambda e: ORDER.index(e.family))
        self._names = SYSTEMS[system].names
        self._parts = [(e, names.index(e.on), ACTUATORS[e.family](e.values)) for e in ordered]

    def act(self, command: FloatArray, s: FloatArray, t: FloatArray, h: float) -> FloatArray:
        """(B, A) what acts during the next h s."""
        if not self._parts:
            return command
        out = command.copy()
        for effect, column, actuator in self._parts:
            acted = actuator.act(out[:, column].copy(), s, t, h)
            if effect.gated:
                acted = np.where(effect.acts(s, t, self._names) > 0, acted, out[:, column])
            out[:, column] = acted
        return out
