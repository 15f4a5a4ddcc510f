"""A measured force on a coordinate: a curve of its own speed or of its own position.

Penalised splines (Eilers and Marx 1996, Statistical Science 11) of the first degree, fitted by `gpsim.diagnosis.form`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects.effect import ForceEffect, Values
from gpsim.effects.measured import SCALE, Measured
from gpsim.effects.tabled import Curve

SPEED, POSITION, FRICTION = "speed", "position", "friction"


@dataclass(frozen=True)
class ForceCurve(Measured, ForceEffect):
    """A measured force on a coordinate, of its speed or its position; or friction of its speed, which holds at rest."""

    family: ClassVar[str] = "force_curve"
    noun: ClassVar[str] = "measured force"
    variants: ClassVar[tuple[str, ...]] = (SPEED, POSITION, FRICTION)

    @property
    def dry(self) -> bool:
        """Whether it holds a body at rest."""
        return self.variant == FRICTION

    @property
    def curve(self) -> Curve:
        """For compiled code."""
        shape, of_speed = self.shape, self.variant != POSITION
        return Curve(
            "grip" if self.dry else "force",
            shape.axes,
            (),
            (int(of_speed),),
            (shape.wraps and not of_speed,),
            heights=shape.heights,
            times=SCALE,
        )

    def force(self, position: FloatArray, speed: FloatArray, values: Values) -> FloatArray | None:
        """The curve; of friction there is no smooth force."""
        if self.dry:
            return None
        return np.asarray(values[SCALE] * self.shape.at(position if self.variant == POSITION else speed))

    def grip(
        self, position: FloatArray, speed: FloatArray, values: Values, load: FloatArray | None
    ) -> FloatArray | None:
        """The curve, which is how much friction there is; of what rests the mean of both directions."""
        if not self.dry:
            return None
        out = self.shape.at(speed)
        if not speed.all():
            tiny = np.where(speed == 0.0, -np.finfo(float).tiny, speed)
            out = 0.5 * (out + self.shape.at(tiny))
        return np.asarray(values[SCALE] * out)
