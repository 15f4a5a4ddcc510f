"""How far bristles are bent as windows begin: the way before tells it, which positions were read along."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.diagnosis.data import Windows
from gpsim.effects import Chain, Values, bend_key, bent
from gpsim.simulators import Memory

BACK = 60  # transitions: what was before is forgotten, or the body stood still


def bends_of(
    chain: Chain, windows: Windows, rows: IntArray, starts: FloatArray, values: Sequence[Values]
) -> Memory:
    """Of rows (B,) of windows that start at (B, S), by term; an episode's first moves find bristles unbent.

    What is between two samples is taken for even motion. The last of them is the start that is asked for.
    """
    memory: Memory = {bend_key(i): np.zeros(len(rows)) for i, _ in chain.bristles}
    windows = windows.remembering(BACK)
    lasting = np.diff(windows.before_t, axis=1)
    for (index, coordinate), bend in zip(chain.bristles, memory.values(), strict=True):
        column = chain.simulator.state.index(chain.simulator.coordinates[coordinate].name)
        read = windows.before_states[:, :, column]
        way, time = np.diff(read, axis=1)[rows], np.maximum(lasting, 1e-9)[rows]
        term = values[index]
        for k in range(way.shape[1]):
            bend[:], _ = bent(bend, way[:, k], way[:, k] / time[:, k], term)
        last = starts[:, column] - read[rows, -1]
        bend[:], _ = bent(bend, last, last / time[:, -1], term)
        bend[windows.rested[rows]] = 0.0
    return memory
