"""In how much of a recording an effect behind a gate acts."""

from __future__ import annotations

import numpy as np

from gpsim.diagnosis.fitting import Problem
from gpsim.effects import IN_EPISODE, Term


def acts_in(problem: Problem, term: Term) -> float:
    """The share of what was learnt from, in which the term's gate is open."""
    windows, simulator = problem.windows, problem.simulator
    t = windows.t[:, :-1]
    path = windows.measured[:, :-1], windows.measured[:, 1:]
    episode = {IN_EPISODE: np.broadcast_to(windows.episode[:, None], t.shape).astype(float)}
    step, channels = np.diff(windows.t, axis=1), simulator.state + simulator.action
    share = term.gate.share(path, windows.actions, t, step, channels, episode)
    return float(share[windows.valid[:, 1:]].mean()) if windows.valid[:, 1:].any() else 0.0
