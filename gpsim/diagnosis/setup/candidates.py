"""The catalogue applied to a simulator and a recording: every effect that makes sense, everywhere it makes sense."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gpsim.diagnosis.fitting import Candidate, is_row
from gpsim.diagnosis.settings import CandidateSettings
from gpsim.diagnosis.setup.known import allowed, check_bounds
from gpsim.diagnosis.setup.not_asked import shows
from gpsim.diagnosis.setup.prepare import Question
from gpsim.diagnosis.setup.sizes import Sizes
from gpsim.effects import FAMILIES, declared, effect_of
from gpsim.recordings import Recording
from gpsim.simulators import Simulator


def candidates(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
    settings: CandidateSettings | None = None,
) -> list[Candidate]:
    """All terms that may be missing, in the catalogue's order; by the default settings where none are given.

    Of the ground only what something touches in the recording is asked; of what says where a body floats neither
    friction nor a rotor.
    """
    untouched = simulator.untouched(np.concatenate([e.states for e in recording.episodes]))
    sizes = Sizes(recording, simulator, parameters, settings or CandidateSettings())
    out = []
    for effect in FAMILIES.values():
        for on in effect.places(simulator):
            if on in untouched or (on in simulator.floating and is_row(effect)):
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
    settings = problem.run.settings.candidates
    known, parameters = problem.run.known, problem.parameters
    offers = [
        c
        for c in candidates(question.recording, problem.simulator, parameters, settings)
        if not (effect_of(c.family).site == "sensor" and c.place.on in question.hidden)  # nobody read it
        and shows(question, c)
    ]
    check_bounds(known, offers)
    return allowed(known, offers, parameters)
