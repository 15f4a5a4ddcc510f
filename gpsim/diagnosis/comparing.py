"""The fit on held-out data: base, base tuned, base + GP, base + effects, base + effects + GP, and the noise floor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.differentiated import filters, undone
from gpsim.diagnosis.hidden import Completions
from gpsim.diagnosis.hypothesis import Candidate, Hypothesis
from gpsim.diagnosis.judging import Judgement
from gpsim.diagnosis.predicting import as_it_was, has_sensors, predicted, traced, without_sensors
from gpsim.diagnosis.preparing import Question
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.ratios import MODELS, over_before, rms, typical
from gpsim.diagnosis.rolling import Model, rollouts
from gpsim.diagnosis.search import LEAST_SHARE
from gpsim.diagnosis.shooting import fit
from gpsim.diagnosis.simulate import Extra
from gpsim.diagnosis.windows import Windows, cut, held_out_mask
from gpsim.effects import effect_of
from gpsim.evenly import evenly
from gpsim.features import Features
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.recordings import Recording

MOST, GP_ROWS = 3000, 250
LOOKED_AT = 20_000  # transitions, evenly spread, from which training and held-out ones are taken
KINDS = (*MODELS, "noise_floor")


@dataclass(frozen=True)
class Comparison:
    """Errors by rate (one_step) and by channel (rollout), and the Gaussian process on what the effects leave.

    inputs: (N, S + A) state and action at training transitions; times: (N,) s; episodes: (N,) their numbers;
    left_before, left_after: (N, R) their residual rates under the base and under the effects.
    """

    one_step: dict[str, dict[str, Any]]
    rollout: dict[str, Any]
    tuned: dict[str, float]
    gp: Predictor
    features: tuple[str, ...]
    inputs: FloatArray
    times: FloatArray
    episodes: IntArray
    left_before: FloatArray
    left_after: FloatArray


@dataclass(frozen=True)
class _Steps:
    """Single transitions, to learn from and held out, completed by a hypothesis where channels are hidden."""

    train: Windows
    test: Windows


def compare(
    question: Question, judgement: Judgement, offers: list[Candidate], rng: np.random.Generator
) -> Comparison:
    """Fit what has to be fitted on training data, and judge all of it on held-out data."""
    problem = question.everything
    base = Hypothesis(scheme=question.recording.integrator)  # type: ignore[arg-type]
    after = judgement.leader.hypothesis if judgement.leader.hypothesis.terms else base
    hypotheses = {"before": base, "tuned": _tuned(question, offers, base), "after": after}
    if judgement.leader.hypothesis == Hypothesis() and base.scheme != "fine":
        hypotheses["finely"] = Hypothesis()
    completions = Completions(problem, question.recording, question.hidden)
    steps = _steps_of(question, hypotheses, completions)
    rates = {kind: _residual_rates(problem, steps[kind].test, h) for kind, h in hypotheses.items()}
    features = _features(problem)
    gps = {"gp": _gp(problem, steps["before"].train, base, features, rng)}
    seen = _with_a_past(question, steps["after"].train, after)
    gps["after_gp"] = _gp(problem, seen, after, features, rng) if after.terms else gps["gp"]
    rates["gp"] = rates["before"] - gps["gp"].mean(features(_inputs(steps["before"].test)))
    both = _added(gps["after_gp"], features)
    rates["after_gp"] = (
        _residual_rates(problem, steps["after"].test, after, both)
        if has_sensors(after)  # the process knows the true states, which the simulation has
        else rates["after"] - both(*_state_and_action(steps["after"].test))
    )
    noise = _sensor_noise(question, judgement)
    rates["noise_floor"] = _noise_rates(problem, steps["after"].test, after, noise, rng)
    models = {
        "before": Model(base),
        "tuned": Model(hypotheses["tuned"]),
        "gp": Model(base, _added(gps["gp"], features)),
        "after_gp": Model(after, both),
        "after": Model(after),
    }
    return Comparison(
        _one_step(question, rates, _measured_rates(problem, steps["after"].test), rng),
        rollouts(question, models, noise, rng, completions),
        {p: float(t.values["ratio"]) for t in hypotheses["tuned"].terms for p in [t.on]},
        gps["after_gp"],
        features.names,
        _inputs(steps["before"].train),
        steps["before"].train.t[:, 0],
        steps["before"].train.episode,
        _residual_rates(problem, steps["before"].train, base),
        _residual_rates(problem, steps["after"].train, after),
    )


def _steps_of(
    question: Question, hypotheses: Mapping[str, Hypothesis], completions: Completions
) -> dict[str, _Steps]:
    """Where nothing is hidden nor differentiated all hypotheses start from what was measured."""
    problem, recording = question.everything, question.recording
    past = _remembers(problem, hypotheses["after"])
    if question.hidden:
        return {kind: _steps(completions.by(h), past) for kind, h in hypotheses.items()}
    steps, made_by = _steps(recording, past), filters(recording, problem.simulator)
    if not made_by:
        return dict.fromkeys(hypotheses, steps)
    out: dict[str, _Steps] = {}
    for kind, h in hypotheses.items():
        same = next((k for k in out if hypotheses[k] == h), None)
        parts = (undone(problem, recording, w, h, made_by) for w in (steps.train, steps.test))
        out[kind] = out[same] if same else _Steps(*parts)
    return out


def _remembers(problem: Problem, hypothesis: Hypothesis) -> bool:
    """Whether what was commanded or where the system was before matters to what happens."""
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    values = hypothesis.spread(hypothesis.theta[None], 1)
    return chain.remembers(values) > 0.0 or chain.sensors.looks_back(values) > 0.0


def _steps(recording: Recording, past: bool = False) -> _Steps:
    """past: without those before which nobody knows what was commanded, where there are others."""
    windows = cut(recording, 1, most=LOOKED_AT)
    held = held_out_mask(recording, windows)
    train, test = windows.take(~held), windows.take(held if held.any() else ~held)
    if past:
        train, test = _later(train), _later(test)
    return _Steps(_some(train, MOST), _some(test, MOST))


def _later(windows: Windows) -> Windows:
    """Without those that begin an episode or follow on a gap, if there are others."""
    return windows if windows.fresh.all() else windows.take(~windows.fresh)


def _some(windows: Windows, most: int) -> Windows:
    return windows.take(evenly(len(windows), most))


def _tuned(question: Question, offers: list[Candidate], base: Hypothesis) -> Hypothesis:
    """What a system identification tool would do: the base simulator's own parameters fitted, nothing added."""
    tuned = base
    for candidate in offers:
        if effect_of(candidate.family).site == "parameter":
            tuned = tuned.plus(candidate.term([1.0]), candidate.declared)
    if not tuned.terms:
        return base
    problem = question.searched
    found = fit(problem, tuned, problem.windows.measured[:, 0], iterations=15, tolerance=0.5)
    plain = fit(problem, base, problem.windows.measured[:, 0], iterations=8)
    share = 1.0 - found.variance / plain.variance
    return found.hypothesis if bool((share[problem.observed] > LEAST_SHARE).any()) else base


def _residual_rates(
    problem: Problem, windows: Windows, hypothesis: Hypothesis, extra: Extra | None = None
) -> FloatArray:
    """(W, R) measured minus simulated rates of single transitions; `extra` rates are added to the simulation's."""
    said = predicted(problem, windows, hypothesis, extra)
    dt = np.diff(windows.t, axis=1)[:, 0]
    simulated = problem.simulator.measured_rates(windows.measured[:, 0], said[:, 1], dt)
    return np.asarray(_measured_rates(problem, windows) - simulated)


def _measured_rates(problem: Problem, windows: Windows) -> FloatArray:
    dt = np.diff(windows.t, axis=1)[:, 0]
    return problem.simulator.measured_rates(windows.measured[:, 0], windows.measured[:, 1], dt)


def _sensor_noise(question: Question, judgement: Judgement) -> FloatArray:
    """(S,) standard deviation of every recorded channel's noise, 0 of hidden ones.

    What the recording states, else what second differences of the leader's residual show: a smooth error of the
    model does not move them.
    """
    problem = question.everything
    names = problem.simulator.state.names
    stated = np.array([question.recording.noise.get(name, 0.0) for name in names])
    residual = problem.windows.measured - traced(problem, judgement.leader)
    second = np.diff(residual, n=2, axis=1)[problem.windows.valid[:, 2:]].T / np.sqrt(6.0)
    jumps = np.array([typical(column) or rms(column) for column in second])  # quantised: the median may be 0
    hidden = np.array([name in question.hidden for name in names])
    return np.asarray(np.where(hidden, 0.0, np.where(stated > 0, stated, jumps)))


def _noise_rates(
    problem: Problem, windows: Windows, hypothesis: Hypothesis, noise: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """(W, R) what the sensors' noise (S,) alone does to the rates' residual, drawn once."""
    shape = windows.measured[:, 0].shape
    before, after = windows.measured[:, 0], predicted(problem, windows, hypothesis)[:, 1]
    noisy = replace(windows, measured=windows.measured + (rng.normal(size=shape) * noise)[:, None])
    disturbed = predicted(problem, noisy, hypothesis)[:, 1]
    dt = np.diff(windows.t, axis=1)[:, 0]
    clean = problem.simulator.measured_rates(before, after, dt)
    seen = problem.simulator.measured_rates(noisy.measured[:, 0], after + rng.normal(size=shape) * noise, dt)
    simulated = problem.simulator.measured_rates(noisy.measured[:, 0], disturbed, dt)
    return np.asarray((seen - clean) - (simulated - clean))


def _features(problem: Problem) -> Features:
    """State and action, and the signs of the velocities: friction jumps there."""
    names = (*problem.simulator.state.names, *problem.simulator.action.names)
    signs = tuple(f"sign({c.velocity})" for c in problem.simulator.coordinates)
    return Features.of((*names, *signs), problem.simulator.state + problem.simulator.action)


def _inputs(windows: Windows) -> FloatArray:
    return np.hstack(_state_and_action(windows))


def _state_and_action(windows: Windows) -> tuple[FloatArray, FloatArray]:
    return windows.measured[:, 0], windows.actions[:, 0]


def _with_a_past(question: Question, train: Windows, hypothesis: Hypothesis) -> Windows:
    """The transitions of which the sensors saw all that they remember: nobody knows what was before an episode."""
    if not has_sensors(hypothesis):
        return train
    problem = question.everything
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    late = chain.sensors.looks_back(hypothesis.spread(hypothesis.theta[None], 1))
    begun = np.array([episode.t[0] for episode in question.recording.episodes])
    known = ~train.fresh & (train.t[:, 0] - begun[train.episode] > late)
    return train.take(known) if known.any() else train


def _gp(
    problem: Problem, train: Windows, hypothesis: Hypothesis, features: Features, rng: np.random.Generator
) -> Predictor:
    """A Gaussian process on what the hypothesis leaves of the rates, as it will be asked: in true states.

    What the hypothesis's sensors make of them the corrected simulator says by itself.
    """
    rows: IntArray = rng.permutation(len(train))[:GP_ROWS]
    chosen = train.take(np.sort(rows))
    if has_sensors(hypothesis):
        chosen, hypothesis = as_it_was(problem, chosen, hypothesis), without_sensors(hypothesis)
    targets = _residual_rates(problem, chosen, hypothesis)
    settings = FitSettings(restarts=1, screening_iterations=5, max_iterations=60)
    return Predictor(fit_outputs(features(_inputs(chosen)), targets, settings, rng))


def _added(gp: Predictor, features: Features) -> Extra:
    """The Gaussian process's mean as rates that are added."""
    return lambda state, action: gp.mean(features(np.hstack([state, action])))


def _one_step(
    question: Question, rates: Mapping[str, FloatArray], measured: FloatArray, rng: np.random.Generator
) -> dict[str, dict[str, Any]]:
    """The contract's `one_step` of every rate that was measured; `typical` from the median beside the RMS.

    `finely` where nothing is missing but a finer step: the base simulator's error with that.
    """
    out: dict[str, dict[str, Any]] = {}
    shown = _shown_rates(question)
    for i, channel in enumerate(question.everything.simulator.rate):
        if not shown[i]:
            continue
        spread = max(float(measured[:, i].std()), 1e-300)
        errors = {kind: rms(rates[kind][:, i]) for kind in KINDS}
        out[channel.name] = {
            **errors,
            "unit": channel.unit,
            "nrmse": {kind: value / spread for kind, value in errors.items()},
            "typical": {kind: typical(rates[kind][:, i]) for kind in KINDS},
            **over_before({kind: rates[kind][:, i] for kind in MODELS}, rng),
        }
        if "finely" in rates:
            out[channel.name]["finely"] = rms(rates["finely"][:, i])
    return out


def _shown_rates(question: Question) -> BoolArray:
    """(R,) which rates follow from recorded channels alone: a hidden one's was not measured."""
    simulator = question.everything.simulator
    state = question.everything.windows.measured[:1, 0]
    shown = np.ones(len(simulator.rate), dtype=np.bool_)
    for name in question.hidden:
        moved = np.array(state)
        moved[:, simulator.state.index(name)] += 1.0
        shown &= simulator.measured_rates(state, moved, np.ones(1))[0] == 0.0
    return shown
