"""A measured response of a vehicle: its turn rate, or its sideways speed, is a map of its speed and turn rate.

Penalised splines (Eilers and Marx 1996, Statistical Science 11) of the first degree, fitted by `gpsim.diagnosis.form`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gpsim.channels import FloatArray
from gpsim.effects.effect import Values, VehicleEffect
from gpsim.effects.measured import SCALE, Measured
from gpsim.effects.tabled import Curve

TURN, SLIP = "w", "v_lateral"


@dataclass(frozen=True)
class RateCurve(Measured, VehicleEffect):
    """A measured response of a vehicle: what a map of its speed and turn rate adds to its turn rate, or sideways."""

    family: ClassVar[str] = "rate_curve"
    noun: ClassVar[str] = "measured vehicle response"
    variants: ClassVar[tuple[str, ...]] = (TURN, SLIP)

    @property
    def order(self) -> int:  # type: ignore[override]  # where the laws stand that it is in the place of
        """Turn rates come before what slips."""
        return 10 if self.variant == TURN else 40

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        shape, of = self.shape, "turn" if self.variant == TURN else "slip"
        return Curve(
            of,  # type: ignore[arg-type]  # it is one of the two
            shape.axes,
            (),
            (0, 1),
            (False, False),
            heights=shape.heights,
            times=SCALE,
        )

    def twist(
        self, v: FloatArray, lateral: FloatArray, w: FloatArray, values: Values
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The twist and what the map adds to it."""
        more = values[SCALE] * self.shape.at(v, w)
        return (v, lateral, w + more) if self.variant == TURN else (v, lateral + more, w)
