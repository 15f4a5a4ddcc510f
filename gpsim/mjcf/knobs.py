"""How the value of a parameter is written into the fields of a model, each simulation with its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray

HEAVIEST = (
    20.0  # times what is believed: the most that a mass, a gain or a friction may be, and 1 / 20 the least
)


@dataclass(frozen=True)
class Knob:
    """One parameter of a model: the fields it changes, and how its value (B,) writes them."""

    fields: tuple[str, ...]
    write: Callable[[Mapping[str, FloatArray], FloatArray], None]


def place_knob(name: str, *at: int) -> Knob:
    """The value itself, at one place of a field."""
    where: tuple[slice | int, ...] = (slice(None), *at)

    def write(fields: Mapping[str, FloatArray], value: FloatArray) -> None:
        fields[name][where] = value

    return Knob((name,), write)


def scale_knob(names: tuple[str, ...], at: tuple[int, ...], believed: float) -> Knob:
    """All that lies at a place of these fields, by the ratio of the value to what is believed."""
    where: tuple[slice | int, ...] = (slice(None), *at)

    def write(fields: Mapping[str, FloatArray], value: FloatArray) -> None:
        for name in names:
            part = np.asarray(fields[name][where])
            fields[name][where] = part * (value / believed).reshape(-1, *(1,) * (part.ndim - 1))

    return Knob(names, write)


def gain_knob(actuator: int, column: int, believed: float, *, moves: bool) -> Knob:
    """A servo's gain; where it multiplies the command, too, both go together."""

    def write(fields: Mapping[str, FloatArray], value: FloatArray) -> None:
        fields["actuator_biasprm"][:, actuator, column] *= value / believed
        if moves:
            fields["actuator_gainprm"][:, actuator, 0] *= value / believed

    return Knob(("actuator_biasprm", "actuator_gainprm") if moves else ("actuator_biasprm",), write)
