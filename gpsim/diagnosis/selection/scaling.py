"""A drive's gain beside the inertia that it moves: all forces on a coordinate and its inertia may grow together."""

from __future__ import annotations

import numpy as np

from gpsim.diagnosis.fitting import Hypothesis
from gpsim.simulators import Simulator

PUSHES_LESS = (-1.25, -0.5)  # by what power of an inertia a force's acceleration changes
STEP = 0.01  # of a parameter, relative


def inertias(simulator: Simulator, coordinate: str) -> tuple[str, ...]:
    """Parameters of which a force on the coordinate accelerates it inversely; none of a simulator that hides that."""
    names, believed = [c.name for c in simulator.coordinates], simulator.defaults()
    at, state = names.index(coordinate), np.full((1, len(simulator.state)), 0.1)

    def pushed(parameters: dict[str, float]) -> float:
        moved = simulator.mobility(state, parameters, at)
        return 0.0 if moved is None else float(moved[0, at])

    plain = pushed(dict(believed))
    if plain <= 0.0:
        return ()
    low, high = PUSHES_LESS
    power = {
        name: np.log(pushed({**believed, name: value * (1 + STEP)}) / plain) / np.log1p(STEP)
        for name, value in believed.items()
        if value > 0
    }
    return tuple(name for name, p in power.items() if low <= p <= high)


def moved_inertias(simulator: Simulator, hypothesis: Hypothesis) -> list[int]:
    """The terms that are an inertia beside the gain of the command that moves it."""
    claims = hypothesis.claims
    moved = {
        ("parameter_offset", name)
        for action, coordinate in simulator.driven().items()
        if ("actuator_gain", action) in claims
        for name in inertias(simulator, coordinate)
    }
    return [i for i, term in enumerate(hypothesis.terms) if term.identity in moved]
