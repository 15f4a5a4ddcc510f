"""Fit coordinates: every parameter written so that 0 does nothing, with the prior of its size.

What multiplies is fitted as a log ratio, what limits as an inverse, all else as a difference from what does nothing. A
mass of five times and a motor's gain of 0.002 then cost evidence in the fit, and need no veto after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects import EffectParameter

LOG_SIZE = (
    0.4  # standard deviation of a ratio's logarithm a priori: masses and gains are off by tens of per cent
)
WIDE = 15.0  # scales, the standard deviation of every other parameter a priori: it keeps open directions from running
SMALLEST_RATIO = 0.02  # of what multiplies: no machine has less


@dataclass(frozen=True)
class Coordinates:
    """The coordinates (P,) of some parameters: kinds, and per coordinate its bounds, scale and prior deviation."""

    parameters: tuple[EffectParameter, ...]
    kind: FloatArray
    low: FloatArray
    high: FloatArray
    scale: FloatArray
    prior: FloatArray
    centre: FloatArray

    def natural(self, z: FloatArray) -> FloatArray:
        """(..., P) parameters in their units, of coordinates (..., P)."""
        out = self.none + z
        ratio, limit = self.kind == 1, self.kind == 2
        out[..., ratio] = np.exp(z[..., ratio])
        out[..., limit] = 1.0 / np.maximum(z[..., limit], self.tiny[limit])
        return np.asarray(out)

    def of(self, theta: FloatArray) -> FloatArray:
        """(P,) coordinates of parameters in their units."""
        out = np.asarray(theta, dtype=float) - self.none
        ratio, limit = self.kind == 1, self.kind == 2
        out[ratio] = np.log(np.maximum(theta[ratio], SMALLEST_RATIO))
        out[limit] = 1.0 / np.maximum(theta[limit], 1e-300)
        return np.asarray(np.clip(out, self.low, self.high))

    def slope(self, z: FloatArray) -> FloatArray:
        """(P,) by how much each parameter changes with its coordinate."""
        value, out = self.natural(z), np.ones(len(z))
        ratio, limit = self.kind == 1, self.kind == 2
        out[ratio] = value[ratio]
        out[limit] = -(value[limit] ** 2)
        return out

    @property
    def none(self) -> FloatArray:
        """(P,) the parameters at which nothing happens."""
        return np.array([0.0 if p.falls else p.none for p in self.parameters])

    @property
    def tiny(self) -> FloatArray:
        """(P,) below which a limit's coordinate is taken for no limit at all."""
        return np.maximum(1e-6 * self.scale, 1e-300)


def coordinates(parameters: Sequence[EffectParameter]) -> Coordinates:
    """The fit coordinates of parameters, in their order."""
    rows = [_row(p) for p in parameters]
    table = np.array(rows, dtype=float).reshape(len(rows), 6)
    return Coordinates(tuple(parameters), *table.T)


def _row(p: EffectParameter) -> tuple[float, ...]:
    """Kind, low, high, scale, prior deviation and the prior's centre."""
    if p.falls:
        typical = p.starts[0] if p.starts[0] > 0 else p.scale
        return 2, 0.0, 1.0 / max(p.low, 0.05 * typical), 0.3 / typical, WIDE / typical, 0.0
    if p.none == 1.0 and p.high > 0.0:
        low = max(p.low, SMALLEST_RATIO)
        return 1, np.log(low), np.log(max(p.high, 2 * low)), 0.3, LOG_SIZE, 0.0
    start = p.starts[0] - p.none if p.place else 0.0
    return 0, p.low - p.none, p.high - p.none, p.scale, WIDE * p.scale, start
