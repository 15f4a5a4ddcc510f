"""How long ago a command or a velocity turned round: what sticks or has play acts there."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.data.windows import Windows
from gpsim.simulators import Simulator

CLOCK = 6  # decimals of a second, rounding: equal numbers of even steps are the same age


def since_reversal(windows: Windows, simulator: Simulator) -> dict[str, FloatArray]:
    """Of every action and every coordinate's velocity: (W,) s since it turned round, at the windows' starts.

    A command turns where it falls after it has risen, a velocity where it changes its sign. As far back as windows
    remember: it turned no later where they know of no reversal.
    """
    t = np.concatenate([windows.before_t[:, :-1], windows.t[:, :1]], axis=1)
    commands = np.concatenate([windows.before_actions, windows.actions[:, :1]], axis=1)
    states = np.concatenate([windows.before_states, windows.measured[:, :1]], axis=1)
    found = {
        name: _since(np.diff(commands[..., i], axis=1, prepend=commands[:, :1, i]), t)
        for i, name in enumerate(simulator.action.names)
    }
    velocities = [c.velocity for c in simulator.coordinates]
    return found | {name: _since(states[..., simulator.state.index(name)], t) for name in velocities}


def _since(course: FloatArray, t: FloatArray) -> FloatArray:
    """(W,) s since the sign of a course (W, K) last changed; where it is 0 the sign stays what it was."""
    signs = np.sign(course)
    last = np.maximum.accumulate(np.where(signs != 0, np.arange(signs.shape[1]), 0), axis=1)
    held = np.take_along_axis(signs, last, axis=1)
    turned = (held[:, 1:] * held[:, :-1] < 0).cumsum(axis=1)
    at = np.where(turned[:, -1] > 0, 1 + np.argmax(turned == turned[:, -1:], axis=1), 0)
    return np.round(t[:, -1] - np.take_along_axis(t, at[:, None], axis=1)[:, 0], CLOCK)
