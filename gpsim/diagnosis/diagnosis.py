"""Recording x simulator -> Outcome, which holds the Diagnosis."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.account import account
from gpsim.diagnosis.assessment import Comparison, compare
from gpsim.diagnosis.judgement import Judgement, judge
from gpsim.diagnosis.report import Diagnosis
from gpsim.diagnosis.run import Decision, Run
from gpsim.diagnosis.selection import (
    Note,
    beam_search,
    prune_on_held_out,
    refine_grid,
    refit,
    stepwise,
    without_tails,
)
from gpsim.diagnosis.setup import Question, offers_of, prepare
from gpsim.effects import Scheme
from gpsim.recordings import Recording
from gpsim.simulators import Simulator

USUAL_EFFORT = 1.5e8  # simulated rows that a judgement takes: a scale for its progress


@dataclass(frozen=True)
class Outcome:
    """What was found, and what it rests on.

    plant: the corrected simulator, without its Gaussian process; decisions: all that were made, in their order.
    """

    diagnosis: Diagnosis
    plant: EffectsPlant
    judgement: Judgement
    comparison: Comparison
    question: Question
    decisions: tuple[Decision, ...]


def diagnose(
    recording: Recording,
    simulator: Simulator,
    parameters: Mapping[str, float],
    rng: np.random.Generator,
    note: Note = lambda done, total, text: None,
    run: Run | None = None,
) -> Outcome:
    """Locate, name, model and judge; raises UsageError where nothing can be said.

    The pipeline on one page; every step takes what those before it returned. run: settings, and workers to share the
    work with; the defaults and nobody without one.
    """
    run = run or Run()
    step = _Steps(run, note)
    step("prepare", 0, "cutting windows")
    question = prepare(recording, simulator, parameters, run)
    offers = offers_of(question)
    step("search", 5)
    found = beam_search(question.searched, offers, _scheme(recording), step.share(5, 40))
    step("refine grid", 40, "fitting the best on all windows")
    question, found = without_tails(*refine_grid(question, found))
    step("refit", 40, "fitting the best on all windows")
    contenders = refit(question, found)
    step("stepwise", 40)
    contenders = stepwise(question, contenders, offers, step.by_budget(40, 90))
    step("prune on held-out", 90, "asking held-out windows")
    contenders = prune_on_held_out(question, contenders)
    step("judge", 90, "looking for rivals, and for what is left")
    judgement = judge(question, contenders, found)
    step("compare", 90, "comparing on held-out data")
    comparison = compare(question, judgement, offers, rng)
    step("account", 95, "putting it together")
    diagnosis = account(question, judgement, comparison)
    step("done", 100, "done")
    plant = _corrected(question, judgement, recording.dt)
    return Outcome(diagnosis, plant, judgement, comparison, question, tuple(run.trace.decisions))


def _scheme(recording: Recording) -> Scheme:
    return recording.integrator  # type: ignore[return-value]  # `prepare` has checked it


def _corrected(question: Question, judgement: Judgement, dt: float) -> EffectsPlant:
    """The simulator with the leading effects, without a Gaussian process."""
    problem, leader = question.everything, judgement.leader.hypothesis
    return EffectsPlant(
        problem.simulator,  # in which the recording's angles wrap
        dict(problem.parameters),
        leader.terms,
        leader.scheme if leader.terms else _scheme(question.recording),
        math.ceil(problem.substeps / question.thinned),  # those are of a thinned transition
        dt,
    )


@dataclass(frozen=True)
class _Steps:
    """Tells what is going on, and writes down for which step decisions are made."""

    run: Run
    note: Note

    def __call__(self, name: str, done: int, text: str = "") -> None:
        self.run.trace.step = name
        if text:
            self.note(done, 100, text)

    def share(self, first: int, last: int) -> Note:
        """A step's own progress as a part of the whole."""
        return lambda done, total, text: self.note(first + (last - first) * done // total, 100, text)

    def by_budget(self, first: int, last: int) -> Callable[[str], None]:
        """Progress from `first` on, the slower the nearer to `last`: how many rounds there will be nobody knows."""
        budget, begun = self.run.budget, self.run.budget.spent

        def tell(text: str) -> None:
            done = last - round((last - first) * math.exp(-(budget.spent - begun) / USUAL_EFFORT))
            self.note(done, 100, text)

        return tell
