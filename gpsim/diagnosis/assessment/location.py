"""Where simulator and recording differ: which rates, on what it depends, in which region, since when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray, wrap_angle
from gpsim.diagnosis.assessment.comparison import Comparison
from gpsim.diagnosis.assessment.concentration import concentrated
from gpsim.diagnosis.data import TYPICAL
from gpsim.diagnosis.judging import Judgement
from gpsim.diagnosis.report import Concentration, Location, Verdict
from gpsim.diagnosis.setup import Question
from gpsim.simulators import Simulator

RESIDUAL_BINS = 8  # of equal numbers of samples, in which a residual is averaged
LEAST_SHARE = 0.05  # of its variance, that an input must explain to be named
GLITCH = 8.0  # times the typical residual: more is clipped, as a leap of the sensor is

SINCE_REVERSAL = "since_reversal:"  # before the name of what turned round, [s]


def locate(question: Question, judgement: Judgement, comparison: Comparison, verdict: Verdict) -> Location:
    """Which rates, where, since when, and on what it depends."""
    simulator = question.everything.simulator
    channels = _shares(simulator, judgement, comparison, verdict)
    gates = [t.gate for t in judgement.leader.hypothesis.terms if t.gate]
    region = {k: v for gate in gates for k, v in gate.region.items()}
    since = next((gate.since + question.origin for gate in gates if gate.since is not None), None)
    episode = next((gate.since_episode for gate in gates if gate.since_episode is not None), None)
    differs = verdict != "none"
    inputs = depends_on(simulator, comparison, comparison.left_before) if differs else []
    return Location(
        channels=channels,
        region=region,
        since=since,
        since_episode=question.episode_name(episode),
        depends_on=tuple(inputs),
        concentrated=_concentrated(question, comparison) if differs else None,
    )


def _concentrated(question: Question, comparison: Comparison) -> Concentration | None:
    """In which part of state, action or time nearly all of the mismatch lies, in the rate where it is plainest.

    Or how soon after a command or a velocity has turned round.
    """
    simulator = question.everything.simulator
    rates = [
        (errors.noise_floor / max(errors.before, 1e-300), name)
        for name, errors in comparison.one_step.items()
    ]
    if not rates:
        return None
    name = min(rates)[1]
    column = simulator.rate.index(name)
    residual = _without_glitches(comparison.left_before[:, [column]], GLITCH)[:, 0]
    inputs = {
        channel.name: wrap_angle(values) if channel.wraps else values
        for channel, values in zip((*simulator.state, *simulator.action), comparison.inputs.T, strict=True)
    } | {"t": comparison.times + question.origin}
    if question.recording.clock == "episode":  # their times say nothing of what came first
        inputs["episode"] = comparison.episodes
    ages = {f"{SINCE_REVERSAL}{of}": age for of, age in comparison.since_reversal.items()}
    noise = comparison.one_step[name].noise_floor ** 2
    part = concentrated(inputs, residual**2, noise, ages)
    if part is None:
        return None
    # A channel may be called as an age is: a reader must know which one it is.
    alike = not part.age and part.channel.startswith(SINCE_REVERSAL)
    return replace(part.of(name), is_channel=True) if alike else part.of(name)


def _shares(
    simulator: Simulator, judgement: Judgement, comparison: Comparison, verdict: Verdict
) -> dict[str, float]:
    """Of each rate's mean squared residual: what the effects account for; what exceeds the noise where that is unknown.

    What the effects say is free of noise, so that a rate whose residual happens to be large does not stand out.
    """
    base = comparison.left_before
    said = np.mean((base - comparison.left_after) ** 2, axis=0) / np.maximum(np.mean(base**2, axis=0), 1e-300)
    channels = {}
    for name, errors in comparison.one_step.items():
        before, floor = errors.before**2, errors.noise_floor**2
        share = float(said[simulator.rate.index(name)]) if judgement.leader.hypothesis.terms else 0.0
        if verdict == "unknown":
            share = max(share, 1.0 - floor / before if before > 0 else 0.0)
        channels[name] = round(min(share, 1.0), 4)
    return channels


def depends_on(
    simulator: Simulator,
    comparison: Comparison,
    residual: FloatArray,
) -> list[str]:
    """Inputs that explain a good share of a residual rate (N, R) when it is averaged in bins of them."""
    shown = [i for i, channel in enumerate(simulator.rate) if channel.name in comparison.one_step]
    shares = _shares_explained(simulator, comparison, residual[:, shown])
    return [name for name, share in shares.items() if share > LEAST_SHARE]


def most_telling(
    simulator: Simulator,
    comparison: Comparison,
    rate: int,
    count: int = 2,
) -> list[str]:
    """The `count` inputs that explain most of one rate's residual under the base, however little that is."""
    residual = comparison.left_before[:, [rate]]
    return list(_shares_explained(simulator, comparison, residual))[:count]


def _shares_explained(simulator: Simulator, comparison: Comparison, residual: FloatArray) -> dict[str, float]:
    """Every input, the most telling one first, with the largest share of a residual (N, K) that it explains."""
    names = (*simulator.state.names, *simulator.action.names)
    targets = _without_glitches(residual, GLITCH)
    shares = {
        name: _explained(values, targets, RESIDUAL_BINS)
        for name, values in zip(names, comparison.inputs.T, strict=True)
    }
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _without_glitches(targets: FloatArray, times: float) -> FloatArray:
    """Clipped where the sensor's rare leaps would make up the variance."""
    middle = np.median(targets, axis=0)
    typical = TYPICAL * np.median(np.abs(targets - middle), axis=0)
    reach = np.where(typical > 0, times * typical, np.inf)
    return np.asarray(np.clip(targets, middle - reach, middle + reach))


def _explained(values: FloatArray, targets: FloatArray, bins: int) -> float:
    """The largest share of a target's variance between quantile bins of `values`, chance level taken off."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)[1:-1]))
    which = np.searchsorted(edges, values)
    count = np.bincount(which, minlength=len(edges) + 1)
    shares = []
    for target in targets.T:
        means = np.bincount(which, weights=target, minlength=len(edges) + 1) / np.maximum(count, 1)
        total = max(float(((target - target.mean()) ** 2).sum()), 1e-300)
        between = float((count * (means - target.mean()) ** 2).sum()) / total
        shares.append(between - bins / len(target))
    return max(shares, default=0.0)
