"""Layer 2 where the target cannot be driven: recorded actions played again in simulators, beside what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.evenly import evenly
from gpsim.gaps import gaps
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


def windows_of(episodes: Sequence[Episode], steps: int, most: int, *, dt: float, state: Channels) -> Windows:
    """Up to `most` windows of `steps` steps, one after the other; shorter ones where nothing is long enough.

    None crosses a gap of the clock (control step dt [s]): what was commanded there is not known. Angles of `state` (S)
    run on inside a window, as simulated ones do. Raises UsageError where not even one step can be rolled out.
    """
    stretches = [stretch for episode in episodes for stretch in _without_gaps(episode, dt)]
    steps = min(steps, max(len(actions) for _, actions in stretches) - WARM_UP)
    if steps < 1:
        raise UsageError(
            f"the recording's episodes are too short to roll out: {WARM_UP + 1} steps without a lost row are needed"
        )
    pieces = [
        (states[first : first + WARM_UP + steps + 1], actions[first : first + WARM_UP + steps])
        for states, actions in stretches
        for first in range(0, len(actions) - WARM_UP - steps + 1, steps)
    ]
    chosen = [pieces[i] for i in evenly(len(pieces), most)]
    states = _run_on(np.stack([states for states, _ in chosen]), state)
    return Windows(states, np.stack([actions for _, actions in chosen]))


def _without_gaps(episode: Episode, dt: float) -> list[tuple[FloatArray, FloatArray]]:
    """States (K + 1, S) and actions (K, A) of every stretch of an episode without a gap."""
    ends = [*np.flatnonzero(gaps(episode.t, dt)).tolist(), len(episode)]
    begins = [0, *(end + 1 for end in ends[:-1])]
    return [
        (episode.states[low : high + 1], episode.actions[low:high])
        for low, high in zip(begins, ends, strict=True)
    ]


def _run_on(states: FloatArray, channels: Channels) -> FloatArray:
    """States (B, K, S) without the leaps of whole turns; where a rollout starts, they stay as they were recorded.

    All that is in rad, as the diagnosis has it: not every table says which of its angles wrap.
    """
    angles = [i for i, channel in enumerate(channels) if channel.wraps or channel.unit == "rad"]
    out = states.copy()
    out[..., angles] = np.unwrap(states[..., angles], axis=1)
    return out + (states - out)[:, WARM_UP : WARM_UP + 1]


def replay(plant: Plant, windows: Windows, rng: np.random.Generator) -> FloatArray:
    """(B, T + 1, S): the plant from the window's state on, under the recorded actions."""
    memory = plant.begin(len(windows.states), rng)
    for k in range(WARM_UP):
        plant.step(windows.states[:, k], windows.actions[:, k], memory, rng)
    states = [windows.states[:, WARM_UP]]
    for k in range(WARM_UP, windows.actions.shape[1]):
        states.append(plant.step(states[-1], windows.actions[:, k], memory, rng))
    return np.stack(states, axis=1)
