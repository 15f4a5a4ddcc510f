"""Whether a residual is white: what chance leaves, and what it does not."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtr

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting.problem import Problem
from gpsim.diagnosis.fitting.shooting import Fit, Shooting

WHITENESS_LAGS = 3  # lags at which a white residual must not be correlated [samples]
AT_FLOOR = 1.01  # times the floor (known noise, numerical error): a residual that small is white
PROJECTED_WINDOWS = 60
"""Over which the share is averaged that fitting start states takes off white noise [windows]."""


def autocorrelation(problem: Problem, residual: FloatArray, lags: int) -> FloatArray:
    """(S, lags) autocorrelation of the residual (W, L + 1, S) within windows, at lags 1 ... lags."""
    power = (residual**2).sum(axis=(0, 1))
    counted = problem.counted
    total = np.maximum(counted.sum(axis=(0, 1)).astype(np.float64), 1.0)
    out = np.zeros((residual.shape[2], lags))
    for lag in range(1, min(lags, residual.shape[1] - 1) + 1):
        pairs = (residual[:, lag:] * residual[:, :-lag]).sum(axis=(0, 1))
        share = np.maximum((counted[:, lag:] & counted[:, :-lag]).sum(axis=(0, 1)), 1.0) / total
        out[:, lag - 1] = np.divide(pairs, power * share, out=np.zeros_like(power), where=power > 0)
    return out


def whiteness(problem: Problem, fit: Fit) -> tuple[float, float]:
    """(p_value, size): is the residual white, beyond its floor? size: the autocorrelation where it is least so.

    A one-sided test for positive correlation at short lags, each window one independent draw (Student 1908: their
    scatter is estimated from as many). Start states were fitted to the same samples, which correlates even white
    noise; that share is known exactly and taken off.
    """
    windows = problem.windows
    if len(windows) < 2:
        return 1.0, 0.0
    lags = WHITENESS_LAGS
    rho = autocorrelation(problem, fit.residuals, lags)
    seen = np.flatnonzero(problem.observed)
    expected = _fitted_share(problem, fit, lags)
    worst, size = 1.0, 0.0
    for place, channel in enumerate(seen):
        power = float((fit.residuals[..., channel] ** 2).sum()) / max(problem.counts[channel], 1.0)
        if power <= (AT_FLOOR * problem.floor[channel]) ** 2:
            continue  # the floor (known noise, numerical error) is all there is
        # In units of the window's own power: one loud window must not drown what all others say.
        freedom = problem.counts[channel] / len(windows)
        own = (fit.residuals[..., channel] ** 2).sum(axis=1) / freedom
        own = np.maximum(own, max(float(problem.floor[channel]) ** 2, 1e-300))
        for lag in range(lags):
            products = _lag_products(fit.residuals[..., channel], lag + 1) / own + expected[place, lag]
            scatter = float(products.std(ddof=1)) / np.sqrt(len(products))
            p = float(stdtr(len(products) - 1, -float(products.mean()) / max(scatter, 1e-300)))
            if p < worst:
                worst, size = p, float(rho[channel, lag])
    return min(1.0, worst * lags * len(seen)), size


def unexplained(problem: Problem, fit: Fit) -> float:
    """Nats of a fit's misfit beyond the sensors' noise, as stated or as neighbours do not share it."""
    noise, total = fit.noise, 0.0
    own = sensor_noise(problem, fit.residuals)
    for i in np.flatnonzero(problem.observed):
        weights = noise.weights[..., i]
        scale = noise.white[i] ** 2 * noise.times[i]
        cost = 0.5 * float(((fit.residuals[..., i] * weights) ** 2).sum()) / scale
        known = 0.5 * float((weights > 0).sum()) * float(own[i]) ** 2 / scale
        total += max(0.0, cost - BEYOND_CHANCE * known)
    return total


def sensor_noise(problem: Problem, residuals: FloatArray) -> FloatArray:
    """(S,) standard deviation of every channel's noise: as stated, else by second differences.

    Smooth errors of a model do not move these.
    """
    second, counted = np.diff(residuals, n=2, axis=1) / np.sqrt(6.0), problem.counted
    sound = counted[:, 2:] & counted[:, 1:-1] & counted[:, :-2]
    rough = [
        np.sqrt(np.mean(second[..., i][sound[..., i]] ** 2)) if sound[..., i].any() else 0.0
        for i in range(len(problem.floor))
    ]
    return np.asarray(np.where(problem.stated, problem.floor, np.maximum(rough, problem.floor)))


BEYOND_CHANCE = (
    1.1  # times the squares that noise makes: less may be chance, or a noise that was stated roughly
)


def _fitted_share(problem: Problem, fit: Fit, lags: int) -> FloatArray:
    """(observed channels, lags): what fitting start states takes off a window's lag products of white noise."""
    most = PROJECTED_WINDOWS
    rows = np.linspace(0, len(problem.windows) - 1, min(len(problem.windows), most)).astype(np.int64)
    part = problem.on(problem.windows.take(rows))
    shooting = Shooting(part)
    found = shooting.at(fit.hypothesis, fit.starts[rows])
    shooting.told_by(found.residuals)
    every = shooting.slopes(found, parameters=False).by_start
    seen, (count, samples, _) = np.flatnonzero(problem.observed), found.residuals.shape
    slopes = every.reshape(count, samples, -1, every.shape[2])[:, :, seen]
    channels, dimension = slopes.shape[2:]
    flat = slopes.reshape(count, samples * channels, dimension)
    size = np.sqrt((flat**2).sum(axis=1, keepdims=True))
    flat = flat / np.where(size > 0, size, 1.0)
    basis = np.linalg.svd(flat, full_matrices=False)
    kept = (basis.U * (1e-9 * basis.S[:, :1] < basis.S)[:, None, :]).reshape(count, samples, channels, -1)
    out = np.empty((channels, lags))
    for lag in range(lags):
        out[:, lag] = (kept[:, lag + 1 :] * kept[:, : -lag - 1]).sum(axis=(1, 3)).mean(axis=0)
    return out


def _lag_products(residual: FloatArray, lag: int) -> FloatArray:
    """(W,) sum over a window of residual times the residual `lag` samples later."""
    return np.asarray((residual[:, lag:] * residual[:, :-lag]).sum(axis=1))
