"""Fast batch prediction (GPML algorithm 2.1, lines 4 to 6) for the GPs of all rates over the same raw inputs.

With features phi(x) = [u, u^2, 1], u = x - shift the centred input, everything that a prediction needs of x is a
matrix product: the RBF's exponent against every training row, the linear covariances, the prior variance, and
the whole linear and bias part of the mean, which collapses to one weight vector. A call is a handful of BLAS
calls and one exp. Inside, inputs are columns: each output's part of a matrix, and each strip of a root, is then
contiguous.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .kernels import FloatArray, HyperParameters, read_only
from .training_data import Standardisation

if TYPE_CHECKING:
    from .exact import PosteriorTerms
    from .fitting import GaussianProcess

# Elements of the (rows, training rows) matrices that one chunk may hold: 512 kB each, which a core's cache holds;
# and rows that it has at least, below which a matrix product is slow.
CHUNK_ELEMENTS, LEAST_ROWS = 64_000, 64

# Columns of a strip of a triangular root. The strip's product leaves out the zeros below it, nearly half the work at a
# few hundred rows, and keeps to one thread where BLAS would split a triangular product, which collapses when other
# processes hold the cores.
STRIP = 64

# exp of less is subnormal or nothing, either of which takes the processor longer than a number; e^-300 (1e-130) is
# lost in every sum that it enters.
LEAST_EXPONENT = -300.0


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

    def __init__(self, outputs: Sequence[Output | GaussianProcess]) -> None:
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
        roots = [output.terms.root for output in self.outputs]
        self._supports = _blocks([root.shape[0] for root in roots])
        self._columns = _blocks([root.shape[1] for root in roots])
        self._strips = [_strips(root) for root in roots]
        # Exponent, mean, prior and cross of all outputs, one below the other, so that one product serves all four.
        parts = list(zip(*(_linear_forms(output, shift) for output in self.outputs), strict=True))
        self._linear = np.vstack([row for part in parts for row in part])
        self._cuts = np.cumsum([sum(map(len, part)) for part in parts]).tolist()
        self._linear_mean = self._linear[: self._cuts[1]]
        # Block diagonal, so that one product serves all outputs.
        self._weights = np.zeros((len(roots), self._supports[-1].stop))
        self._sums = np.zeros((len(roots), self._columns[-1].stop))
        for row, output in enumerate(self.outputs):
            weights = output.terms.weights * output.standardisation.target_scale
            self._weights[row, self._supports[row]] = weights
            self._sums[row, self._columns[row]] = 1.0
        square_scales = np.array([output.standardisation.target_scale**2 for output in self.outputs])
        noise = np.array([output.hyper_parameters.noise_std**2 for output in self.outputs])
        self.noise_variances = read_only(noise * square_scales)
        self._square_scales = square_scales[:, None]
        self._chunk = max(LEAST_ROWS, CHUNK_ELEMENTS // self._supports[-1].stop)

    def mean(self, inputs: ArrayLike) -> FloatArray:
        """Predictive mean (4.7): raw inputs (B, D) -> (B, R)."""
        features = self._features(inputs)
        return _joined([self._mean_of(self._linear_mean.dot(some)) for some in self._chunks(features)])

    @property
    def mean_form(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The mean for other programs: shift (D,), linear (M + R, 2 D + 1), weights (R, M).

        With u = x - shift and f = linear [u, u^2, 1] it is weights exp(f[:M]) + f[M:].
        """
        return self._shift[:, 0].copy(), self._linear_mean.copy(), self._weights.copy()

    def mean_and_variance(self, inputs: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Mean (4.7) and latent variance (4.8), noise left out: raw inputs (B, D) -> (B, R) and (B, R)."""
        features = self._features(inputs)
        means, variances = [], []
        for some in self._chunks(features):
            # .dot and not @ throughout: at these sizes the dispatch of @ costs as much as the product.
            linear = self._linear.dot(some)
            means.append(self._mean_of(linear))
            variances.append(self._variance_of(linear))
        return _joined(means), _joined(variances)

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
        """Raw inputs (B, D) -> phi as columns (2 D + 1, B)."""
        raw = np.asarray(inputs, dtype=np.float64)
        d = self.dimension
        if raw.ndim != 2 or raw.shape[1] != d:
            raise ValueError(f"inputs must have shape (B, {d}), got {raw.shape}")
        features = np.empty((2 * d + 1, raw.shape[0]))
        np.subtract(raw.T, self._shift, out=features[:d])
        np.square(features[:d], out=features[d:-1])
        features[-1] = 1.0
        return features

    def _mean_of(self, linear: FloatArray) -> FloatArray:
        """(R, B) of the linear forms' values, whose exponents become the RBF covariances."""
        similarity = linear[: self._cuts[0]]
        np.maximum(similarity, LEAST_EXPONENT, out=similarity)
        np.exp(similarity, out=similarity)
        means: FloatArray = self._weights.dot(similarity)
        means += linear[self._cuts[0] : self._cuts[1]]
        return means

    def _variance_of(self, linear: FloatArray) -> FloatArray:
        """(R, B): GPML algorithm 2.1, lines 5 and 6, after `_mean_of`."""
        covariances, prior = linear[: self._cuts[0]], linear[self._cuts[1] : self._cuts[2]]
        covariances += linear[self._cuts[2] :]
        v = np.empty((self._columns[-1].stop, linear.shape[1]))  # L^-1 k* of all outputs, one below the other
        stop = 0
        for strips, block in zip(self._strips, self._supports, strict=True):
            own = covariances[block]
            for strip in strips:
                start, stop = stop, stop + len(strip)
                np.dot(strip, own[: strip.shape[1]], out=v[start:stop])
        np.square(v, out=v)
        variances: FloatArray = prior - self._sums.dot(v)
        # Rounding may leave a hair below zero at the training rows.
        np.maximum(variances, 0.0, out=variances)
        variances *= self._square_scales
        return variances

    def _chunks(self, features: FloatArray) -> list[FloatArray]:
        """Columns in pieces of bounded size; one piece where there are none."""
        count = features.shape[1]
        if count <= self._chunk:
            return [features]
        return [features[:, start : start + self._chunk] for start in range(0, count, self._chunk)]


def _joined(parts: Sequence[FloatArray]) -> FloatArray:
    """Pieces (R, b) -> (B, R)."""
    return parts[0].T if len(parts) == 1 else np.hstack(parts).T


def _blocks(sizes: Sequence[int]) -> list[slice]:
    """Where pieces of these sizes lie, one after the other."""
    stops = np.cumsum(sizes).tolist()
    return [slice(stop - size, stop) for stop, size in zip(stops, sizes, strict=True)]


def _strips(root: FloatArray) -> list[FloatArray]:
    """Strips of the transposed root (P, M), an upper triangle's without the zeros to the right of each."""
    turned = root.T
    if np.any(np.triu(turned, 1)):
        return [np.ascontiguousarray(turned)]
    return [np.ascontiguousarray(turned[i : i + STRIP, : i + STRIP]) for i in range(0, len(turned), STRIP)]


def _linear_forms(output: Output, shift: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """All of (4.9) as linear forms of phi; the output's own standardised input is z = a u + b.

    Coefficients of the exponent (M, 2 D + 1), mean and prior (1, 2 D + 1), and cross covariance (M, 2 D + 1).
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
    return exponent.T, mean[None], prior[None], cross.T
