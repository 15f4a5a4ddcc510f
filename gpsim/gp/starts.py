"""Where the ascent on the likelihood starts: it has many optima, and structure that a start misses ends as noise."""

from __future__ import annotations

import numpy as np

from .kernels import HyperParameters
from .training_data import TrainingData


def first_start(data: TrainingData) -> HyperParameters:
    """Start read off the data: slopes of the least-squares line for the linear term, the rest for the RBF.

    Lengthscales start at one standard deviation of each input and the noise at a tenth of the targets':
    smoother or noisier starts end more often where noise explains what structure should (GPML section 5.4.1,
    figure 5.5), above all on residuals that jump, as friction's do.
    """
    dimension = data.inputs.shape[1]
    # Ridge of one row's worth: defined for N < D and for constant columns as well.
    weighted = data.inputs * data.counts[:, None]
    slopes = np.linalg.solve(weighted.T @ data.inputs + np.eye(dimension), weighted.T @ data.targets)
    return HyperParameters(1.0, np.ones(dimension), np.maximum(np.abs(slopes), 0.05), 0.1, 0.1)


def random_start(data: TrainingData, rng: np.random.Generator) -> HyperParameters:
    """Log-uniform over what is plausible for standardised data."""
    dimension = data.inputs.shape[1]
    ranges = [(0.3, 3.0), *[(0.3, 10.0)] * dimension, *[(0.01, 1.0)] * dimension, (0.01, 1.0), (0.003, 0.5)]
    low, high = np.log(np.array(ranges)).T
    return HyperParameters.from_log_vector(rng.uniform(low, high))


def wiggly_start(data: TrainingData) -> HyperParameters:
    """The first start, but trusting the data more and turning more often along every input."""
    lengthscales = np.full(data.inputs.shape[1], 0.4)
    return HyperParameters(1.0, lengthscales, first_start(data).linear_stds, 0.1, 0.03)


def turning_starts(data: TrainingData) -> list[HyperParameters]:
    """One start per input that turns quickly along it (a tenth of its spread) and hardly along the others.

    A jump along one input, such as friction's, is an optimum of its own that ascents from other starts miss.
    """
    base, dimension = first_start(data), data.inputs.shape[1]
    lengthscales = np.where(np.eye(dimension, dtype=bool), 0.1, 5.0)
    return [HyperParameters(0.5, row, base.linear_stds, 0.1, 0.03) for row in lengthscales]


def noisy_starts(data: TrainingData) -> list[HyperParameters]:
    """One start per input and pace that turns along it under much noise.

    Under noise as large as the law, ascents from starts that trust the data end where all of it is noise.
    """
    base, dimension = first_start(data), data.inputs.shape[1]
    return [
        HyperParameters(0.7, np.where(row, pace, 5.0), base.linear_stds, 0.1, 0.6)
        for row in np.eye(dimension, dtype=bool)
        for pace in (0.1, 0.3)
    ]
