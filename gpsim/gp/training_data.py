"""From raw rows to what the likelihood sees: checked, standardised, replicates averaged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .kernels import FloatArray, read_only

MOST_ROWS = 5000
"""Distinct inputs of an exact fit: one evaluation of the likelihood is seconds there, and a matrix 200 MB."""

# A column whose spread is below this share of its size is constant up to rounding.
CONSTANT_RELATIVE_SPREAD = 1e-13


def checked_inputs(inputs: ArrayLike, dimension: int | None = None) -> FloatArray:
    """Inputs as float64 (N, D), N and D at least 1.

    Raises ValueError for another shape, for a D that is not `dimension`, and for the first value that is not
    finite (naming its row and column).
    """
    array = np.asarray(inputs, dtype=np.float64)
    if array.ndim != 2 or array.shape[0] == 0 or array.shape[1] == 0:
        raise ValueError(f"inputs must have shape (N, D) with N and D at least 1, got {array.shape}")
    if dimension is not None and array.shape[1] != dimension:
        raise ValueError(f"inputs must have {dimension} columns, as in the fit, got {array.shape[1]}")
    check_finite("inputs", array)
    return array


def checked_targets(targets: ArrayLike, rows: int) -> FloatArray:
    """Targets as float64 (N,); ValueError for another shape or a value that is not finite (its row named)."""
    array = np.asarray(targets, dtype=np.float64)
    if array.shape != (rows,):
        raise ValueError(f"targets must have shape ({rows},), one per row of the inputs, got {array.shape}")
    check_finite("targets", array[:, None])
    return array


def check_finite(what: str, table: FloatArray) -> None:
    """Raise ValueError for the first value (row by row) of a table (N, C) that is not finite."""
    bad = np.argwhere(~np.isfinite(table))
    if bad.size:
        row, column = bad[0]
        raise ValueError(
            f"{what} row {row}, column {column} is {table[row, column]}: "
            f"every value must be finite ({len(bad)} such value(s)); drop or repair these rows"
        )


@dataclass(frozen=True, eq=False)
class Standardisation:
    """z = (x - input_mean) / input_scale and y = (t - target_mean) / target_scale.

    Scales are population standard deviations; a constant column has scale 1, so that it becomes exactly 0.
    `input_mean`, `input_scale` (D,) in the inputs' units; `target_mean`, `target_scale` in the target's.
    """

    input_mean: FloatArray
    input_scale: FloatArray
    target_mean: float
    target_scale: float

    def inputs(self, raw: FloatArray) -> FloatArray:
        """Raw (N, D) -> standardised (N, D)."""
        return np.asarray((raw - self.input_mean) / self.input_scale)

    def targets(self, raw: FloatArray) -> FloatArray:
        """Raw (N,) -> standardised (N,)."""
        return np.asarray((raw - self.target_mean) / self.target_scale)

    @staticmethod
    def of(inputs: FloatArray, targets: FloatArray) -> Standardisation:
        """Measured on the rows (N, D) and (N,) as they are, replicates counted as often as they occur."""
        input_mean, input_scale = _mean_and_scale(inputs)
        target_mean, target_scale = _mean_and_scale(targets[:, None])
        return Standardisation(
            read_only(input_mean), read_only(input_scale), float(target_mean[0]), float(target_scale[0])
        )


def _mean_and_scale(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(N, D) -> mean (D,), scale (D,)."""
    constant = constant_columns(columns)
    # The mean of equal numbers may differ from them in the last digit: take the number itself.
    mean = np.where(constant, columns[0], columns.mean(axis=0))
    return mean, np.where(constant, 1.0, columns.std(axis=0))


def constant_columns(columns: FloatArray) -> np.ndarray:
    """(N, D) -> (D,) of bool: columns that hold one value, up to rounding."""
    return np.asarray(np.ptp(columns, axis=0) <= CONSTANT_RELATIVE_SPREAD * np.abs(columns).max(axis=0))


class TooManyRowsError(ValueError):
    """More distinct inputs than an exact fit takes."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Standardised data of one GP; with averaged replicates one row per distinct input.

    `inputs` (M, D); `targets` (M,) mean of each row's replicates; `counts` (M,) n_i replicates of row i, so
    that the noise variance of row i is sigma^2 / n_i; `scatter` sum over all rows of squared deviations from
    their group's mean.
    """

    inputs: FloatArray
    targets: FloatArray
    counts: FloatArray
    scatter: float

    @property
    def rows(self) -> int:
        """N, replicates counted."""
        return int(self.counts.sum())

    @staticmethod
    def of(inputs: FloatArray, targets: FloatArray, average_replicates: bool) -> TrainingData:
        """From standardised rows (N, D) and (N,); distinct inputs keep the order of first appearance.

        Raises TooManyRowsError for more distinct ones than MOST_ROWS.
        """
        counts: np.ndarray = np.ones(len(targets))
        scatter = 0.0
        if average_replicates:
            _, first, group, found = np.unique(
                inputs, axis=0, return_index=True, return_inverse=True, return_counts=True
            )
            if found.max() > 1:
                group, order = group.reshape(-1), np.argsort(first)
                means = np.bincount(group, weights=targets) / found
                scatter = float(np.sum((targets - means[group]) ** 2))
                inputs, targets, counts = inputs[first[order]], means[order], found[order]
        if counts.size > MOST_ROWS:
            raise TooManyRowsError(
                f"{counts.size} distinct inputs; an exact Gaussian process allows at most {MOST_ROWS}: fit a subsample"
            )
        return TrainingData(read_only(inputs), read_only(targets), read_only(counts), scatter)
