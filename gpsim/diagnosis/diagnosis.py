"""Recording x simulator -> Outcome, which holds the Diagnosis."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.account import Answer, account
from gpsim.diagnosis.assessment import Comparison, compare, estimates, score
from gpsim.diagnosis.attribution import Attribution, attribute, forces_lead, supported, with_values_of_forces
from gpsim.diagnosis.fitting import Candidate
from gpsim.diagnosis.judgement import (
    Curved,
    Judgement,
    as_far_as_asked,
    beats_the_base,
    claimed,
    curved,
    doubts_of,
    judge,
    laws_of,
    verdict_of,
    withheld,
    without_claims,
)
from gpsim.diagnosis.left_open import LeftOpen, left_open_of
from gpsim.diagnosis.report import Diagnosis, Score
from gpsim.diagnosis.run import Decision, Run
from gpsim.diagnosis.selection import (
    Contenders,
    Found,
    Note,
    beam_search,
    prune_on_held_out,
    refine_grid,
    refit,
    stepwise,
    told_apart,
    told_apart_to_the_end,
    usual_machine,
    whole_robot,
    without_idle,
    without_outside_acts,
    without_tails,
)
from gpsim.diagnosis.setup import Question, is_structure, offers_of, prepare
from gpsim.effects import Scheme, closed
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

    @property
    def left_open(self) -> LeftOpen:
        """What it leaves open, in numbers."""
        return left_open_of(self.question, self.judgement, self.diagnosis)

    def score(self, recording: Recording, rng: np.random.Generator, run: Run | None = None) -> Score:
        """How the effects do on another recording; nothing is fitted (see `gpsim.diagnosis.score`)."""
        return score(recording, self.plant, None, rng, run)


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
    question, offers, found = _searched(recording, simulator, parameters, run, step)
    acted = without_outside_acts(question, found.fits[0].hypothesis, recording)
    if acted is not None:
        step("search again", 30, "without what acted from outside")
        question, offers, found = _searched(acted[0], simulator, parameters, run, step)
        question = replace(question, facts=(*question.facts, acted[1]))
    step("refit", 40, "fitting the best on all windows")
    contenders = refit(question, found)
    step("stepwise", 40)
    contenders = told_apart(question, contenders, offers)
    led = forces_lead(question, contenders.leader, offers)  # they have said which bodies and motors are off
    asked = [c for c in offers if not (led and is_structure(c))]
    contenders = stepwise(question, contenders, asked, step.by_budget(40, 90), replacing=not led)
    step("differences", 90)
    contenders = told_apart_to_the_end(question, contenders, offers, step.by_budget(90, 90))
    step("prune on held-out", 90, "asking held-out windows")
    contenders = prune_on_held_out(question, contenders)
    question = without_idle(question, contenders.leader)
    step("judge", 90, "looking for rivals, and for what is left")
    judgement = judge(question, contenders, found)
    step("support", 91, "asking each half of the recording")
    judgement = _supported(question, replace(contenders, leader=judgement.leader), found, judgement, offers)
    leader = with_values_of_forces(question, judgement.leader, judgement.null, offers)
    judgement = replace(judgement, leader=leader)
    step("attribute", 92, "how much of the mismatch each effect is")
    attribution = attribute(question, judgement.leader, judgement.null)
    step("compare", 94, "comparing on held-out data")
    answer = _answer(question, judgement, attribution, offers, rng)
    step("account", 98, "putting it together")
    diagnosis = account(question, answer)
    step("done", 100, "done")
    plant = _corrected(question, answer.judgement, recording.dt)
    return Outcome(
        diagnosis, plant, answer.judgement, answer.comparison, question, tuple(run.trace.decisions)
    )


def _searched(
    recording: Recording, simulator: Simulator, parameters: Mapping[str, float], run: Run, step: _Steps
) -> tuple[Question, list[Candidate], Found]:
    """The question that a recording asks, what is on offer, and the best explanations of a first search."""
    question = prepare(recording, simulator, parameters, run)
    offers = offers_of(question)
    step("usual machine", 5, "asking for all that machines usually have")
    usual = usual_machine(question, offers)
    step("search", 15)
    found = beam_search(question.searched, offers, _scheme(recording, simulator), step.share(15, 40), usual)
    step("refine grid", 40, "fitting the best on all windows")
    question, found = without_tails(*refine_grid(question, found))
    return question, offers, found


def _supported(
    question: Question, contenders: Contenders, found: Found, judgement: Judgement, offers: list[Candidate]
) -> Judgement:
    """The judgement of what each half of the recording supports.

    Where a term has to go, what it had displaced may come back: the search goes on without it, and without gates,
    until nothing changes.
    """
    left = list(offers)
    for _ in range(question.run.settings.support.rounds):
        before = judgement.leader
        leader = supported(question, before, judgement.null, judgement.structured, left)
        if leader is before:
            return judgement
        gone = before.hypothesis.claims - leader.hypothesis.claims
        left = [c for c in left if c.identity not in gone]
        contenders = replace(contenders, leader=leader)
        if leader.hypothesis.terms and not whole_robot(question.everything, leader.hypothesis):
            contenders = stepwise(question, contenders, left, lambda text: None, gates=False)
            contenders = prune_on_held_out(question, contenders)
        judgement = judge(question, contenders, found, settled=True)
    leader = supported(question, judgement.leader, judgement.null, judgement.structured, left)
    return judge(question, replace(contenders, leader=leader), found, settled=True)


def _answer(
    question: Question,
    judgement: Judgement,
    attribution: Attribution,
    offers: list[Candidate],
    rng: np.random.Generator,
) -> Answer:
    """What may be said: nothing of an account that is no better than the base on held-out data."""
    settings = question.run.settings
    named = Curved(judgement, attribution, laws_of(question, judgement, attribution))
    found = curved(question, named, offers)
    comparison = _compared(question, found, offers, rng)
    if found is not named and not _is_better(found, comparison):  # the curve is its recording's own
        found, comparison = named, _compared(question, named, offers, rng)
    if found.judgement.leader.hypothesis.terms and not _is_better(found, comparison):
        judgement = withheld(question, judgement)
        attribution = attribute(question, judgement.leader, judgement.null)
        found = Curved(judgement, attribution, laws_of(question, judgement, attribution))
        comparison = _compared(question, found, offers, rng)
    judgement, attribution, laws = found.judgement, found.attribution, found.laws
    sizes = estimates(question, judgement.leader, judgement.lack, 1.0 - attribution.share.share)
    attribution = claimed(judgement, attribution, sizes)
    doubts = doubts_of(judgement, attribution, laws.forms, sizes, comparison.black_box, settings)
    verdict = verdict_of(judgement, attribution, doubts, settings)
    verdict = as_far_as_asked(verdict, attribution, question.run.known)
    if verdict == "unknown":
        attribution, doubts = without_claims(attribution), ()
    return Answer(verdict, judgement, attribution, comparison, laws, sizes, doubts, found.curves)


def _compared(
    question: Question, found: Curved, offers: list[Candidate], rng: np.random.Generator
) -> Comparison:
    partial = found.attribution.share.share < question.run.settings.verdict.nearly_all
    return compare(question, found.judgement, offers, rng, found.attribution.noise, partial, found.laws.free)


def _is_better(found: Curved, comparison: Comparison) -> bool:
    """Whether an account is better than the base on held-out data."""
    return beats_the_base(found.attribution, comparison.one_step.values())


def _scheme(recording: Recording, simulator: Simulator) -> Scheme:
    if closed(simulator) is not None:  # it has but one way to step
        return "fine"
    return recording.integrator  # type: ignore[return-value]  # `prepare` has checked it


def _corrected(question: Question, judgement: Judgement, dt: float) -> EffectsPlant:
    """The simulator with the leading effects, without a Gaussian process."""
    problem, leader = question.everything, judgement.leader.hypothesis
    if question.recording.sources:  # the machine as it is in the last one
        leader = leader.in_recording(len(question.recording.sources) - 1)
    substeps = math.ceil(problem.substeps / question.thinned)  # those are of a thinned transition
    if (system := closed(question.whole)) is not None:  # which goes by its own
        substeps = system.steps_of(dt)
    return EffectsPlant(
        question.whole,  # in which the recording's angles wrap
        dict(problem.parameters),
        tuple(each for term in leader.terms for each in term.apart),
        leader.scheme if leader.terms else _scheme(question.recording, question.whole),
        substeps,
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
