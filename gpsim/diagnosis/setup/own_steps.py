"""Simulators that own their integration (MuJoCo's): how finely dry friction is stepped, how long a window may be."""

from __future__ import annotations

import numpy as np

from gpsim.diagnosis.fitting import Hypothesis, Problem, dry_steps, growth
from gpsim.diagnosis.setup.sizes import Sizes
from gpsim.effects import Term, effect_of
from gpsim.recordings import Recording

RUBS = "coulomb_friction"


def steps_with_friction(sample: Problem, recording: Recording) -> int:
    """Times as many substeps where dry friction acts: of its usual size, on all joints of a few windows."""
    simulator, settings = sample.simulator, sample.run.settings
    sizes, effect = Sizes(recording, simulator, sample.parameters, settings.candidates), effect_of(RUBS)
    places = [sizes.place(effect, on) for on in effect.places(simulator)]
    declared = tuple(effect.parameters(place) for place in places)
    terms = tuple(
        Term(RUBS, place.on, {p.name: p.starts[0] for p in group})
        for place, group in zip(places, declared, strict=True)
    )
    return dry_steps(sample, Hypothesis(terms, declared)) if terms else 1


def steady_length(problem: Problem) -> int:
    """Transitions of a window within which the base does not drive apart what began alike: fits get lost there."""
    settings, longest = problem.run.settings.closed_step, problem.windows.length
    (beyond,) = np.nonzero(growth(problem) > settings.unstable)
    return min(max(int(beyond[0]) - 1, settings.shortest), longest) if len(beyond) else longest
