"""Fast batch prediction (GPML algorithm 2.1, lines 4 to 6) for the GPs of all rates over the same raw inputs.

With features phi(x) = [u, u^2, 1], u = x - shift the centred input, everything that a prediction needs of x is a
matrix product: the RBF's exponent against every training row, the linear covariances, the prior variance, and
the whole linear and bias part of the mean, which collapses to one weight vector. A call is a handful of BLAS
calls and one exp.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import blas

from .exact import PosteriorTerms
from .kernels import FloatArray, HyperParameters, read_only
from .training_data import Standardisation

# Elements of the (rows, training rows) matrices that one chunk may hold: 512 kB each, which a core's cache holds;
# and rows that it has at least, below which a matrix product is slow.
CHUNK_ELEMENTS, LEAST_ROWS = 64_000, 64

# Rows from which a triangular product (half the work) beats a full one. Below, it gains nothing on one thread,
# and BLAS would split it over several, which collapses when other processes hold the cores.
TRIANGULAR_FROM_ROWS = 512


class PosteriorOutput(Protocol):
    """What one output of a predictor is made of; `GaussianProcess` and `Output` are such."""

    @property
    def standardisation(self) -> Standardisation:
        """Between raw and standardised units."""

    @property
    def hyper_parameters(self) -> HyperParameters:
        """In standardised units."""

    @property
    def terms(self) -> PosteriorTerms:
        """In standardised units."""


@dataclass(frozen=True, eq=False)
class Output:
    """One output's standardisation, standardised hyper-parameters and posterior terms."""

    standardisation: Standardisation
    hyper_parameters: HyperParameters
    terms: PosteriorTerms


class Predictor:
    """Means, variances and samples of R GPs at B raw inputs of D columns, in the targets' units.

    Variances are of the latent function f (4.8), without noise; `noise_variances` (R,), in squared target
    units, is what the observation noise adds. An input that is not finite gives a prediction that is not
    finite: check before, where that can happen. Large batches are worked through in chunks
    (`CHUNK_ELEMENTS`), so memory stays bounded; the variance still costs B N^2 multiplications.
    """

    def __init__(self, outputs: Sequence[PosteriorOutput]) -> None:
        """One output per GP, in the order of the columns of every result; ValueError if their D disagree."""
        if not outputs:
            raise ValueError("a predictor needs at least one GP")
        self.outputs = tuple(Output(o.standardisation, o.hyper_parameters, o.terms) for o in outputs)
        dimensions = {output.hyper_parameters.dimension for output in self.outputs}
        if len(dimensions) != 1:
            raise ValueError(
                f"all GPs of a predictor take the same inputs, got numbers of inputs {sorted(dimensions)}"
            )
        self.dimension = dimensions.pop()
        shift = self.outputs[0].standardisation.input_mean
        self._shift = shift[:, None]
        forms = [_linear_forms(output, shift) for output in self.outputs]
        self._exponent = np.hstack([form.exponent for form in forms])
        self._cross = np.hstack([form.cross for form in forms])
        self._line = np.column_stack([form.mean for form in forms])
        self._prior = np.column_stack([form.prior for form in forms])
        self._roots = [output.terms.root for output in self.outputs]
        self._triangular = [_pays_as_triangular(root) for root in self._roots]
        sizes = [output.terms.weights.size for output in self.outputs]
        stops = np.cumsum(sizes)
        self._blocks = [slice(stop - size, stop) for stop, size in zip(stops.tolist(), sizes, strict=True)]
        # Block diagonal, so that one product serves all outputs.
        self._weights = np.zeros((int(stops[-1]), len(self.outputs)))
        for column, (block, output) in enumerate(zip(self._blocks, self.outputs, strict=True)):
            self._weights[block, column] = output.terms.weights * output.standardisation.target_scale
        self._square_scales = np.array([output.standardisation.target_scale**2 for output in self.outputs])
        noise = np.array([output.hyper_parameters.noise_std**2 for output in self.outputs])
        self.noise_variances = read_only(noise * self._square_scales)
        self._chunk = max(LEAST_ROWS, CHUNK_ELEMENTS // int(stops[-1]))

    def mean(self, inputs: ArrayLike) -> FloatArray:
        """Predictive mean (4.7): raw inputs (B, D) -> (B, R)."""
        features = self._features(inputs)
        if len(features) <= self._chunk:
            return self._mean_of(features, self._similarity(features))
        means = np.empty((len(features), len(self.outputs)))
        for rows in self._chunks(len(features)):
            means[rows] = self._mean_of(features[rows], self._similarity(features[rows]))
        return means

    def mean_and_variance(self, inputs: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Mean (4.7) and latent variance (4.8), noise left out: raw inputs (B, D) -> (B, R) and (B, R)."""
        features = self._features(inputs)
        if len(features) <= self._chunk:
            return self._mean_and_variance_of(features)
        means = np.empty((len(features), len(self.outputs)))
        variances = np.empty_like(means)
        for rows in self._chunks(len(features)):
            means[rows], variances[rows] = self._mean_and_variance_of(features[rows])
        return means, variances

    def sample(self, inputs: ArrayLike, rng: np.random.Generator, *, include_noise: bool) -> FloatArray:
        """One draw per row and output, all independent (the thesis's per-step sampling): (B, D) -> (B, R).

        Independent rows: two equal rows get different draws, so this is not one function drawn from the
        posterior. `include_noise`: draw an observation (latent variance plus noise variance) instead of the
        latent function.
        """
        means, variances = self.mean_and_variance(inputs)
        if include_noise:
            variances += self.noise_variances
        np.sqrt(variances, out=variances)
        variances *= rng.standard_normal(means.shape)
        means += variances
        return means

    def _features(self, inputs: ArrayLike) -> FloatArray:
        """Raw inputs (B, D) -> phi as (B, 2 D + 1), transposed in memory: its parts are then contiguous."""
        raw = np.asarray(inputs, dtype=np.float64)
        d = self.dimension
        if raw.ndim != 2 or raw.shape[1] != d:
            raise ValueError(f"inputs must have shape (B, {d}), got {raw.shape}")
        features = np.empty((2 * d + 1, raw.shape[0]))
        np.subtract(raw.T, self._shift, out=features[:d])
        np.square(features[:d], out=features[d:-1])
        features[-1] = 1.0
        return features.T

    def _similarity(self, features: FloatArray) -> FloatArray:
        """RBF covariances with every training row of every output."""
        # .dot and not @ throughout: at these sizes the dispatch of @ costs as much as the product.
        similarity: FloatArray = features.dot(self._exponent)
        np.exp(similarity, out=similarity)
        return similarity

    def _mean_of(self, features: FloatArray, similarity: FloatArray) -> FloatArray:
        means: FloatArray = features.dot(self._line)
        means += similarity.dot(self._weights)
        return means

    def _mean_and_variance_of(self, features: FloatArray) -> tuple[FloatArray, FloatArray]:
        covariances = self._similarity(features)
        means = self._mean_of(features, covariances)
        covariances += features.dot(self._cross)
        variances = features.dot(self._prior)
        for column, block in enumerate(self._blocks):
            variances[:, column] -= self._explained(column, covariances[:, block])
        # Rounding may leave a hair below zero at the training rows.
        np.maximum(variances, 0.0, out=variances)
        variances *= self._square_scales
        return means, variances

    def _explained(self, column: int, covariances: FloatArray) -> FloatArray:
        """GPML algorithm 2.1, lines 5 and 6: |v|^2 of every row, v = L^-1 k*; (B, M) -> (B,)."""
        root = self._roots[column]
        if self._triangular[column] and covariances.size:
            v = blas.dtrmm(1.0, root.T, covariances.T, lower=1)
        else:
            v = root.T.dot(covariances.T)
        return np.asarray(np.einsum("pb,pb->b", v, v))

    def _chunks(self, rows: int) -> Iterator[slice]:
        return (slice(start, start + self._chunk) for start in range(0, rows, self._chunk))


@dataclass(frozen=True, eq=False)
class _LinearForms:
    """Coefficients of phi(x) = [u, u^2, 1] for one output: (2 D + 1, M) twice, then (2 D + 1,) twice."""

    exponent: FloatArray
    cross: FloatArray
    mean: FloatArray
    prior: FloatArray


def _pays_as_triangular(root: FloatArray) -> bool:
    rows, columns = root.shape
    return rows == columns and rows >= TRIANGULAR_FROM_ROWS and not np.any(np.tril(root, -1))


def _linear_forms(output: Output, shift: FloatArray) -> _LinearForms:
    """All of (4.9) as linear forms of phi; the output's own standardised input is z = a u + b.

    One shift serves all outputs, whatever rows each was fitted to; b is zero for those fitted to the same rows.
    """
    own, hyper, terms = output.standardisation, output.hyper_parameters, output.terms
    a, b = 1.0 / own.input_scale, (shift - own.input_mean) / own.input_scale
    lengths, slopes = hyper.lengthscales**-2, hyper.linear_stds**2
    support = terms.support.T  # (D, M)
    ones = np.ones((1, support.shape[1]))
    offset = support - b[:, None]
    # log sigma_f^2 - sum_d (a u + b - z'_d)^2 / (2 ell_d^2), sorted by powers of u
    constant = 2.0 * np.log(hyper.signal_std) - 0.5 * np.sum(offset**2 * lengths[:, None], axis=0)
    exponent = np.vstack([offset * (a * lengths)[:, None], -0.5 * (a**2 * lengths)[:, None] * ones, constant])
    # sum_d sigma_l,d^2 (a u + b) z'_d + sigma_b^2
    along = support * slopes[:, None]
    bias = np.sum(along * b[:, None], axis=0) + hyper.bias_std**2
    cross = np.vstack([along * a[:, None], 0.0 * along, bias])
    mean = (cross @ terms.weights) * own.target_scale
    mean[-1] += own.target_mean
    # sigma_f^2 + sigma_b^2 + sum_d sigma_l,d^2 (a u + b)^2
    at_zero = hyper.signal_std**2 + hyper.bias_std**2 + np.sum(slopes * b**2)
    prior = np.concatenate([2.0 * slopes * a * b, slopes * a**2, [at_zero]])
    return _LinearForms(exponent, cross, mean, prior)
