"""Simulators that own their integration (MuJoCo's): how finely dry friction is stepped, how long a window may be."""

from __future__ import annotations

import numpy as np

from gpsim.diagnosis.fitting import Hypothesis, Problem, dry_steps, growth
from gpsim.diagnosis.setup.sizes import Sizes
from gpsim.effects import Term, effect_of
from gpsim.recordings import Recording, evenly

DRY_WINDOWS = 12  # windows on which that is asked, of every joint
SHORTEST_UNSTABLE = 5  # transitions that such a window keeps

RUBS = "coulomb_friction"


def steps_with_friction(problem: Problem, recording: Recording) -> dict[str, int]:
    """Coordinate -> times as many substeps where dry friction acts on it: of its usual size, in a few windows.

    None of a model of many joints, whose steps are too dear.
    """
    simulator, settings = problem.simulator, problem.run.settings
    if len(simulator.coordinates) > settings.closed_step.dry_joints:
        return {}
    sizes, effect = Sizes(recording, simulator, problem.parameters, settings.candidates), effect_of(RUBS)
    rows = evenly(len(problem.windows), DRY_WINDOWS)
    some, found = problem.on(problem.windows.take(rows)), {}
    for on in effect.places(simulator):
        declared = effect.parameters(sizes.place(effect, on))
        term = Term(RUBS, on, {p.name: p.starts[0] for p in declared})
        times = dry_steps(some, Hypothesis((term,), (declared,)))
        if times > 1:
            found[on] = times
    return found


def steady_length(problem: Problem) -> int:
    """Transitions of a window within which the base does not drive apart what began alike: fits get lost there."""
    settings, longest = problem.run.settings.closed_step, problem.windows.length
    (beyond,) = np.nonzero(growth(problem) > settings.unstable)
    return min(max(int(beyond[0]) - 1, SHORTEST_UNSTABLE), longest) if len(beyond) else longest
