"""An account on recordings one by one.

An existing answer on another recording: base, base + effects, and + Gaussian process; nothing is fitted. Of several
that were judged together, what it explains of each, also when it was learnt from all others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import Channel, FloatArray
from gpsim.corrected import EffectsPlant, Features, GpCorrection
from gpsim.diagnosis.assessment.comparison import shown_rates, steps_of
from gpsim.diagnosis.assessment.remainder_gp import measured_rates, residual_rates
from gpsim.diagnosis.assessment.rollouts import (
    Model,
    base_of,
    over_before,
    rolled,
    shown_channels,
    whole_windows,
)
from gpsim.diagnosis.data import Windows, at, rms
from gpsim.diagnosis.fitting import Extra, Hypothesis, Problem, fit, predicted
from gpsim.diagnosis.judging import (
    SEED,
    Attribution,
    Judgement,
    RolloutJudge,
    draws,
    explained_by,
    judge_at,
    rollouts_in,
)
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.setup import Completions, PreparedProblem, prepare
from gpsim.effects import base_name, closed, owner_of
from gpsim.errors import UsageError
from gpsim.findings import (
    EndErrors,
    Explained,
    FromOthers,
    NamedEffect,
    OneRecording,
    OwnValues,
    Score,
    Scored,
    Share,
)
from gpsim.recordings import HeldOut, Recording, apart
from gpsim.residuals import held_out_names

REFIT = 8  # rounds of the fit to the other recordings
FEWEST = 3  # recordings, of which each is left out once


@dataclass(frozen=True)
class Judged:
    """A question to a new recording, and the models that answer it: `before`, `after` and, with one, `after_gp`."""

    question: PreparedProblem
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
    question, problem = judged.question, judged.question.everything
    hypotheses = {kind: model.hypothesis for kind, model in judged.models.items()}
    completions = Completions(problem, question.recording, question.hidden, hypotheses["after"])
    steps = steps_of(question, hypotheses, completions)
    left = {
        kind: residual_rates(problem, steps[kind].test, model.hypothesis, model.extra)
        for kind, model in judged.models.items()
    }
    rates = measured_rates(problem, steps["after"].test)
    one_step = _scored(left, shown_rates(question), rates, rng, correlated=True)
    runs = {kind: whole_windows(question, completions.by(h)) for kind, h in hypotheses.items()}
    count, rollout = len(runs["before"]), {}
    if count:
        ends = {kind: rolled(problem, runs[kind], model) for kind, model in judged.models.items()}
        measured = runs["before"].measured[:, -1]
        rollout = _scored(ends, shown_channels(question), measured, rng, correlated=False)
    return Score(
        one_step=one_step,
        rollout=rollout,
        horizon_s=runs["before"].length * question.recording.dt if count else 0.0,
        transitions=question.recording.transition_count,
        steps=len(rates),
        rollouts=count,
        thinned=question.thinned,
        explained=_explained(question, hypotheses["before"], hypotheses["after"]),
        without_gp=judged.without_gp,
    )


def _scored(
    errors: Mapping[str, FloatArray],
    shown: Sequence[tuple[int, Channel]],
    measured: FloatArray,
    rng: np.random.Generator,
    *,
    correlated: bool,
) -> dict[str, Scored]:
    """Of the columns that are shown. errors: (N, C) of each model; measured: (N, C); correlated: see `over_before`."""
    out = {}
    for i, channel in shown:
        own = {kind: e[:, i] for kind, e in errors.items()}
        out[channel.name] = Scored(
            unit=channel.unit,
            before=rms(own["before"]),
            after=rms(own["after"]),
            after_gp=rms(own["after_gp"]) if "after_gp" in own else None,
            spread=float(measured[:, i].std()),
            over_before=over_before(own, rng, correlated=correlated)["after"],
        )
    return out


def _explained(question: PreparedProblem, base: Hypothesis, after: Hypothesis) -> Explained | None:
    """How much of the mismatch the effects take off here; None where there are none."""
    if not after.terms:
        return None
    null = replace(base, scheme=after.scheme)
    leader, bare = (fit(question.everything, h.frozen()) for h in (after, null))
    return explained_by(question, leader, bare)


def posed(
    recording: Recording, corrected: EffectsPlant, with_gp: EffectsPlant | None, run: Run | None = None
) -> Judged:
    """The whole recording as a question, and the models as hypotheses."""
    whole = replace(recording, held_out=HeldOut(share=0.0))
    question = prepare(whole, corrected.simulator, corrected.parameters, run)
    problem = question.everything
    if closed(corrected.simulator) is None:  # else in steps that are exact enough
        problem = replace(problem, substeps=max(problem.substeps, corrected.substeps * question.thinned))
    question, base = replace(question, everything=problem), base_of(question)
    models = {"before": Model(base), "after": Model(_hypothesis(corrected, base))}
    if with_gp is None:
        return Judged(question, models, "the diagnosis has none")
    extra = _process(with_gp, problem)
    if extra is None:
        return Judged(question, models, "it needs channels that this recording does not have")
    return Judged(question, {**models, "after_gp": Model(_hypothesis(with_gp, base), extra)}, "")


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


def replayed(
    plant: EffectsPlant, recording: Recording, places: Sequence[tuple[int, int]], steps: int
) -> FloatArray:
    """(B, T + 1, S): what the corrected sensors would say over T = steps, from measured states on.

    places: episode and sample at which each of the B rollouts begins; the recording's clock is the one on which the
    plant's onsets and ages are moments. What was commanded before is remembered, sensors are read backwards at the
    start to find the true state. Named effects alone: a Gaussian process beside them is left out.
    """
    windows, size = at(recording, places, steps), len(plant.state)
    every, scale = np.ones(size, dtype=np.bool_), np.maximum(windows.measured.std(axis=(0, 1)), 1e-9)
    problem = Problem(
        plant.simulator, plant.parameters, plant.dt, windows, every, np.zeros(size), ~every, scale,
        plant.substeps, run=Run(),
    )  # fmt: skip
    hypothesis = Hypothesis(plant.terms, tuple(() for _ in plant.terms), plant.scheme)
    return predicted(problem, windows, hypothesis)


def by_recording(
    question: PreparedProblem, judgement: Judgement, attribution: Attribution, effects: Sequence[NamedEffect]
) -> tuple[OneRecording, ...] | None:
    """Every recording with what is its own and how the account does on it; None where there is one alone."""
    parts = apart(question.recording)
    if len(parts) < 2:
        return None
    leader, base = judgement.leader.hypothesis, base_of(question)
    completions = Completions(question.everything, question.recording, question.hidden, leader)
    models = {"before": base, "after": leader if leader.terms else base}
    windows = {kind: whole_windows(question, completions.by(model)) for kind, model in models.items()}
    out = []
    for place, (source, part) in enumerate(zip(question.recording.sources, parts, strict=True)):
        values = [(e.family, e.place, (e.own or {}).get(source.name)) for e in effects]
        out.append(
            OneRecording(
                name=source.name,
                transitions=part.transition_count,
                held_out=tuple(held_out_names(part)),
                own=tuple(OwnValues(family, on, own) for family, on, own in values if own),
                explained=_explained_of(question, attribution, place),
                rollout=_errors(
                    question, models, {k: w.take(w.sources == place) for k, w in windows.items()}
                ),
                from_others=_from_others(question, judgement, attribution, place),
            )
        )
    return tuple(out)


def _explained_of(question: PreparedProblem, attribution: Attribution, place: int) -> Share | None:
    """What the account takes off the mismatch of one recording, on what judges it as a whole."""
    judge = attribution.judge
    if isinstance(judge, RolloutJudge):
        of = np.zeros(judge.places.blocks, np.int64)
        of[judge.places.block] = judge.windows.sources
    else:
        of = question.everything.windows.sources
    rows = np.flatnonzero(of == place)
    if not len(rows):
        return None
    mismatch = judge.mismatch
    drawn = draws(len(rows), question.run.settings.rollouts.draws, np.random.default_rng(SEED))
    part = replace(mismatch, before=mismatch.before[rows], floor=mismatch.floor[rows], drawn=drawn)
    return part.share(part.overall(attribution.squares[rows])) if part.counts.any() else None


def _errors(
    question: PreparedProblem, models: Mapping[str, Hypothesis], windows: Mapping[str, Windows]
) -> dict[str, EndErrors]:
    """By measured channel at the ends of rollouts; empty where a model has none."""
    problem = question.everything
    if not all(len(part) for part in windows.values()):
        return {}
    ends = {kind: rolled(problem, windows[kind], Model(model)) for kind, model in models.items()}
    return {
        channel.name: EndErrors(**{kind: rms(e[:, i]) for kind, e in ends.items()}, unit=channel.unit)
        for i, channel in shown_channels(question)
    }


def _from_others(
    question: PreparedProblem, judgement: Judgement, attribution: Attribution, place: int
) -> FromOthers | None:
    """The account's laws with the values that all other recordings say, on all of one."""
    leader, count, problem = judgement.leader, len(question.recording.sources), question.everything
    others = np.flatnonzero(problem.windows.sources != place)
    judge = attribution.judge
    if count < FEWEST or not leader.hypothesis.terms or not isinstance(judge, RolloutJudge):
        return None
    if len(others) < question.run.settings.windows.fewest:
        return None
    found = fit(problem.on(problem.windows.take(others)), leader.hypothesis, leader.starts[others], REFIT)
    learnt = replace(found, hypothesis=expected(found.hypothesis, place, count))
    places, rng = rollouts_in(question, place, judge.places.lead), np.random.default_rng(SEED)
    if not len(places):
        return None
    there = judge_at(question, learnt, judgement.null, attribution.noise, rng, places)
    share = there.mismatch.share(there.mismatch.overall(there.squares([[learnt.hypothesis]])[0]))
    models = {"before": base_of(question), "after": learnt.hypothesis}
    windows = dict.fromkeys(models, there.windows)
    return FromOthers(
        explained=share if there.mismatch.counts.any() else None,
        rollout={} if judge.places.lead else _errors(question, models, windows),
    )


def expected(account: Hypothesis, place: int, count: int) -> Hypothesis:
    """What other recordings say of one: what they share, or the mean of what they have as their own.

    What its own sensors add no other recording can know, so that stays: it is judged by how the machine moves.
    """
    terms = []
    for term in account.terms:
        values = dict(term.values)
        if term.effect.site != "sensor":
            values = {name: v for name, v in values.items() if owner_of(name) != place}
            own: dict[str, list[float]] = {}
            for name, v in values.items():
                if owner_of(name) is not None:
                    own.setdefault(base_name(name), []).append(v)
            if len(set(term.owners) - {place}) == count - 1:
                values |= {base: float(np.mean(each)) for base, each in own.items()}
        terms.append(replace(term, values=values))
    return replace(account, terms=tuple(terms), declared=tuple(() for _ in terms))
