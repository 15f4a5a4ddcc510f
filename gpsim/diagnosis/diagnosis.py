"""Recording x simulator -> Outcome, which holds the Diagnosis."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.account import Answer, account
from gpsim.diagnosis.assessment import Comparison, averaged, compare, score
from gpsim.diagnosis.fitting import Candidate, Hypothesis, fit
from gpsim.diagnosis.judging import (
    Judgement,
    attribute,
    claimed,
    doubts_of,
    forms_of,
    verdict_of,
)
from gpsim.diagnosis.ladder import Climbed, climb
from gpsim.diagnosis.run import Decision, Run
from gpsim.diagnosis.setup import PreparedProblem, offers_of, prepare
from gpsim.effects import closed
from gpsim.findings import Diagnosis, Score
from gpsim.recordings import Recording
from gpsim.simulators import Simulator

Note = Callable[[int, int, str], None]
"""Tells a caller that `done` of `total` is done, and what is going on."""


@dataclass(frozen=True)
class Outcome:
    """What was found, and what it rests on.

    plant: the corrected simulator, without its Gaussian process; decisions: all that were made, in their order.
    """

    diagnosis: Diagnosis
    plant: EffectsPlant
    judgement: Judgement
    comparison: Comparison
    question: PreparedProblem
    decisions: tuple[Decision, ...]

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

    run: settings, what the user knows, threads; the defaults without one.
    """
    run = run or Run()

    def step(name: str, done: int, text: str = "") -> None:
        run.trace.step = name
        if text:
            note(done, 100, text)

    step("rung 0", 0, "cutting windows")
    question = prepare(recording, simulator, parameters, run)
    offers = offers_of(question)
    climbed = climb(question, offers, step)
    answer = _answer(climbed, offers, rng, step)
    step("account", 98, "putting it together")
    diagnosis = account(climbed.question, answer)
    note(100, 100, "done")
    plant = _corrected(climbed.question, answer.judgement, recording.dt)
    return Outcome(
        diagnosis, plant, answer.judgement, answer.comparison, climbed.question, tuple(run.trace.decisions)
    )


def _answer(
    climbed: Climbed, offers: list[Candidate], rng: np.random.Generator, step: Callable[[str, int, str], None]
) -> Answer:
    """What may be said: nothing of an account that is no better than the base on held-out data."""
    question, judgement, curves = climbed.question, climbed.judgement, climbed.curves
    settings = question.run.settings
    step("attribute", 80, "computing the share of each effect")
    attribution = attribute(question, judgement.leader, judgement.null, judgement.without, judgement.gains)
    step("rung 4", 88, "comparing on held-out data")
    comparison = compare(question, judgement, attribution, offers, rng)
    if judgement.leader.hypothesis.terms and attribution.share.share <= 0.0:
        question.run.trace.note(
            judgement.leader.hypothesis.names, (), False, "worse than the base on held-out data"
        )
        judgement, curves = _withheld(question, judgement), {}
        attribution = attribute(question, judgement.leader, judgement.null, (), ())
        comparison = compare(question, judgement, attribution, offers, rng)
    left = 1.0 - attribution.share.share
    sizes = averaged(question, judgement.leader, judgement.rivals, judgement.probabilities, left)
    attribution = replace(attribution, roles=claimed(judgement, attribution, sizes))
    forms = forms_of(judgement, attribution, climbed.asked, climbed.bent, settings.verdict)
    doubts = tuple(doubts_of(judgement, attribution, forms, sizes, comparison.black_box, settings))
    verdict = verdict_of(judgement, attribution, doubts, settings, question.run.known)
    if verdict == "unknown":
        attribution = replace(attribution, roles=tuple("slight" for _ in attribution.roles))
        doubts = ()
    return Answer(verdict, judgement, attribution, comparison, forms, sizes, doubts, curves)


def _withheld(question: PreparedProblem, judgement: Judgement) -> Judgement:
    """The judgement of the base alone, where the leader is not worth telling."""
    null = fit(
        question.everything, Hypothesis(scheme=judgement.null.hypothesis.scheme), judgement.null.starts
    )
    tried = replace(judgement.ranking[0], refused="it is worse than the base on held-out data")
    return replace(
        judgement,
        leader=null,
        null=null,
        without=(),
        gains=(),
        rivals=(),
        probabilities=(1.0,),
        ranking=(tried, *judgement.ranking[1:]),
        noise=null.noise.white,
        structured=True,
    )


def _corrected(question: PreparedProblem, judgement: Judgement, dt: float) -> EffectsPlant:
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
        leader.scheme if leader.terms or system else question.recording.integrator,  # type: ignore[arg-type]
        substeps,
        dt,
    )
