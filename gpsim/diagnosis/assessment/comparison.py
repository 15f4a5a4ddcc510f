"""The fit on held-out data: base, base tuned, base + GP, base + effects, base + effects + GP, and the noise floor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.artifacts import WarningLog
from gpsim.channels import Channel, FloatArray, IntArray
from gpsim.diagnosis.assessment.remainder_gp import (
    Corrected,
    Learnt,
    best,
    black_box,
    inputs,
    learn,
    left_with,
    measured_rates,
    residual_rates,
    strays,
    why_not,
    with_a_past,
)
from gpsim.diagnosis.assessment.rollouts import (
    MODELS,
    TINY,
    Model,
    base_of,
    drifts,
    free_length,
    free_runs,
    over_before,
    rollouts,
    share_explained,
    shown_channels,
    whole_windows,
)
from gpsim.diagnosis.data import Windows, cut, held_out_mask, rms, since_reversal, typical
from gpsim.diagnosis.fitting import Candidate, Hypothesis, Problem, fit, predicted
from gpsim.diagnosis.judging import Attribution, Judgement
from gpsim.diagnosis.setup import FEWEST_WITHOUT_CONTACT, Completions, PreparedProblem, apart, filters, undone
from gpsim.effects import ParameterEffect, closed, effect_of
from gpsim.findings import (
    BlackBox,
    BoxKind,
    Kind,
    ModelErrors,
    NoGp,
    OverBefore,
    Rollout,
    Share,
    StepErrors,
)
from gpsim.recordings import Recording, evenly

STEPS_LOOKED_AT = 6_000  # transitions evenly spread, from which these are taken
TUNED_ROUNDS = 6  # of the fit of the base simulator's own parameters
TUNED_OF_A_ROBOT = 2, 16  # the same, and windows, where each is dear
TUNED_GAIN = 0.02  # of the base's misfit, that tuning must take off to be told

KINDS: tuple[Kind, ...] = (*MODELS, "noise_floor")


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Errors by rate (one_step) and by channel (rollout), and the Gaussian process on what the effects leave.

    shares: of each rate's mismatch one step ahead, that the effects take off.
    black_box: what could be predicted. corrected: what that process goes with; None where simulations are no better
    with one, `why_no_gp` says why.
    inputs: (N, S + A) state and action at training transitions; times: (N,) s; episodes: (N,) their numbers;
    since_reversal: of commands and velocities, (N,) s;
    left_before, left_after: (N, R) their residual rates under the base and under the effects; mishaps: lines about
    what could not be fitted.
    """

    one_step: dict[str, StepErrors]
    shares: dict[str, Share]
    rollout: Rollout
    black_box: BlackBox | None
    tuned: dict[str, float]
    corrected: Corrected | None
    why_no_gp: NoGp | None
    inputs: FloatArray
    times: FloatArray
    episodes: IntArray
    since_reversal: Mapping[str, FloatArray]
    left_before: FloatArray
    left_after: FloatArray
    mishaps: tuple[str, ...] = ()


@dataclass(frozen=True)
class Steps:
    """Single transitions, to learn from and held out, completed by a hypothesis where channels are hidden."""

    train: Windows
    test: Windows


def compare(
    question: PreparedProblem,
    judgement: Judgement,
    attribution: Attribution,
    offers: list[Candidate],
    rng: np.random.Generator,
) -> Comparison:
    """Fit what has to be fitted on training data, and judge all of it on held-out data."""
    problem, noise = question.everything, attribution.noise
    base = base_of(question)
    after = judgement.leader.hypothesis if judgement.leader.hypothesis.terms else base
    hypotheses = {"before": base, "tuned": _tuned(question, offers, base), "after": after}
    if judgement.leader.hypothesis == Hypothesis() and base.scheme != "fine":
        hypotheses["finely"] = Hypothesis()
    completions = Completions(problem, question.recording, question.hidden, after)
    steps = steps_of(question, hypotheses, completions)
    rates = {kind: residual_rates(problem, steps[kind].test, h) for kind, h in hypotheses.items()}
    train, mishaps, alone, both, beside = steps["before"].train, WarningLog(), None, None, None
    why: NoGp | None = NoGp("not fitted")
    rates["gp"], rates["after_gp"] = rates["before"], rates["after"]
    with mishaps.contained("no Gaussian process with the base simulator"):
        learnt = learn(problem, train, base, rng)
        rates["gp"] = left_with(problem, steps["before"].test, base, rates["before"], learnt)
        alone = learnt
    with mishaps.contained("no Gaussian process on the remainder"):
        both, why, beside = _remainder(
            question, judgement, attribution, hypotheses, steps, completions, alone, rng
        )
    if both is not None:
        kind = "after" if both.hypothesis == after else "before"
        test = steps[kind].test
        rates["after_gp"] = left_with(problem, test, both.hypothesis, rates[kind], both.learnt)
    rates["noise_floor"] = _noise_rates(problem, steps["after"].test, after, noise, rng)
    models = {
        "before": Model(base),
        "tuned": Model(hypotheses["tuned"]),
        "gp": Model(base, alone.rates if alone else None),
        "after_gp": Model(both.hypothesis, both.learnt.rates) if both else Model(after),
    }
    boxes: dict[BoxKind, str] = {"gp": "gp"} if alone and judgement.structured else {}
    if beside is not None:
        boxes["after_gp"] = "beside"
        models["beside"] = Model(after, beside.rates)
    models["after"] = Model(after)  # the last one: of its rollouts it is told what noise makes
    measured = measured_rates(problem, steps["after"].test)
    one_step, shares = _one_step(question, rates, measured, rng), _step_shares(question, rates, rng)
    drifted = drifts(question, models, noise, rng, completions)
    box = black_box(boxes, drifted, [i for i, _ in shown_channels(question)])
    name = None if box is None else boxes[box.model]
    if box is not None and name is not None:
        test = steps["before" if box.model == "gp" else "after"].test
        left = residual_rates(problem, test, models[name].hypothesis, models[name].extra)
        one_step = {
            n: replace(e, black_box=rms(left[:, problem.simulator.rate.index(n)]))
            for n, e in one_step.items()
        }
    return Comparison(
        one_step=one_step,
        shares=shares,
        rollout=rollouts(question, drifted, name, rng),
        black_box=box,
        tuned={t.on: float(t.values["ratio"]) for t in hypotheses["tuned"].terms if "ratio" in t.values},
        corrected=both,
        why_no_gp=why,
        inputs=inputs(train),
        times=train.t[:, 0],
        episodes=train.episode,
        since_reversal=since_reversal(train, problem.simulator),
        left_before=residual_rates(problem, train, base),
        left_after=residual_rates(problem, steps["after"].train, after),
        mishaps=tuple(mishaps.lines),
    )


def _remainder(
    question: PreparedProblem,
    judgement: Judgement,
    attribution: Attribution,
    hypotheses: Mapping[str, Hypothesis],
    steps: Mapping[str, Steps],
    completions: Completions,
    alone: Learnt | None,
    rng: np.random.Generator,
) -> tuple[Corrected | None, NoGp | None, Learnt | None]:
    """A Gaussian process where what is left has structure and simulations are better with it; why there is none.

    And the one beside the effects, whether that is better or not.

    Of physics that nobody knows the effects are a partial account: their gates may cut what is left to pieces, and a
    process that is `alone` with the base simulator models it better.
    """
    if not judgement.structured:
        return None, NoGp("no structure"), None
    if alone is None:
        return None, NoGp("not fitted"), None
    problem, named = question.everything, bool(judgement.leader.hypothesis.terms)
    account = hypotheses["after" if named else "before"]
    length = free_length(question, completions.by(account), Model(account))

    def corrected(kind: str, train: Windows, learnt: Learnt) -> Corrected:
        recording = completions.by(hypotheses[kind])
        runs = whole_windows(question, recording, learnt_from=True)
        return Corrected(hypotheses[kind], learnt, train, runs, free_runs(question, recording, length))

    beside, choices = None, []
    if named:
        train = with_a_past(question, steps["after"].train, hypotheses["after"])
        beside = learn(problem, train, hypotheses["after"], rng)
        choices = [corrected("after", train, beside)]
    if not choices or attribution.share.share < question.run.settings.verdict.nearly_all:
        choices.append(corrected("before", steps["before"].train, alone))
    chosen, errors = best(problem, choices)
    why = why_not(problem, choices[0].errors(problem, modelled=False), errors)
    why = why or strays(problem, choices[0], chosen)
    return None if why else chosen, why, beside


def steps_of(
    question: PreparedProblem, hypotheses: Mapping[str, Hypothesis], completions: Completions
) -> dict[str, Steps]:
    """Where nothing is hidden nor differentiated all hypotheses start from what was measured."""
    problem, recording = question.everything, question.recording
    past = _remembers(problem, hypotheses["after"])
    whole = {kind: completions.by(h) for kind, h in hypotheses.items()}
    found = {key: single_steps(problem, r, past) for key, r in {id(r): r for r in whole.values()}.items()}
    made_by = () if question.hidden else filters(recording, problem.simulator)
    out: dict[str, Steps] = {}
    for kind, h in hypotheses.items():
        steps, same = found[id(whole[kind])], next((out[k] for k in out if hypotheses[k] == h), None)
        if made_by and same is None:
            steps = Steps(*(undone(problem, recording, w, h, made_by) for w in (steps.train, steps.test)))
        out[kind] = same or steps
    return out


def _remembers(problem: Problem, hypothesis: Hypothesis) -> bool:
    """Whether what was commanded or where the system was before matters to what happens."""
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    values = hypothesis.spread(hypothesis.theta[None], 1)
    return chain.actuation.remembers(values) > 0.0 or chain.sensors.looks_back(values) > 0.0


def single_steps(problem: Problem, recording: Recording, past: bool = False) -> Steps:
    """Those in which nothing touches; past: without those that begin an episode or follow on a gap.

    Each where there are others.
    """
    settings = problem.run.settings
    windows = cut(recording, settings.windows, 1, most=STEPS_LOOKED_AT)
    windows = windows.take(windows.sound_ends) if windows.sound_ends.any() else windows
    ends = windows.measured[:, 0], windows.measured[:, 1]
    windows = windows.take(apart(problem.simulator, FEWEST_WITHOUT_CONTACT, *ends))
    held = held_out_mask(recording, windows)
    parts = []
    for part in (windows.take(~held), windows.take(held if held.any() else ~held)):
        if past and not part.fresh.all():  # nobody knows what was commanded before those
            part = part.take(~part.fresh)
        parts.append(part.take(evenly(len(part), settings.gp.steps)))
    return Steps(*parts)


def _tuned(question: PreparedProblem, offers: list[Candidate], base: Hypothesis) -> Hypothesis:
    """What a system identification tool would do: the base simulator's own parameters fitted, nothing added."""
    tuned = base
    for candidate in offers:
        if isinstance(effect_of(candidate.family), ParameterEffect):
            believed = candidate.term([p.none for p in candidate.declared])
            tuned = tuned.plus(believed, candidate.declared)
    if not tuned.terms:
        return base
    problem, rounds = question.searched, TUNED_ROUNDS
    if closed(problem.simulator) is not None:
        rounds, windows = TUNED_OF_A_ROBOT
        problem = problem.on(problem.windows.take(evenly(len(problem.windows), windows)))
    plain = fit(problem, base, rounds=rounds)
    found = fit(problem, tuned, plain.starts, rounds, plain.noise)
    return found.hypothesis if found.cost < (1.0 - TUNED_GAIN) * plain.cost else base


def _noise_rates(
    problem: Problem, windows: Windows, hypothesis: Hypothesis, noise: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """(W, R) what the sensors' noise (S,) alone does to the rates' residual, drawn once."""
    rates, dt = problem.simulator.measured_rates, np.diff(windows.t, axis=1)[:, 0]
    before, after = windows.measured[:, 0], predicted(problem, windows, hypothesis)[:, 1]
    noisy = replace(windows, measured=windows.measured + (rng.normal(size=before.shape) * noise)[:, None])
    begun = noisy.measured[:, 0]
    seen = rates(begun, after + rng.normal(size=before.shape) * noise, dt)
    simulated = rates(begun, predicted(problem, noisy, hypothesis)[:, 1], dt)
    clean = rates(before, after, dt)
    return np.asarray((seen - clean) - (simulated - clean))


def _one_step(
    question: PreparedProblem, rates: Mapping[str, FloatArray], measured: FloatArray, rng: np.random.Generator
) -> dict[str, StepErrors]:
    """Errors of every rate that was measured; `typical` from the median beside the RMS.

    `finely` where nothing is missing but a finer step: the base simulator's error with that.
    """
    out: dict[str, StepErrors] = {}
    for i, channel in shown_rates(question):
        spread = max(float(measured[:, i].std()), TINY)
        errors = {kind: rms(rates[kind][:, i]) for kind in KINDS}
        over = OverBefore(**over_before({kind: rates[kind][:, i] for kind in MODELS}, rng))
        out[channel.name] = StepErrors(
            **errors,
            unit=channel.unit,
            nrmse=ModelErrors(**{kind: value / spread for kind, value in errors.items()}),
            typical=ModelErrors(**{kind: typical(rates[kind][:, i]) for kind in KINDS}),
            over_before=over,
            after_over_before=over.after,
            finely=rms(rates["finely"][:, i]) if "finely" in rates else None,
        )
    return out


def _step_shares(
    question: PreparedProblem, rates: Mapping[str, FloatArray], rng: np.random.Generator
) -> dict[str, Share]:
    """What the effects take off each measured rate's error beyond noise, where there is any."""
    kinds = ("before", "after", "noise_floor")
    found = {
        channel.name: share_explained({kind: rates[kind][:, i] for kind in kinds}, rng)
        for i, channel in shown_rates(question)
    }
    return {name: share for name, share in found.items() if share is not None}


def shown_rates(question: PreparedProblem) -> list[tuple[int, Channel]]:
    """Which rates follow from recorded channels alone, by their columns: a hidden one's was not measured."""
    simulator = question.everything.simulator
    state = question.everything.windows.measured[:1, 0]
    shown = np.ones(len(simulator.rate), dtype=np.bool_)
    for name in question.hidden:
        moved = np.array(state)
        moved[:, simulator.state.index(name)] += 1.0
        shown &= simulator.measured_rates(state, moved, np.ones(1))[0] == 0.0
    unmeasured = question.sight.unmeasured if question.sight else ()
    rates = enumerate(simulator.rate)
    return [(i, channel) for i, channel in rates if shown[i] and channel.name not in unmeasured]
