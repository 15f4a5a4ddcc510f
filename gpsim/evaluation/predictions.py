"""Layers 1 and 2: how well a corrected simulator predicts one step, and rollouts, of a target or of its recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray, difference
from gpsim.errors import UsageError
from gpsim.evaluation.returns import nrmse, r2
from gpsim.recordings import Episode, evenly, gaps, pieces
from gpsim.simulators import Memory, Plant

LEVELS = (0.5, 0.9, 0.99)
MUCH_OUTSIDE = 0.1
"""Share of a deployed policy's transitions outside the recording from which on it is a warning."""


@dataclass(frozen=True)
class OneStep:
    """Residuals of target transitions, and what the GPs say of them (thesis, section 4.3.2 and Table 4.3).

    actual, mean: (N, R) rates; latent_variance: (N, R) of the function, noise_variance: (R,) on top of it;
    episode: (N,) index.
    """

    actual: FloatArray
    mean: FloatArray
    latent_variance: FloatArray
    noise_variance: FloatArray
    episode: IntArray

    def scores(self, rate: int, rng: np.random.Generator, *, sample_noise: bool) -> dict[str, Any]:
        """Scores of the mean and of a sample of one rate, with the quality of the predicted distribution.

        NRMSE divides by the range of the pooled residual (a per-episode range divides by nearly nothing); its
        spread is the standard deviation over episodes of the error on that same range.
        """
        from scipy.stats import norm  # here: most commands need not wait for it

        actual, mean = self.actual[:, rate], self.mean[:, rate]
        observed = np.sqrt(self.latent_variance[:, rate] + self.noise_variance[rate])
        drawn = observed if sample_noise else np.sqrt(self.latent_variance[:, rate])
        sample = mean + drawn * rng.standard_normal(len(mean))
        coverage = {}
        for level in LEVELS:
            half = norm.ppf(0.5 + level / 2) * observed
            coverage[f"{level:g}"] = float(np.mean(np.abs(actual - mean) <= half))
        return {
            "mean": self._errors(mean, actual),
            "sample": self._errors(sample, actual),
            "negative_log_likelihood": float(-np.mean(norm.logpdf(actual, mean, observed))),
            "coverage": coverage,
            "predicted_std": float(np.sqrt(np.mean(observed**2))),
            "range": float(np.ptp(actual)),
        }

    def _errors(self, predicted: FloatArray, actual: FloatArray) -> dict[str, float]:
        pooled = float(np.ptp(actual))
        masks = [self.episode == i for i in np.unique(self.episode)]
        by_episode = [nrmse(predicted[mask], actual[mask], pooled) for mask in masks]
        return {
            "nrmse": nrmse(predicted, actual),
            "nrmse_std": float(np.std(by_episode)),
            "r2": r2(predicted, actual),
            "rmse": float(np.sqrt(np.mean((predicted - actual) ** 2))),
        }


def outside_range(visited: FloatArray, training: FloatArray) -> float:
    """Share of the visited inputs (N, D) with a column outside the range of the training inputs (M, D).

    There a Gaussian process extrapolates, and its mean falls back to the prior's.
    """
    outside = (visited < training.min(axis=0)) | (visited > training.max(axis=0))
    return float(np.mean(outside.any(axis=1)))


def coverage_warnings(outside: Mapping[str, float | None]) -> list[str]:
    """What to say where the deployed policy goes where nothing was recorded; `outside`: driver to `outside_range`."""
    share = outside.get("deployed") or 0.0
    said = (
        f"{100.0 * share:.0f} % of what the GP policy visits on the target lies outside the range of the recording; "
        "the GP extrapolates there: record more (collect.episodes, collect.policy=dithered)"
    )
    return [said] if share > MUCH_OUTSIDE else []


def roll_out(
    plant: Plant,
    start: FloatArray,
    actions: FloatArray,
    rng: np.random.Generator,
    memory: Memory | None = None,
) -> FloatArray:
    """(B, T + 1, S): states under the actions (B, T, A), nothing terminates. memory: the plant's, which begins anew."""
    states = [start]
    if memory is None:
        memory = plant.begin(len(start), rng)
    with np.errstate(over="ignore", invalid="ignore"):  # a simulator may run away; what did so is counted
        for k in range(actions.shape[1]):
            states.append(plant.step(states[-1], actions[:, k], memory, rng))
    return np.stack(states, axis=1)


def compare(trajectories: FloatArray, target: FloatArray, channels: Channels) -> dict[str, Any]:
    """How far trajectories (B, T + 1, S) lead from the target's, per channel, angles the short way round.

    rms: root mean square over rollouts and time; bands: median and the 10 % and 90 % quantiles over the rollouts at
    each time step; not_finite: how many rollouts ceased to be finite. These are infinitely far, so that quantiles count
    them among the farthest.
    """
    with np.errstate(invalid="ignore"):  # between infinities lies nothing
        distance = np.abs(difference(trajectories, target, channels))
        distance = np.where(np.isfinite(distance), distance, np.inf)
        quantiles = np.quantile(distance, [0.1, 0.5, 0.9], axis=0)
    kinds = ("q10", "median", "q90")
    return {
        "rms": {
            name: float(np.sqrt(np.mean(distance[:, :, i] ** 2))) for i, name in enumerate(channels.names)
        },
        "bands": {
            name: dict(zip(kinds, quantiles[:, :, i].tolist(), strict=True))
            for i, name in enumerate(channels.names)
        },
        "not_finite": int((~np.isfinite(distance)).any(axis=(1, 2)).sum()),
    }


WARM_UP = 10
"""Steps before a window in which a plant follows the recorded states, so that its memory fills as it would have."""


@dataclass(frozen=True)
class Windows:
    """Pieces of a recording: states (B, WARM_UP + T + 1, S), actions (B, WARM_UP + T, A).

    episode: (B,) which of the episodes; t: (B,) s, the moment of its clock at which the warm-up ends.
    """

    states: FloatArray
    actions: FloatArray
    episode: IntArray
    t: FloatArray

    @property
    def recorded(self) -> FloatArray:
        """(B, T + 1, S): what happened after the warm-up."""
        return self.states[:, WARM_UP:]


def windows_of(episodes: Sequence[Episode], steps: int, most: int, *, dt: float, state: Channels) -> Windows:
    """Up to `most` windows of `steps` steps, one after the other; shorter ones where nothing is long enough.

    None crosses a gap of the clock (control step dt [s]): what was commanded there is not known. Angles of `state` (S)
    run on inside a window, as simulated ones do. Raises UsageError where not even one step can be rolled out.
    """
    between = [
        (i, *stretch)
        for i, episode in enumerate(episodes)
        for stretch in pieces(np.flatnonzero(gaps(episode.t, dt)).tolist(), len(episode))
    ]
    steps = min(steps, max(high - low for _, low, high in between) - WARM_UP)
    if steps < 1:
        raise UsageError(
            f"the recording's episodes are too short to roll out: {WARM_UP + 1} steps without a lost row are needed"
        )
    begins = [
        (i, first) for i, low, high in between for first in range(low, high - WARM_UP - steps + 1, steps)
    ]
    chosen = [begins[i] for i in evenly(len(begins), most)]
    length = WARM_UP + steps
    states = np.stack([episodes[i].states[first : first + length + 1] for i, first in chosen])
    return Windows(
        _run_on(states, state),
        np.stack([episodes[i].actions[first : first + length] for i, first in chosen]),
        np.array([i for i, _ in chosen]),
        np.array([episodes[i].t[first + WARM_UP] for i, first in chosen]),
    )


def _run_on(states: FloatArray, channels: Channels) -> FloatArray:
    """States (B, K, S) without the leaps of whole turns; where a rollout starts, they stay as they were recorded.

    All that is in rad, as the diagnosis has it: not every table says which of its angles wrap.
    """
    angles = [i for i, channel in enumerate(channels) if channel.wraps or channel.unit == "rad"]
    out = states.copy()
    out[..., angles] = np.unwrap(states[..., angles], axis=1)
    return out + (states - out)[:, WARM_UP : WARM_UP + 1]


def replay(plant: Plant, windows: Windows, rng: np.random.Generator) -> FloatArray:
    """(B, T + 1, S): the plant from the window's state on, under the recorded actions.

    For plants whose states are what is measured, and whose clock does not matter; the diagnosis has one for others.
    """
    memory = plant.begin(len(windows.states), rng)
    for k in range(WARM_UP):
        plant.step(windows.states[:, k], windows.actions[:, k], memory, rng)
    return roll_out(plant, windows.states[:, WARM_UP], windows.actions[:, WARM_UP:], rng, memory)
