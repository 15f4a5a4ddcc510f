"""Where simulator and recording differ: which rates, on what it depends, in which region, since when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray, FloatArray, wrap_angle
from gpsim.diagnosis.assessment.comparison import Comparison
from gpsim.diagnosis.data import TYPICAL
from gpsim.diagnosis.judging import Judgement
from gpsim.diagnosis.setup import PreparedProblem
from gpsim.findings import Concentration, Location, Verdict
from gpsim.simulators import Simulator

RESIDUAL_BINS = 8  # of equal numbers of samples, in which a residual is averaged
LEAST_SHARE = 0.05  # of its variance, that an input must explain to be named
GLITCH = 8.0  # times the typical residual: more is clipped, as a leap of the sensor is

INPUT_BINS = 40  # of equal numbers of samples, into which an input is cut
FEWEST_SAMPLES = 400  # samples with fewer, chance may put a mismatch anywhere
LEAST_MISMATCH = 0.25  # of the noise's mean square, that the mismatch's must be
LEAST_HELD = 0.9  # of the mismatch, that a part must hold
FEW_SAMPLES = 0.35  # of the samples, that such a part may hold at most
MANY_SAMPLES = 0.8  # of the samples, that it may hold where its edges are sharp, as an onset's are
SHARP_EDGE = 0.5  # of the density within, that the mismatch must have at such edges
MOST_OUTSIDE = 0.1  # of the density within, that it may have outside
EDGE_BINS = 2  # bins that make an edge
TINY = 1e-300  # guards divisions by errors that are 0

SINCE_REVERSAL = "since_reversal:"  # before the name of what turned round, [s]


def locate(
    question: PreparedProblem, judgement: Judgement, comparison: Comparison, verdict: Verdict
) -> Location:
    """Which rates, where, since when, and on what it depends."""
    simulator = question.everything.simulator
    gates = [t.gate for t in judgement.leader.hypothesis.terms if t.gate]
    region = {k: v for gate in gates for k, v in gate.region.items()}
    since = next((gate.since + question.origin for gate in gates if gate.since is not None), None)
    episode = next((gate.since_episode for gate in gates if gate.since_episode is not None), None)
    differs = verdict != "none"
    inputs = depends_on(simulator, comparison, comparison.left_before) if differs else []
    return Location(
        channels=_shares(simulator, judgement, comparison, verdict),
        region=region,
        since=since,
        since_episode=question.episode_name(episode),
        depends_on=tuple(inputs),
        concentrated=_concentrated(question, comparison) if differs else None,
    )


def _concentrated(question: PreparedProblem, comparison: Comparison) -> Concentration | None:
    """In which part of state, action or time nearly all of the mismatch lies, in the rate where it is plainest.

    Or how soon after a command or a velocity has turned round.
    """
    simulator, steps = question.everything.simulator, comparison.one_step
    if not steps:
        return None
    name = min(steps, key=lambda n: (steps[n].noise_floor / max(steps[n].before, TINY), n))
    residual = _without_glitches(comparison.left_before[:, [simulator.rate.index(name)]])[:, 0]
    inputs = {
        channel.name: wrap_angle(values) if channel.wraps else values
        for channel, values in zip((*simulator.state, *simulator.action), comparison.inputs.T, strict=True)
    } | {"t": comparison.times + question.origin}
    if question.recording.clock == "episode":  # their times say nothing of what came first
        inputs["episode"] = comparison.episodes
    ages = {f"{SINCE_REVERSAL}{of}": age for of, age in comparison.since_reversal.items()}
    part = concentrated(inputs, residual**2, steps[name].noise_floor ** 2, ages)
    return None if part is None else part.of(name)


def _shares(
    simulator: Simulator, judgement: Judgement, comparison: Comparison, verdict: Verdict
) -> dict[str, float]:
    """Of each rate's mean squared residual: what the effects account for; what exceeds the noise where that is unknown.

    What the effects say is free of noise, so that a rate whose residual happens to be large does not stand out.
    """
    base = comparison.left_before
    said = np.mean((base - comparison.left_after) ** 2, axis=0) / np.maximum(np.mean(base**2, axis=0), TINY)
    channels = {}
    for name, errors in comparison.one_step.items():
        before, floor = errors.before**2, errors.noise_floor**2
        share = float(said[simulator.rate.index(name)]) if judgement.leader.hypothesis.terms else 0.0
        if verdict == "unknown":
            share = max(share, 1.0 - floor / before if before > 0 else 0.0)
        channels[name] = round(min(share, 1.0), 4)
    return channels


def depends_on(simulator: Simulator, comparison: Comparison, residual: FloatArray) -> list[str]:
    """Inputs that explain a good share of a residual rate (N, R) when it is averaged in bins of them."""
    shown = [i for i, channel in enumerate(simulator.rate) if channel.name in comparison.one_step]
    shares = _shares_explained(simulator, comparison, residual[:, shown])
    return [name for name, share in shares.items() if share > LEAST_SHARE]


def most_telling(simulator: Simulator, comparison: Comparison, rate: int) -> list[str]:
    """The two inputs that explain most of one rate's residual under the base, however little that is."""
    return list(_shares_explained(simulator, comparison, comparison.left_before[:, [rate]]))[:2]


def _shares_explained(simulator: Simulator, comparison: Comparison, residual: FloatArray) -> dict[str, float]:
    """Every input, the most telling one first, with the largest share of a residual (N, K) that it explains."""
    names = (*simulator.state.names, *simulator.action.names)
    targets = _without_glitches(residual)
    shares = {
        name: _explained(values, targets) for name, values in zip(names, comparison.inputs.T, strict=True)
    }
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _without_glitches(targets: FloatArray) -> FloatArray:
    """Clipped where the sensor's rare leaps would make up the variance."""
    middle = np.median(targets, axis=0)
    typical = TYPICAL * np.median(np.abs(targets - middle), axis=0)
    reach = np.where(typical > 0, GLITCH * typical, np.inf)
    return np.asarray(np.clip(targets, middle - reach, middle + reach))


def _explained(values: FloatArray, targets: FloatArray) -> float:
    """The largest share of the variance of targets (N, K) between quantile bins of `values`, less that of chance."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, RESIDUAL_BINS + 1)[1:-1]))
    which = np.searchsorted(edges, values)
    count = np.bincount(which, minlength=len(edges) + 1)
    shares = []
    for target in targets.T:
        means = np.bincount(which, weights=target, minlength=len(edges) + 1) / np.maximum(count, 1)
        total = max(float(((target - target.mean()) ** 2).sum()), TINY)
        between = float((count * (means - target.mean()) ** 2).sum()) / total
        shares.append(between - RESIDUAL_BINS / len(target))
    return max(shares, default=0.0)


@dataclass(frozen=True)
class Part:
    """The samples whose `channel` lies in [low, high], or outside of it; shares of the mismatch and of the samples.

    age: whether `channel` is no channel but how long ago something happened.
    """

    channel: str
    low: float
    high: float
    inside: bool
    share: float
    samples: float
    age: bool = False

    def of(self, rate: str) -> Concentration:
        """As the mismatch of this rate is reported; a channel may be called as an age is, and is told to be none."""
        return Concentration(
            rate,
            self.channel,
            "inside" if self.inside else "outside",
            (self.low, self.high),
            share_of_mismatch=round(min(self.share, 1.0), 3),  # noise left the rest below nothing
            share_of_samples=round(self.samples, 3),
            is_channel=True if self.channel.startswith(SINCE_REVERSAL) and not self.age else None,
        )


def concentrated(
    inputs: Mapping[str, FloatArray],
    squares: FloatArray,
    noise: float,
    ages: Mapping[str, FloatArray] | None = None,
) -> Part | None:
    """The part of one input (N,) that holds nearly all of the `squares` (N,) beyond `noise`, or None.

    ages: more inputs, (N,) s since something happened, of which only what is soon after it counts. noise: the mean
    square that the sensors alone would make. Of several, the one with the fewest samples. A part with many samples
    counts where its edges are sharp, as those of an onset are: a law that grows steadily has none.
    """
    beyond = squares - noise
    if len(squares) < FEWEST_SAMPLES or beyond.mean() <= LEAST_MISMATCH * noise:
        return None
    parts = [_part(name, values, beyond) for name, values in inputs.items()]
    found = [part for part in parts if part is not None]
    for name, age in (ages or {}).items():
        part = _part(name, age, beyond)
        if part is not None and part.inside and part.low == age.min():
            found.append(replace(part, age=True))
    return min(found, key=lambda part: part.samples, default=None)


def _part(name: str, values: FloatArray, beyond: FloatArray) -> Part | None:
    """The smallest part that holds nearly all, if it is small; else the one that stands out most, if it is sharp."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, INPUT_BINS + 1), method="inverted_cdf"))
    if len(edges) < 3:
        return None
    bins = len(edges) - 1
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
    share = np.bincount(which, weights=beyond, minlength=bins) / beyond.sum()
    samples = np.bincount(which, minlength=bins) / len(values)
    held, many = (np.concatenate([[0.0], np.cumsum(part)]) for part in (share, samples))
    first, last = np.triu_indices(len(edges), 1)  # bins first ... last - 1
    shares, counts = held[last] - held[first], many[last] - many[first]
    shares, counts = np.stack([shares, 1.0 - shares]), np.stack([counts, 1.0 - counts])  # inside, outside
    whole = (shares >= LEAST_HELD) & (counts > 0.0)
    small = whole & (counts <= FEW_SAMPLES)
    if small.any():
        side, k = divmod(int(np.argmin(np.where(small, counts, np.inf))), counts.shape[1])
    else:
        # Squares of the best fit by one level in the part and none elsewhere.
        worth = np.where(whole & (counts <= MANY_SAMPLES), shares**2 / np.maximum(counts, TINY), -np.inf)
        sharp: list[tuple[float, int, int]] = []
        for side, k in enumerate(worth.argmax(axis=1).tolist()):
            within = (np.arange(bins) >= first[k]) & (np.arange(bins) < last[k])
            part = within if side == 0 else ~within
            if np.isfinite(worth[side, k]) and _is_sharp(share / samples, samples, part):
                sharp.append((float(counts[side, k]), side, k))
        if not sharp:
            return None
        _, side, k = min(sharp)
    low, high, inside = int(first[k]), int(last[k]), side == 0
    # Outside an interval that reaches to the end of what was visited is inside the rest.
    if not inside and low == 0:
        low, high, inside = high, bins, True
    elif not inside and high == bins:
        low, high, inside = 0, low, True
    return Part(
        name, float(edges[low]), float(edges[high]), inside, float(shares[side, k]), float(counts[side, k])
    )


def _is_sharp(density: FloatArray, samples: FloatArray, part: BoolArray) -> bool:
    """Whether a part of the bins is as dense at its edges as within, and next to nothing lies outside."""
    level = float(np.average(density[part], weights=samples[part]))
    for cut in np.flatnonzero(part[1:] != part[:-1]).tolist():  # between bins cut and cut + 1
        first = max(cut - EDGE_BINS + 1, 0) if part[cut] else cut + 1
        side = slice(first, cut + 1 if part[cut] else first + EDGE_BINS)
        if density[side][part[side]].mean() < SHARP_EDGE * level:
            return False
    return bool(np.average(density[~part], weights=samples[~part]) <= MOST_OUTSIDE * level)
