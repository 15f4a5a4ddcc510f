"""Signals on even grids: velocities by filters with honest edges, and how late the state answers its commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings import clock
from gpsim.recordings.episodes import Interval
from gpsim.recordings.mapping import ImportMapping, Smoothing
from gpsim.recordings.tracks import Track, samples

MOST_SAMPLES = 20_000_000  # of one piece or one log: 1 kHz for five hours
TRUNCATE = 4.0  # the Gaussian kernel ends at this many sigma


def reach(smoothing: Smoothing, derivative: bool) -> int:
    """Samples at either end that a full window cannot serve."""
    if smoothing.method == "savgol":
        return smoothing.window // 2
    kernel = ceil(TRUNCATE * smoothing.sigma) if smoothing.method == "gaussian" else 0
    return kernel + (1 if derivative else 0)


def even_grid(t: FloatArray) -> FloatArray:
    """Times (M,) from t[0] to t[-1] [s] in equal steps, as near as can be to the median interval of t."""
    usual = float(np.median(np.diff(t)))
    if (t[-1] - t[0]) / usual > MOST_SAMPLES:
        raise UsageError(
            f"{t[-1] - t[0]:.6g} s without a gap at a usual step of {usual:.3g} s are more than {MOST_SAMPLES:.0e} "
            "samples, too many to differentiate; a smaller gap_limit cuts them"
        )
    steps = max(1, round((t[-1] - t[0]) / usual))
    return np.linspace(t[0], t[-1], steps + 1)


def smoothed(values: FloatArray, smoothing: Smoothing) -> FloatArray:
    """Values (N,) on an even grid, smoothed; the ends by a line or polynomial fitted inside the data."""
    return _filtered(values, 1.0, smoothing, derivative=False)


def derivative(values: FloatArray, step: float, smoothing: Smoothing) -> FloatArray:
    """The rate of change (N,) per second of samples on an even grid of `step` [s].

    gaussian: Gaussian smoothing of sigma samples, then central differences; savgol: the derivative of the
    polynomial fitted in each window (Savitzky and Golay 1964); none: central differences. The first and last
    `reach` samples come from a one-sided fit; nothing is reflected.
    """
    return _filtered(values, step, smoothing, derivative=True)


def _filtered(values: FloatArray, step: float, smoothing: Smoothing, derivative: bool) -> FloatArray:
    edge = reach(smoothing, derivative)
    if len(values) < 2:
        return np.zeros_like(values) if derivative else values.copy()
    if smoothing.method == "savgol":
        from scipy.signal import savgol_coeffs  # here: half a second that most commands need not wait for

        kernel = savgol_coeffs(smoothing.window, smoothing.order, deriv=int(derivative), delta=step)
        inner = np.convolve(values, kernel, mode="same") if len(values) >= smoothing.window else values * 0.0
    else:
        inner = values
        if smoothing.method == "gaussian":
            inner = gaussian_filter1d(values, smoothing.sigma, mode="nearest", truncate=TRUNCATE)
        inner = np.gradient(inner, step) if derivative else inner
    inner = np.asarray(inner, dtype=np.float64).copy()
    # A piece that no window fits into is one-sided throughout: a line (gaussian, none) or polynomial (savgol) through
    # the samples that exist around each.
    half = max(2, reach(smoothing, derivative=True))
    for i in sorted({*range(min(edge, len(values))), *range(max(len(values) - edge, 0), len(values))}):
        low, high = max(0, i - half), min(len(values), i + half + 1)
        x = np.arange(low, high) - float(i)
        gaussian = smoothing.method == "gaussian"
        weight = np.exp(-0.25 * (x / smoothing.sigma) ** 2) if gaussian else np.ones(len(x))
        order = min(smoothing.order if smoothing.method == "savgol" else 1, len(x) - 1)
        powers = np.vander(x, order + 1, increasing=True)
        fit = np.linalg.lstsq(powers * weight[:, None], values[low:high] * weight, rcond=None)[0]
        inner[i] = fit[1] / step if derivative else fit[0]
    return inner


@dataclass(frozen=True)
class Lag:
    """How much later a response moves than its command: lag [s] at the peak of their correlation (-1..1)."""

    command: str
    response: str
    lag: float
    correlation: float
    within: float

    @property
    def usable(self) -> bool:
        """A clear peak inside the searched range; otherwise the lag means nothing."""
        return abs(self.correlation) >= 0.5 and abs(self.lag) < self.within


def estimate_lag(
    names: tuple[str, str], pieces: Sequence[tuple[FloatArray, FloatArray]], step: float, within: float = 1.0
) -> Lag:
    """Cross-correlate command and response over episodes; the peak is refined by a parabola.

    names: command, response. pieces: per episode (command, response), each (N,) on an even grid of `step`.
    The lag holds the system's own delay and inertia as well as any offset between the clocks: it is an
    upper bound of the latter, to be shown, not believed.
    """
    reach = max(1, round(within / step))
    covariance = np.zeros(2 * reach + 1)
    power = np.zeros((2, 2 * reach + 1))
    means = [np.mean(np.concatenate([piece[i] for piece in pieces])) for i in (0, 1)]
    for command, response in pieces:
        u, r = command - means[0], response - means[1]
        covariance += _correlation(r, u, reach)
        power[0] += _correlation(np.ones_like(r), u * u, reach)
        power[1] += _correlation(r * r, np.ones_like(u), reach)
    scale = np.sqrt(np.clip(power[0], 0.0, None) * np.clip(power[1], 0.0, None))
    curve = np.divide(
        covariance, scale, out=np.zeros_like(scale), where=scale > 1e-12 * (scale.max() + 1e-300)
    )
    peak = int(np.argmax(np.abs(curve)))
    shift = 0.0
    if 0 < peak < 2 * reach:
        left, top, right = curve[peak - 1 : peak + 2]
        bend = left - 2.0 * top + right
        shift = float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend != 0 else 0.0
    return Lag(*names, lag=(peak - reach + shift) * step, correlation=float(curve[peak]), within=reach * step)


def _correlation(later: FloatArray, earlier: FloatArray, reach: int) -> FloatArray:
    """sum_i later[i + k] earlier[i] for k = -reach..reach."""
    from scipy.signal import correlate  # here: half a second that most commands need not wait for

    full = correlate(later, earlier, mode="full", method="fft")
    centre = len(earlier) - 1
    out = np.zeros(2 * reach + 1)
    low, high = max(-reach, -centre), min(reach, len(later) - 1)
    out[low + reach : high + reach + 1] = full[centre + low : centre + high + 1]
    return out


STEP = 0.01  # finest grid of the correlation [s]
MOST = 20_000_000  # samples of a piece; one that is far longer than its pace lets expect tells nothing


Piece = tuple[Mapping[str, Track], ImportMapping, Sequence[Interval]]
"""Tracks by their names, what they are, and the intervals in which episodes lie."""


def estimates(parts: Sequence[Piece]) -> list[Lag]:
    """For every command that moves, the response that follows it best, on one even grid over all episodes.

    A response is the rate of a channel, or a pose's speed along its heading.
    """
    step: float | None = None
    pairs: dict[tuple[str, str], list[tuple[FloatArray, FloatArray]]] = {}
    for tracks, mapping, intervals in parts:
        measured = [(s, tracks[s.track]) for s in mapping.measured]
        pace = [float(np.median(np.diff(track.t))) for _, track in measured if len(track.t) > 1]
        step = max([STEP, *pace]) if step is None else step
        for a, b in intervals:
            at = np.arange(a, b, step) if (b - a) / step <= MOST else np.zeros(0)
            if len(at) < 20:
                continue
            signals = {s.name: np.interp(at, track.t, samples(s, track)) for s, track in measured}
            rates = {  # the filter is even, so it adds no lag
                name: np.gradient(gaussian_filter1d(v, 2.0, mode="nearest"), step)
                for name, v in signals.items()
            }
            responses = {f"rate of {name}": rate for name, rate in rates.items()}
            if {"x", "y", "yaw"} <= set(signals):
                yaw = signals["yaw"]
                responses["forward speed"] = rates["x"] * np.cos(yaw) + rates["y"] * np.sin(yaw)
            for source in mapping.action:
                track = tracks[source.track]
                command = clock.held(at, track.t, samples(source, track))
                for name, response in responses.items():
                    pairs.setdefault((source.name, name), []).append((command, response))
    found: dict[str, Lag] = {}
    for names, pieces in pairs.items():
        assert step is not None
        longest = max(len(command) for command, _ in pieces) * step
        lag = estimate_lag(names, pieces, step, within=min(max(1.0, 5 * step), 0.25 * longest))
        known = found.get(lag.command)
        if known is None or abs(lag.correlation) > abs(known.correlation):
            found[lag.command] = lag
    return [lag for lag in found.values() if lag.correlation != 0.0]
