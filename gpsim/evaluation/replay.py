"""Layer 2 where the target cannot be driven: recorded actions played again in simulators, beside what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.evenly import evenly
from gpsim.recordings import Episode
from gpsim.simulators.plant import Plant

WARM_UP = 10
"""Steps before a window in which a plant follows the recorded states, so that its memory fills as it would have."""


@dataclass(frozen=True)
class Windows:
    """Pieces of a recording: states (B, WARM_UP + T + 1, S), actions (B, WARM_UP + T, A)."""

    states: FloatArray
    actions: FloatArray

    @property
    def recorded(self) -> FloatArray:
        """(B, T + 1, S): what happened after the warm-up."""
        return self.states[:, WARM_UP:]


def windows_of(episodes: Sequence[Episode], steps: int, most: int) -> Windows:
    """Up to `most` windows of `steps` steps, one after the other; shorter ones where no episode is long enough."""
    steps = min(steps, max(len(episode) for episode in episodes) - WARM_UP)
    if steps < 1:
        raise UsageError(
            f"the recording's episodes are too short to roll out: {WARM_UP + 1} steps are needed"
        )
    pieces = [
        (
            episode.states[first : first + WARM_UP + steps + 1],
            episode.actions[first : first + WARM_UP + steps],
        )
        for episode in episodes
        for first in range(0, len(episode) - WARM_UP - steps + 1, steps)
    ]
    chosen = [pieces[i] for i in evenly(len(pieces), most)]
    return Windows(np.stack([states for states, _ in chosen]), np.stack([actions for _, actions in chosen]))


def replay(plant: Plant, windows: Windows, rng: np.random.Generator) -> FloatArray:
    """(B, T + 1, S): the plant from the window's state on, under the recorded actions."""
    memory = plant.begin(len(windows.states), rng)
    for k in range(WARM_UP):
        plant.step(windows.states[:, k], windows.actions[:, k], memory, rng)
    states = [windows.states[:, WARM_UP]]
    for k in range(WARM_UP, windows.actions.shape[1]):
        states.append(plant.step(states[-1], windows.actions[:, k], memory, rng))
    return np.stack(states, axis=1)
