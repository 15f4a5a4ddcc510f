"""The catalogue applied to a simulator and a recording: every effect that makes sense, everywhere it makes sense."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.diagnosis.fitting import Candidate
from gpsim.diagnosis.setup.known import allowed, check_bounds
from gpsim.diagnosis.setup.not_asked import shows
from gpsim.diagnosis.setup.prepare import Question
from gpsim.diagnosis.setup.sizes import Sizes
from gpsim.effects import FAMILIES, declared, effect_of
from gpsim.recordings import Recording
from gpsim.simulators import Simulator

OF_JOINTS = ("viscous_friction", "coulomb_friction", "stribeck_friction", "constant_force", "armature")


def candidates(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
) -> list[Candidate]:
    """All terms that may be missing, in the catalogue's order.

    Of the ground only what something touches in the recording is asked; of what says where a body floats neither
    friction nor a rotor.
    """
    untouched = simulator.untouched(np.concatenate([e.states for e in recording.episodes]))
    sizes = Sizes(recording, simulator, parameters)
    out = []
    for effect in FAMILIES.values():
        for on in effect.places(simulator):
            if on in untouched or (on in simulator.floating and effect.family in OF_JOINTS):
                continue
            place = sizes.place(effect, on)
            out += [
                Candidate(effect.family, place, variant, declared(effect, place, variant))
                for variant in effect.variants
                if effect.offers(place, variant)
            ]
    return out


def offers_of(question: Question) -> list[Candidate]:
    """Every term that may be missing from a question's simulator, and that its recording could show."""
    problem = question.everything
    known, parameters = problem.run.known, problem.parameters
    offers = [
        c
        for c in candidates(question.recording, problem.simulator, parameters)
        if _is_read(question, c) and shows(question, c)
    ]
    check_bounds(known, offers)
    return allowed(known, offers, parameters)


def _is_read(question: Question, candidate: Candidate) -> bool:
    """Whether what a sensor's effect acts on was read, and was not made of something else."""
    names, observed = question.everything.simulator.state.names, question.everything.observed
    on = candidate.place.on
    return effect_of(candidate.family).site != "sensor" or on not in names or bool(observed[names.index(on)])
