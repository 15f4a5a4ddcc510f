"""An existing answer on another recording: base, base + effects, and + Gaussian process; nothing is fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant, Features, GpCorrection
from gpsim.diagnosis.assessment.bootstrap import MODELS, over_before
from gpsim.diagnosis.assessment.comparison import shown_rates, steps_of
from gpsim.diagnosis.assessment.remainder_gp import measured_rates, residual_rates
from gpsim.diagnosis.assessment.rollouts import Model, rolled, whole_windows
from gpsim.diagnosis.data import rms
from gpsim.diagnosis.fitting import Extra, Hypothesis, Problem, fit
from gpsim.diagnosis.judging import explained_by
from gpsim.diagnosis.report import Explained, Ratio, Score, Scored
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.setup import Completions, Question, prepare
from gpsim.effects import closed
from gpsim.errors import UsageError
from gpsim.recordings import HeldOut, Recording


@dataclass(frozen=True)
class Judged:
    """A question to a new recording, and the models that answer it: `before`, `after` and, with one, `after_gp`."""

    question: Question
    models: Mapping[str, Model]
    without_gp: str


def score(
    recording: Recording,
    corrected: EffectsPlant,
    with_gp: EffectsPlant | None,
    rng: np.random.Generator,
    run: Run | None = None,
) -> Score:
    """How the corrected simulator does on all of a recording that it need not know, beside the base simulator.

    A diagnosis.json alone lacks the simulator: the corrected one brings it, with the base's parameters. with_gp: the
    same with the Gaussian process on the remainder, which may stand in the effects' place. Raises UsageError where
    simulator and recording do not go together.
    """
    judged = posed(recording, corrected, with_gp, run)
    question = judged.question
    one_step, steps = _one_step(judged, rng)
    runs = {kind: _rolled(judged, model) for kind, model in judged.models.items()}
    after, count = {}, len(next(iter(runs.values()))[0])
    for i, channel in enumerate(question.everything.simulator.state):
        if channel.name not in question.hidden and count:
            errors = {kind: drift[:, i] for kind, (drift, _) in runs.items()}
            spread = float(np.std(runs["before"][1][:, i]))
            over = over_before(_all_kinds(errors), rng, correlated=False).after
            after[channel.name] = _scored(errors, channel.unit, spread, over)
    windows = whole_windows(question, question.recording)
    horizon = windows.length * question.recording.dt if len(windows) else 0.0
    return Score(
        one_step=one_step,
        rollout=after,
        horizon_s=horizon,
        transitions=question.recording.transition_count,
        steps=steps,
        rollouts=count,
        thinned=question.thinned,
        explained=_explained(judged),
        without_gp=judged.without_gp,
    )


def _explained(judged: Judged) -> Explained | None:
    """How much of the mismatch the effects take off here; None where there are none."""
    problem, base, after = (
        judged.question.everything,
        *(judged.models[k].hypothesis for k in ("before", "after")),
    )
    if not after.terms:
        return None
    null = replace(base, scheme=after.scheme)
    leader, bare = (fit(problem, h.frozen()) for h in (after, null))
    return explained_by(judged.question, leader, bare)


def posed(
    recording: Recording, corrected: EffectsPlant, with_gp: EffectsPlant | None, run: Run | None = None
) -> Judged:
    """The whole recording as a question, and the models as hypotheses."""
    whole = replace(recording, held_out=HeldOut(share=0.0))
    question = prepare(whole, corrected.simulator, corrected.parameters, run)
    finer = max(question.everything.substeps, corrected.substeps * question.thinned)
    if closed(corrected.simulator) is not None:  # in steps that are exact enough
        finer = question.everything.substeps
    problem = replace(question.everything, substeps=finer)
    question = replace(question, everything=problem)
    base = Hypothesis(scheme=recording.integrator)  # type: ignore[arg-type]  # `prepare` has checked it
    models = {"before": Model(base), "after": Model(_hypothesis(corrected, base))}
    why = "the diagnosis has none" if with_gp is None else ""
    if with_gp is not None:
        extra = _process(with_gp, problem)
        why = "" if extra else "it needs channels that this recording does not show"
        if extra:
            models["after_gp"] = Model(_hypothesis(with_gp, base), extra)
    return Judged(question, models, why)


def _hypothesis(plant: EffectsPlant, base: Hypothesis) -> Hypothesis:
    """The plant's terms, all begun and nothing of them to be fitted."""
    terms = plant.chain.terms
    return Hypothesis(terms, tuple(() for _ in terms), plant.scheme) if terms else base


def _process(plant: EffectsPlant, problem: Problem) -> Extra | None:
    """The rates that the plant's Gaussian process adds; None where it asks for what is not shown here."""
    correction = plant.correction
    if not isinstance(correction, GpCorrection):
        return None
    try:
        features = Features.of(correction.features.items, problem.simulator.state + problem.simulator.action)
    except UsageError:
        return None

    def rates(state: FloatArray, action: FloatArray, transition: int = 0) -> FloatArray:
        return correction.predictor.mean(features(np.hstack([state, action])))

    return rates


def _one_step(judged: Judged, rng: np.random.Generator) -> tuple[dict[str, Scored], int]:
    """Errors of every rate that was measured, and how many transitions were looked at."""
    question, problem = judged.question, judged.question.everything
    hypotheses = {kind: model.hypothesis for kind, model in judged.models.items()}
    steps = steps_of(question, hypotheses, _completions(judged))
    left = {
        kind: residual_rates(problem, steps[kind].test, model.hypothesis, model.extra)
        for kind, model in judged.models.items()
    }
    measured = measured_rates(problem, steps["after"].test)
    out = {}
    for i, channel in enumerate(problem.simulator.rate):
        if shown_rates(question)[i]:
            errors = {kind: rates[:, i] for kind, rates in left.items()}
            over = over_before(_all_kinds(errors), rng).after
            out[channel.name] = _scored(errors, channel.unit, float(measured[:, i].std()), over)
    return out, len(measured)


def _rolled(judged: Judged, model: Model) -> tuple[FloatArray, FloatArray]:
    """(W, S) how far a model has drifted after the horizon, and what was measured there."""
    question = judged.question
    windows = whole_windows(question, _completions(judged).by(model.hypothesis))
    if not len(windows):
        none = np.empty((0, len(question.everything.simulator.state)))
        return none, none
    return rolled(question.everything, windows, model), windows.measured[:, -1]


def _completions(judged: Judged) -> Completions:
    question, account = judged.question, judged.models["after"].hypothesis
    return Completions(question.everything, question.recording, question.hidden, account)


def _all_kinds(errors: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """What the bootstrap compares; models that are not judged here stand for the base."""
    return {kind: errors.get(kind, errors["before"]) for kind in MODELS}


def _scored(errors: Mapping[str, FloatArray], unit: str, spread: float, over: Ratio) -> Scored:
    sizes = {kind: rms(e) for kind, e in errors.items()}
    return Scored(
        unit=unit,
        before=sizes["before"],
        after=sizes["after"],
        after_gp=sizes.get("after_gp"),
        spread=spread,
        over_before=over,
    )
