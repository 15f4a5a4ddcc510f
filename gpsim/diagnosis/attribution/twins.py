"""A drive's gain beside the inertia that it moves: commands and motion show little more than their ratio.

All forces on a coordinate and its inertia may grow together, and the motion stays. Where an account holds both and is
sure of neither, every force in it is as uncertain: one of the two has to be taken as it is believed.
"""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Problem, curvature
from gpsim.diagnosis.selection import inertias

SURELY = (
    3.0  # standard errors that a gain or an inertia is away from what is believed, where it surely differs
)
TINY = 1e-300  # guards a division by what windows do not know


def unsure_twins(problem: Problem, leader: Fit) -> list[int]:
    """Terms that are such a gain and such an inertia, where the account is sure of neither; else none."""
    terms = leader.hypothesis.terms
    gains = {t.on: i for i, t in enumerate(terms) if t.family == "actuator_gain" and not t.gate}
    scales = {t.on: i for i, t in enumerate(terms) if t.family == "parameter_offset" and not t.gate}
    if not gains or not scales:
        return []
    for action, coordinate in problem.simulator.driven().items():
        moved = [scales[name] for name in inertias(problem.simulator, coordinate) if name in scales]
        twins = [gains[action], *moved] if action in gains and moved else []
        if twins and not any(_sure(problem, leader)[i] for i in twins):
            return twins
    return []


def _sure(problem: Problem, leader: Fit) -> FloatArray:
    """(T,) whether each term's one parameter surely differs from what does nothing; the scatter of windows counts."""
    hypothesis, variance = leader.hypothesis, curvature(problem, leader).variance
    away = np.abs(hypothesis.theta - np.array([p.none for p in hypothesis.parameters]))
    sure = away > SURELY * np.sqrt(np.maximum(variance, TINY))
    ends = np.cumsum([len(group) for group in hypothesis.declared])
    return np.array([bool(part.all()) for part in np.split(sure, ends[:-1])])
