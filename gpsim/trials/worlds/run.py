"""A run: what truly happened in a concealed world, and what was read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray


@dataclass(frozen=True)
class Run:
    """What truly happened, and what was read.

    fine: (K n + 1, E, S) true states every h s; commands: (K, E, A); clean: (K + 1, E, S) readings without noise;
    measured: with it; hidden: (K + 1, E, H) hidden states of the body at the samples. clock, wall: (E,) s, what the
    recording's clock and a clock on the wall said at the episodes' starts.
    """

    fine: FloatArray
    h: float
    commands: FloatArray
    clean: FloatArray
    measured: FloatArray
    hidden: FloatArray
    clock: FloatArray
    wall: FloatArray

    @property
    def per_sample(self) -> int:
        """Fine steps between two samples."""
        return (len(self.fine) - 1) // len(self.commands)

    @property
    def sampled(self) -> FloatArray:
        """(K + 1, E, S) true states at the samples."""
        return np.asarray(self.fine[:: self.per_sample])
