"""The fit on held-out data: base, base tuned, base + GP, base + effects, base + effects + GP, and the noise floor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray, difference
from gpsim.diagnosis.hypothesis import Candidate, Hypothesis
from gpsim.diagnosis.judging import Judgement
from gpsim.diagnosis.preparing import Question, held_out_mask
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.search import LEAST_SHARE
from gpsim.diagnosis.shooting import fit
from gpsim.diagnosis.simulate import simulate
from gpsim.diagnosis.windows import Windows, cut
from gpsim.features import Features
from gpsim.gp import FitSettings, Predictor, fit_outputs

MOST, GP_ROWS, BLOCK, DRAWS = 3000, 250, 25, 400
HORIZON = 1.0  # s
KINDS = ("before", "tuned", "gp", "after", "after_gp", "noise_floor")


@dataclass(frozen=True)
class Comparison:
    """Errors by rate (one_step) and by channel (rollout), and the two Gaussian processes that were fitted."""

    one_step: dict[str, dict[str, Any]]
    rollout: dict[str, Any]
    tuned: dict[str, float]
    gp: Predictor
    features: tuple[str, ...]


def compare(
    question: Question, judgement: Judgement, offers: list[Candidate], rng: np.random.Generator
) -> Comparison:
    """Fit what has to be fitted on training data, and judge all of it on held-out data."""
    recording, problem = question.recording, question.everything
    steps = cut(recording, 1)
    held = held_out_mask(recording, steps)
    train, test = _some(steps.take(~held), MOST), _some(steps.take(held if held.any() else ~held), MOST)
    base = Hypothesis(scheme=recording.integrator)  # type: ignore[arg-type]
    tuned = _tuned(question, offers, base)
    after = judgement.leader.hypothesis if judgement.leader.hypothesis.terms else base
    features = _features(problem)
    gps = {name: _gp(problem, train, h, features, rng) for name, h in (("gp", base), ("after_gp", after))}
    hypotheses = {"before": base, "tuned": tuned, "after": after}
    rates = {name: _residual_rates(problem, test, h) for name, h in hypotheses.items()}
    inputs = features(_inputs(test))
    rates["gp"] = rates["before"] - gps["gp"].mean(inputs)
    rates["after_gp"] = rates["after"] - gps["after_gp"].mean(inputs)
    rates["noise_floor"] = _noise_rates(problem, test, after, judgement.noise, rng)
    measured = _measured_rates(problem, test)
    return Comparison(
        _one_step(problem, rates, measured, rng),
        _rollouts(question, hypotheses),
        {p: float(t.values["ratio"]) for t in tuned.terms for p in [t.on]},
        gps["after_gp"] if after.terms else gps["gp"],
        features.names,
    )


def _some(windows: Windows, most: int) -> Windows:
    if len(windows) <= most:
        return windows
    return windows.take(np.linspace(0, len(windows) - 1, most).round().astype(np.int64))


def _tuned(question: Question, offers: list[Candidate], base: Hypothesis) -> Hypothesis:
    """What a system identification tool would do: the base simulator's own parameters fitted, nothing added."""
    tuned = base
    for candidate in offers:
        if candidate.family == "parameter_offset":
            tuned = tuned.plus(candidate.term([1.0]), candidate.declared)
    if not tuned.terms:
        return base
    problem = question.searched
    found = fit(problem, tuned, problem.windows.measured[:, 0], iterations=15, tolerance=0.5)
    plain = fit(problem, base, problem.windows.measured[:, 0], iterations=8)
    share = 1.0 - found.variance / plain.variance
    return found.hypothesis if bool((share[problem.observed] > LEAST_SHARE).any()) else base


def _starts(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    """(W, S) true states whose measurement is what was measured; two rounds of a fixed point."""
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    measured = windows.measured[:, 0]
    values = hypothesis.spread(hypothesis.theta[None], len(windows))
    step = np.full(len(windows), problem.dt / problem.substeps)
    state = measured
    for _ in range(2):
        memory = {}
        if chain.watches:
            slope = chain.slope(state, windows.before_actions[:, -1], values, windows.t[:, 0])
            back = step[:, None] * np.arange(chain.reach(values, step) - 1, -1, -1)
            memory = chain.watchers(state[:, None] - back[:, :, None] * slope[:, None])
        state = state + difference(
            measured, chain.measure(state, values, memory, step), problem.simulator.state
        )
    return state


def _said(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    """(W, L + 1, S) what the sensors would say, from the measured start."""
    chain = hypothesis.chain(problem.simulator, problem.parameters, problem.dt)
    starts = _starts(problem, windows, hypothesis)[None]
    return np.asarray(
        simulate(chain, windows, starts, hypothesis.spread, hypothesis.theta[None], problem.substeps)[0]
    )


def _residual_rates(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    """(W, R) measured minus simulated mean rates of single transitions."""
    said = _said(problem, windows, hypothesis)
    dt = np.diff(windows.t, axis=1)[:, 0]
    simulated = problem.simulator.measured_rates(windows.measured[:, 0], said[:, 1], dt)
    return np.asarray(_measured_rates(problem, windows) - simulated)


def _measured_rates(problem: Problem, windows: Windows) -> FloatArray:
    dt = np.diff(windows.t, axis=1)[:, 0]
    return problem.simulator.measured_rates(windows.measured[:, 0], windows.measured[:, 1], dt)


def _noise_rates(
    problem: Problem, windows: Windows, hypothesis: Hypothesis, noise: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """(W, R) what the sensors' noise alone does to the rates' residual, drawn once."""
    sd = np.where(problem.observed, noise, 0.0)
    shape = windows.measured[:, 0].shape
    before, after = windows.measured[:, 0], _said(problem, windows, hypothesis)[:, 1]
    noisy = replace(windows, measured=windows.measured + (rng.normal(size=shape) * sd)[:, None])
    disturbed = _said(problem, noisy, hypothesis)[:, 1]
    dt = np.diff(windows.t, axis=1)[:, 0]
    clean = problem.simulator.measured_rates(before, after, dt)
    seen = problem.simulator.measured_rates(noisy.measured[:, 0], after + rng.normal(size=shape) * sd, dt)
    simulated = problem.simulator.measured_rates(noisy.measured[:, 0], disturbed, dt)
    return np.asarray((seen - clean) - (simulated - clean))


def _features(problem: Problem) -> Features:
    """State and action, and the signs of the velocities: friction jumps there."""
    names = (*problem.simulator.state.names, *problem.simulator.action.names)
    signs = tuple(f"sign({c.velocity})" for c in problem.simulator.coordinates)
    return Features.of((*names, *signs), problem.simulator.state + problem.simulator.action)


def _inputs(windows: Windows) -> FloatArray:
    return np.hstack([windows.measured[:, 0], windows.actions[:, 0]])


def _gp(
    problem: Problem, train: Windows, hypothesis: Hypothesis, features: Features, rng: np.random.Generator
) -> Predictor:
    """A Gaussian process on what the hypothesis leaves of the rates."""
    rows: IntArray = rng.permutation(len(train))[:GP_ROWS]
    chosen = train.take(np.sort(rows))
    targets = _residual_rates(problem, chosen, hypothesis)
    settings = FitSettings(restarts=1, screening_iterations=5, max_iterations=60)
    return Predictor(fit_outputs(features(_inputs(chosen)), targets, settings, rng))


def _one_step(
    problem: Problem, rates: Mapping[str, FloatArray], measured: FloatArray, rng: np.random.Generator
) -> dict[str, dict[str, Any]]:
    out: dict[str, dict[str, Any]] = {}
    blocks = np.arange(len(measured)) // BLOCK
    for i, channel in enumerate(problem.simulator.rate):
        spread = max(float(measured[:, i].std()), 1e-300)
        errors = {kind: float(np.sqrt(np.mean(rates[kind][:, i] ** 2))) for kind in KINDS}
        low, high = _paired(rates["before"][:, i], rates["after"][:, i], blocks, rng)
        out[channel.name] = {
            **errors,
            "unit": channel.unit,
            "nrmse": {kind: value / spread for kind, value in errors.items()},
            "after_over_before": {
                "value": errors["after"] / max(errors["before"], 1e-300), "low": low, "high": high
            },
        }  # fmt: skip
    return out


def _paired(
    before: FloatArray, after: FloatArray, blocks: IntArray, rng: np.random.Generator
) -> tuple[float, float]:
    """90 % interval of the ratio of root mean squares, by a paired bootstrap over blocks of transitions."""
    count = int(blocks[-1]) + 1 if len(blocks) else 0
    if not count:
        return 0.0, 0.0
    sums = np.array([np.bincount(blocks, weights=values**2, minlength=count) for values in (before, after)])
    draws = rng.integers(0, count, (DRAWS, count))
    totals = sums[:, draws].sum(axis=2)
    ratio = np.sqrt(totals[1] / np.maximum(totals[0], 1e-300))
    low, high = np.quantile(ratio, [0.05, 0.95])
    return float(low), float(high)


def _rollouts(question: Question, hypotheses: Mapping[str, Hypothesis]) -> dict[str, Any]:
    """Root mean square error after the horizon, from measured starts of held-out data."""
    recording, problem = question.recording, question.everything
    length = max(2, min(round(HORIZON / recording.dt), 200, max(len(e) for e in recording.episodes)))
    windows = cut(recording, length)
    held = held_out_mask(recording, windows)
    windows = _some(windows.take(held if held.any() else ~held), 400)
    windows = windows.take(windows.valid[:, -1])
    out: dict[str, Any] = {"horizon_s": length * recording.dt}
    if not len(windows):
        return out
    said = {kind: _said(problem, windows, h)[:, -1] for kind, h in hypotheses.items()}
    for i, channel in enumerate(problem.simulator.state):
        errors = {
            k: difference(windows.measured[:, -1], v, problem.simulator.state)[:, i] for k, v in said.items()
        }
        out[channel.name] = {kind: float(np.sqrt(np.mean(e**2))) for kind, e in errors.items()} | {
            "unit": channel.unit
        }
    return out
