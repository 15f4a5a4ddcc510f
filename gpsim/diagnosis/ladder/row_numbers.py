"""Numbers of rows of inverse dynamics: least squares of all joints at once, and a filter without a delay."""

from __future__ import annotations

import numpy as np

from gpsim.channels import BoolArray, FloatArray

ORDER = 3  # of the filter (Butterworth)
BLOCKS, ROUNDS = 16, 4  # of rows, each left out once; of weights by what is left at each joint
PARTED = 0.5  # of a prior's deviation, too much to tell


def least_squares(
    columns: FloatArray, lacks: FloatArray, counts: FloatArray, prior: FloatArray, bounds: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray, FloatArray, FloatArray]:
    """Sizes (P,) of columns (K, C, P) between bounds, deviations, whether they are told; mean squares of joints."""
    from scipy.optimize import lsq_linear  # here: most commands need not wait for it

    a, y = columns * counts[:, :, None] * prior, lacks * counts
    blocks = np.array_split(np.arange(len(y)), BLOCKS)
    h = np.stack([np.matmul(a[b].transpose(1, 2, 0), a[b].transpose(1, 0, 2)) for b in blocks])
    g = np.stack([np.einsum("kcp,kc->cp", a[b], y[b]) for b in blocks])
    number = np.maximum((counts**2).sum(axis=0), 1.0)
    was = left = (y**2).sum(axis=0) / number + 1e-300
    low, high = bounds / prior
    for turn in range(ROUNDS):
        weights = 1.0 / np.maximum(left, 1e-9 * was)
        by_block, pulls = np.einsum("bcpq,c->bpq", h, weights), np.einsum("bcp,c->bp", g, weights)
        full, pull = by_block.sum(axis=0) + np.eye(len(prior)), pulls.sum(axis=0)
        x = np.linalg.solve(full, pull)
        if turn == ROUNDS - 1 and ((x < low) | (x > high)).any():
            root = np.linalg.cholesky(full).T
            x = lsq_linear(root, np.linalg.solve(root.T, pull), (low, high), "bvls").x
        left = ((y - a @ x) ** 2).sum(axis=0) / number
    free = (x > low) & (x < high)
    less = full - by_block
    beside = (pull - pulls - less[:, :, ~free] @ x[~free])[:, free, None]
    said = np.linalg.solve(less[:, free][:, :, free], beside)[:, :, 0]
    deviations = (own := np.sqrt(np.diag(np.linalg.inv(full)))).copy()
    deviations[free] = np.maximum(own[free], np.sqrt((BLOCKS - 1) * said.var(axis=0)))
    return x * prior, deviations * prior, deviations < PARTED, was, left


def below(band: float, x: FloatArray, dt: float, count: int = 1) -> FloatArray:
    """(count, N, ...): x (N, ...) below a frequency [Hz], without a delay, odd beyond its ends; then derivatives."""
    n, along = len(x), (-1, *(1,) * (x.ndim - 1))
    slope = (x[-1] - x[0]) / (n - 1)
    line = x[0] + slope * np.arange(n).reshape(along)
    odd = np.concatenate([x - line, (line - x)[-2:0:-1]])
    f = np.fft.rfftfreq(len(odd), dt).reshape(along)
    spectrum = np.fft.rfft(odd, axis=0) / (1.0 + (f / band) ** (2 * ORDER))
    out = [np.fft.irfft(spectrum * (2j * np.pi * f) ** k, len(odd), axis=0)[:n] for k in range(count)]
    for part, more in zip(out, (line, slope / dt), strict=False):
        part += more
    return np.stack(out)
