"""Several recordings one by one: what the account explains of each, also when it was learnt from all others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import IntArray
from gpsim.diagnosis.assessment.rollouts import Model, rolled, whole_windows
from gpsim.diagnosis.data import Windows, rms
from gpsim.diagnosis.fitting import Fit, Hypothesis, Problem, fit
from gpsim.diagnosis.judging import SEED, Attribution, Judgement, RolloutJudge, draws, judge_at, rollouts_in
from gpsim.diagnosis.report import (
    EndErrors,
    Estimate,
    FromOthers,
    NamedEffect,
    OneRecording,
    OwnValues,
    Share,
)
from gpsim.diagnosis.setup import Completions, Question
from gpsim.effects import base_name, owner_of
from gpsim.recordings import apart
from gpsim.residuals import held_out_names

REFIT = 8  # rounds of the fit to the others
FEWEST = 3  # recordings, of which each is left out once


def by_recording(
    question: Question, judgement: Judgement, attribution: Attribution, effects: Sequence[NamedEffect]
) -> tuple[OneRecording, ...] | None:
    """Every recording with what is its own and how the account does on it; None where there is one alone."""
    parts = apart(question.recording)
    if len(parts) < 2:
        return None
    leader = judgement.leader.hypothesis
    completions = Completions(question.everything, question.recording, question.hidden, leader)
    ends = _ends(question, leader, completions)
    left_out = [_from_others(question, judgement, attribution, k) for k in range(len(parts))]
    return tuple(
        OneRecording(
            name=source.name,
            transitions=part.transition_count,
            held_out=tuple(held_out_names(part)),
            own=_own(effects, source.name),
            explained=_explained(question, attribution, place),
            rollout=ends[place],
            from_others=left_out[place],
        )
        for place, (source, part) in enumerate(zip(question.recording.sources, parts, strict=True))
    )


def _own(effects: Sequence[NamedEffect], name: str) -> tuple[OwnValues, ...]:
    found: list[OwnValues] = []
    for effect in effects:
        values: Mapping[str, Estimate] = (effect.own or {}).get(name, {})
        if values:
            found.append(OwnValues(effect.family, effect.place, values))
    return tuple(found)


def _explained(question: Question, attribution: Attribution, place: int) -> Share | None:
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


def _ends(question: Question, account: Hypothesis, completions: Completions) -> list[dict[str, EndErrors]]:
    """Of every recording, errors by measured channel at the end of its held-out rollouts."""
    models = {"before": _base(question), "after": account if account.terms else _base(question)}
    windows = {kind: whole_windows(question, completions.by(model)) for kind, model in models.items()}
    return [
        _errors(question, models, {kind: w.take(w.sources == place) for kind, w in windows.items()})
        for place in range(len(question.recording.sources))
    ]


def _base(question: Question) -> Hypothesis:
    return Hypothesis(scheme=question.recording.integrator)  # type: ignore[arg-type]  # `prepare` has checked it


def _errors(
    question: Question, models: Mapping[str, Hypothesis], windows: Mapping[str, Windows]
) -> dict[str, EndErrors]:
    problem = question.everything
    if not all(len(part) for part in windows.values()):
        return {}
    ends = {kind: rolled(problem, windows[kind], Model(model)) for kind, model in models.items()}
    return {
        channel.name: EndErrors(
            **{kind: rms(errors[:, i]) for kind, errors in ends.items()}, unit=channel.unit
        )
        for i, channel in enumerate(problem.simulator.state)
        if channel.name not in question.hidden
    }


def _from_others(
    question: Question, judgement: Judgement, attribution: Attribution, place: int
) -> FromOthers | None:
    """The account's laws with the values that all other recordings say, on all of one."""
    leader, count = judgement.leader, len(question.recording.sources)
    others = np.flatnonzero(question.everything.windows.sources != place)
    judge = attribution.judge
    if count < FEWEST or not leader.hypothesis.terms or not isinstance(judge, RolloutJudge):
        return None
    if len(others) < question.run.settings.windows.fewest:
        return None
    part = question.everything.on(question.everything.windows.take(others))
    learnt = _learnt(part, leader, place, count, others)
    places, rng = rollouts_in(question, place, judge.places.lead), np.random.default_rng(SEED)
    if not len(places):
        return None
    there = judge_at(question, learnt, judgement.null, attribution.noise, rng, places)
    share = there.mismatch.share(there.mismatch.overall(there.squares([[learnt.hypothesis]])[0]))
    models = {"before": _base(question), "after": learnt.hypothesis}
    windows = dict.fromkeys(models, there.windows)
    return FromOthers(
        explained=share if there.mismatch.counts.any() else None,
        rollout={} if judge.places.lead else _errors(question, models, windows),
    )


def _learnt(part: Problem, leader: Fit, place: int, count: int, others: IntArray) -> Fit:
    """The leader fitted to other recordings, as it would act in the one that is left out."""
    account = leader.hypothesis
    found = fit(part, account, leader.starts[others], REFIT)
    return replace(found, hypothesis=_expected(found.hypothesis, place, count))


def _expected(account: Hypothesis, place: int, count: int) -> Hypothesis:
    """What other recordings say of one: what they share, or the mean of what they have as their own.

    What its own sensors add no other recording can know, so that stays: it is judged by how the machine moves.
    """
    terms = []
    for term in account.terms:
        values = {name: v for name, v in term.values.items() if owner_of(name) != place}
        if term.effect.site == "sensor":
            values = dict(term.values)
        elif len(set(term.owners) - {place}) == count - 1:
            for base in {base_name(name) for name in values}:
                own = [
                    v for name, v in values.items() if base_name(name) == base and owner_of(name) is not None
                ]
                values[base] = float(np.mean(own)) if own else values[base]
        terms.append(replace(term, values=values))
    return replace(account, terms=tuple(terms), declared=tuple(() for _ in terms))
