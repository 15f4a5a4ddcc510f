"""Contacts: where something touches, accelerations say more of the ground than of what was left out.

A few micrometres of depth change them by hundreds of m/s^2. Rollouts stay, since what pushes back holds on; single
steps, sizes of forces and what is learnt of accelerations leave such samples out, as long as others are left.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.report import LogFact
from gpsim.recordings import Recording
from gpsim.simulators import Simulator


def apart(simulator: Simulator, fewest: int, *states: FloatArray) -> BoolArray:
    """(N,): in which rows nothing touches in any of these states (N, S); all rows, where that leaves too few."""
    touches = [found for at in states if (found := simulator.touching(at)) is not None]
    every = np.ones(len(states[0]), dtype=np.bool_)
    free = ~np.any(touches, axis=0) if touches else every
    return free if int(free.sum()) >= fewest else every


def contacts(simulator: Simulator, recording: Recording) -> tuple[LogFact, ...]:
    """In how many samples something touches, if it does in any."""
    found = simulator.touching(np.concatenate([e.states for e in recording.episodes]))
    count = 0 if found is None else int(found.sum())
    return (LogFact("touching", count=count),) if count else ()
