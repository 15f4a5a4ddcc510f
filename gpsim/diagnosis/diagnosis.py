"""Recording x simulator -> Outcome, which holds the Diagnosis."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.account import account
from gpsim.diagnosis.assessment import Comparison, compare
from gpsim.diagnosis.fitting import Fit, begin, spent
from gpsim.diagnosis.judgement import Judgement, judge
from gpsim.diagnosis.report import Diagnosis
from gpsim.diagnosis.selection import Found, Note, lean, search, simplest_on_fine_grid
from gpsim.diagnosis.setup import Question, candidates, prepare, settled_question
from gpsim.effects import Scheme, effect_of
from gpsim.recordings import Recording
from gpsim.simulators import Simulator

USUAL_EFFORT = 1.5e8  # simulated rows that a judgement takes: a scale for its progress


@dataclass(frozen=True)
class Outcome:
    """What was found, and what it rests on. plant: the corrected simulator, without its Gaussian process."""

    diagnosis: Diagnosis
    plant: EffectsPlant
    judgement: Judgement
    comparison: Comparison
    question: Question


def diagnose(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
    rng: np.random.Generator,
    note: Note = lambda done, total, text: None,
) -> Outcome:
    """Locate, name, model and judge; raises UsageError where nothing can be said."""
    begin()
    note(0, 100, "cutting windows")
    question = prepare(recording, simulator, parameters)
    simulator = question.everything.simulator  # in which the recording's angles wrap
    offers = [
        c
        for c in candidates(question.recording, simulator, parameters)
        if not (effect_of(c.family).site == "sensor" and c.place.on in question.hidden)  # nobody read it
    ]
    base: Scheme = recording.integrator  # type: ignore[assignment]  # `prepare` has checked it
    found = search(question.searched, offers, base, lambda d, t, text: note(5 + 35 * d // t, 100, text))
    note(40, 100, "fitting the best on all windows")
    best, on_fine_grid = _best(found)
    question = settled_question(question, best)
    found = replace(found, fits=[on_fine_grid, *found.fits])
    judgement = judge(question, found, offers, _by_effort(note, 40, 90))
    note(90, 100, "comparing on held-out data")
    comparison = compare(question, judgement, offers, rng)
    diagnosis = account(question, judgement, comparison)
    leader = judgement.leader.hypothesis
    plant = EffectsPlant(
        simulator,
        dict(parameters),
        leader.terms,
        leader.scheme if leader.terms else base,
        math.ceil(question.everything.substeps / question.thinned),  # those are of a thinned transition
        recording.dt,
    )
    note(100, 100, "done")
    return Outcome(diagnosis, plant, judgement, comparison, question)


def _by_effort(note: Note, first: int, last: int) -> Callable[[str], None]:
    """Progress from `first` on, the slower the nearer to `last`: how many rounds there will be nobody knows."""
    begun = spent()

    def tell(text: str) -> None:
        note(last - round((last - first) * math.exp(-(spent() - begun) / USUAL_EFFORT)), 100, text)

    return tell


def _best(found: Found) -> tuple[Fit, Fit]:
    """The best of the search, without what only makes up for a coarse grid: what is left then asks for a fine one.

    As it was fitted, and on the grid on which it is the best.
    """
    best = found.fits[0]
    if any(t.gate.region for t in best.hypothesis.terms):
        best = lean(found.problem, best)
    return simplest_on_fine_grid(found.problem, best, found.fits)
