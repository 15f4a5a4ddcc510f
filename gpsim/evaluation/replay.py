"""Layer 2 where the target cannot be driven: recorded actions played again in simulators, beside what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.evaluation.rollout import roll_out
from gpsim.recordings import Episode, evenly, gaps, pieces
from gpsim.simulators import Plant

WARM_UP = 10
"""Steps before a window in which a plant follows the recorded states, so that its memory fills as it would have."""


@dataclass(frozen=True)
class Windows:
    """Pieces of a recording: states (B, WARM_UP + T + 1, S), actions (B, WARM_UP + T, A).

    episode: (B,) which of the episodes; t: (B,) s, the moment of its clock at which the warm-up ends.
    """

    states: FloatArray
    actions: FloatArray
    episode: IntArray
    t: FloatArray

    @property
    def recorded(self) -> FloatArray:
        """(B, T + 1, S): what happened after the warm-up."""
        return self.states[:, WARM_UP:]


def windows_of(episodes: Sequence[Episode], steps: int, most: int, *, dt: float, state: Channels) -> Windows:
    """Up to `most` windows of `steps` steps, one after the other; shorter ones where nothing is long enough.

    None crosses a gap of the clock (control step dt [s]): what was commanded there is not known. Angles of `state` (S)
    run on inside a window, as simulated ones do. Raises UsageError where not even one step can be rolled out.
    """
    between = [
        (i, *stretch)
        for i, episode in enumerate(episodes)
        for stretch in pieces(np.flatnonzero(gaps(episode.t, dt)).tolist(), len(episode))
    ]
    steps = min(steps, max(high - low for _, low, high in between) - WARM_UP)
    if steps < 1:
        raise UsageError(
            f"the recording's episodes are too short to roll out: {WARM_UP + 1} steps without a lost row are needed"
        )
    begins = [
        (i, first) for i, low, high in between for first in range(low, high - WARM_UP - steps + 1, steps)
    ]
    chosen = [begins[i] for i in evenly(len(begins), most)]
    length = WARM_UP + steps
    states = np.stack([episodes[i].states[first : first + length + 1] for i, first in chosen])
    return Windows(
        _run_on(states, state),
        np.stack([episodes[i].actions[first : first + length] for i, first in chosen]),
        np.array([i for i, _ in chosen]),
        np.array([episodes[i].t[first + WARM_UP] for i, first in chosen]),
    )


def _run_on(states: FloatArray, channels: Channels) -> FloatArray:
    """States (B, K, S) without the leaps of whole turns; where a rollout starts, they stay as they were recorded.

    All that is in rad, as the diagnosis has it: not every table says which of its angles wrap.
    """
    angles = [i for i, channel in enumerate(channels) if channel.wraps or channel.unit == "rad"]
    out = states.copy()
    out[..., angles] = np.unwrap(states[..., angles], axis=1)
    return out + (states - out)[:, WARM_UP : WARM_UP + 1]


def replay(plant: Plant, windows: Windows, rng: np.random.Generator) -> FloatArray:
    """(B, T + 1, S): the plant from the window's state on, under the recorded actions.

    For plants whose states are what is measured, and whose clock does not matter; the diagnosis has one for others.
    """
    memory = plant.begin(len(windows.states), rng)
    for k in range(WARM_UP):
        plant.step(windows.states[:, k], windows.actions[:, k], memory, rng)
    return roll_out(plant, windows.states[:, WARM_UP], windows.actions[:, WARM_UP:], rng, memory)
