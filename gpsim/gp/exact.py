"""Exact GP: log marginal likelihood with analytic gradient, and the posterior's terms (GPML algorithm 2.1).

Everything here is in standardised units. The noise variance of a row is v / n_i with v = sigma^2 + JITTER:
the jitter is added here, once, as part of the noise, and nowhere else in the package (so averaging replicates
stays exact). It is not part of the noise that predictions report.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas, lapack

from .kernels import FloatArray, HyperParameters, covariance, read_only
from .training_data import TrainingData

# Variance in units of the standardised targets' variance; far below the default noise floor's 1e-6.
JITTER = 1e-10

# Eigenvalues of the training inputs' covariance below this share of the noise variance say nothing that a prediction
# could use.
DROWNED = 1e-6

_LOG_2PI = float(np.log(2.0 * np.pi))


class NotPositiveDefiniteError(ArithmeticError):
    """K + v/n I has no Cholesky factor here: the noise is too small for the prior variance."""


def log_marginal_likelihood(data: TrainingData, hyper: HyperParameters) -> float:
    """Log p(y | X, theta) of (4.10), GPML (2.30), of all rows, replicates included.

    Raises NotPositiveDefiniteError where the Cholesky factorisation breaks down.
    """
    noise = hyper.noise_std**2 + JITTER
    lower = _cholesky(data, hyper, noise)
    weights, _ = lapack.dpotrs(lower, data.targets, lower=1)
    return _grouped_likelihood(data, noise) + _likelihood(lower, data.targets, weights)


def _cholesky(data: TrainingData, hyper: HyperParameters, noise: float) -> FloatArray:
    """GPML algorithm 2.1, line 2: L with L L^T = K + v/n I; its upper triangle is zero."""
    gram = covariance(data.inputs, data.inputs, hyper)
    gram[np.diag_indices_from(gram)] += noise / data.counts
    lower, info = lapack.dpotrf(gram.T, lower=1, overwrite_a=1, clean=1)
    if info != 0:
        raise NotPositiveDefiniteError(NotPositiveDefiniteError.__doc__)
    return np.asarray(lower)


def _likelihood(lower: FloatArray, targets: FloatArray, weights: FloatArray) -> float:
    """GPML algorithm 2.1, line 7."""
    return float(-0.5 * targets @ weights - np.log(np.diagonal(lower)).sum() - 0.5 * targets.size * _LOG_2PI)


def _grouped_likelihood(data: TrainingData, noise: float) -> float:
    """What averaging replicates takes out of the likelihood: the deviations from each group's mean.

    Rotating the n_i replicates of a group turns them into sqrt(n_i) times their mean and n_i - 1 independent
    contrasts of variance v whose squares add up to the scatter; -log(n_i) / 2 is the Jacobian of that
    sqrt(n_i). Zero where every count is one.
    """
    contrasts = data.rows - data.counts.size
    if contrasts == 0:
        return 0.0
    normal = contrasts * (_LOG_2PI + np.log(noise)) + data.scatter / noise
    return float(-0.5 * (normal + np.log(data.counts).sum()))


@dataclass(frozen=True, eq=False)
class PosteriorTerms:
    """All that a prediction needs from the data, in standardised units.

    mean(x) = k(x, support) weights; latent variance(x) = k(x, x) - |k(x, support) root|^2.
    `support` (M, D), `weights` (M,), `root` (M, P). The exact GP has support = the distinct training inputs,
    weights = alpha and a root of (K + v/n I)^-1: L^-T, or one of fewer columns where few will do. Inducing points
    (none built) would fit the same form with support = the inducing inputs and root root^T = Kuu^-1 - B^-1: the
    seam for N beyond MOST_ROWS.
    """

    support: FloatArray
    weights: FloatArray
    root: FloatArray


def posterior(data: TrainingData, hyper: HyperParameters) -> PosteriorTerms:
    """GPML algorithm 2.1, lines 2, 3 and 5, with the root formed once: a prediction is then a matrix product."""
    noise = hyper.noise_std**2 + JITTER
    lower = _cholesky(data, hyper, noise)
    weights, _ = lapack.dpotrs(lower, data.targets, lower=1)
    root = _lean_root(data, hyper, noise)
    if root.shape[1] > data.counts.size // 2:
        inverse, _ = lapack.dtrtri(lower, lower=1, overwrite_c=1)
        root = np.asarray(inverse.T)
    return PosteriorTerms(data.inputs, read_only(weights), read_only(root))


def _lean_root(data: TrainingData, hyper: HyperParameters, noise: float) -> FloatArray:
    """(M, P): a root of (K + v/n I)^-1 without the directions that the noise drowns; a smooth prior has few others.

    With S = diag(sqrt(n)) and the eigenvalues l and vectors u of S K S, the variance takes (u' S k)^2 / (l + v) off
    the prior's for each; (u' S k)^2 is at most l k(x, x), because the covariance of f at the training inputs and x is
    positive semi-definite. So leaving out all l below DROWNED v makes it larger by DROWNED k(x, x) at the very most.
    """
    scale = np.sqrt(data.counts)[:, None]
    eigenvalues, vectors = np.linalg.eigh(scale * covariance(data.inputs, data.inputs, hyper) * scale.T)
    kept = eigenvalues > DROWNED * noise
    root: FloatArray = scale * vectors[:, kept] / np.sqrt(eigenvalues[kept] + noise)
    return root


class Likelihood:
    """(4.10) and its gradient for one data set, evaluated many times; keeps its (M, M) workspaces.

    One evaluation costs one Cholesky factorisation, one inverse from it and a few products; nothing of size
    (M, M, D) is formed.
    """

    def __init__(self, data: TrainingData) -> None:
        self.data = data
        size, dimension = data.inputs.shape
        self.evaluations = 0
        self._with_ones = np.asfortranarray(np.column_stack([data.inputs, np.ones(size)]))
        self._rbf = np.empty((size, size))
        self._gram = np.empty((size, size))
        self._left = np.ones((size, dimension + 2))
        self._right = np.ones((size, dimension + 2))

    def __call__(self, log_vector: FloatArray) -> tuple[float, FloatArray]:
        """Log likelihood and its gradient (2 D + 3,) by the logarithms of `HyperParameters.to_vector`.

        Raises NotPositiveDefiniteError where the Cholesky factorisation breaks down.
        """
        self.evaluations += 1
        data, hyper = self.data, HyperParameters.from_log_vector(log_vector)
        noise = hyper.noise_std**2 + JITTER
        self._fill_covariance(hyper, noise)
        # Symmetric, so the C-ordered array is its own Fortran-ordered transpose: LAPACK works in place.
        lower, info = lapack.dpotrf(self._gram.T, lower=1, overwrite_a=1, clean=0)
        if info != 0:
            raise NotPositiveDefiniteError(NotPositiveDefiniteError.__doc__)
        alpha, _ = lapack.dpotrs(lower, data.targets, lower=1)
        value = _likelihood(lower, data.targets, alpha) + _grouped_likelihood(data, noise)
        inverse, _ = lapack.dpotri(lower, lower=1, overwrite_c=1)
        return value, self._gradient(hyper, noise, np.asarray(alpha), np.asarray(inverse))

    def _fill_covariance(self, hyper: HyperParameters, noise: float) -> None:
        """RBF part into `_rbf`, the whole K + v/n I into `_gram`."""
        scaled = self.data.inputs / hyper.lengthscales
        half_square = 0.5 * np.einsum("nd,nd->n", scaled, scaled)
        left, right = self._left, self._right
        left[:, :-2] = right[:, :-2] = scaled
        # -|p - q|^2 / 2 + log sigma_f^2 as one product of [p, c - p p'/2, 1] and [q, 1, -q q'/2].
        np.subtract(2.0 * np.log(hyper.signal_std), half_square, out=left[:, -2])
        np.negative(half_square, out=right[:, -1])
        np.matmul(left, right.T, out=self._rbf)
        np.exp(self._rbf, out=self._rbf)
        linear = self._with_ones * np.append(hyper.linear_stds, hyper.bias_std)
        np.matmul(linear, linear.T, out=self._gram)
        self._gram += self._rbf
        self._gram.flat[:: self.data.counts.size + 1] += noise / self.data.counts

    def _gradient(
        self, hyper: HyperParameters, noise: float, alpha: FloatArray, inverse: FloatArray
    ) -> FloatArray:
        """GPML (5.9): d/d theta = tr((alpha alpha^T - Ky^-1) dK/d theta) / 2, with W for the bracket.

        For a kernel term A(x, x') of (4.9) the trace is the sum of W * A, entry by entry; by log ell_d the
        RBF part brings the factor (x_d - x'_d)^2 / ell_d^2, whose weighted sum is two matrix products.
        Only the lower triangle of `inverse` is valid; `inverse` is overwritten.
        """
        data, ones = self.data, self._with_ones
        diagonal = alpha @ (alpha / data.counts) - np.diagonal(inverse) @ (1.0 / data.counts)
        # x_d^T W x_d for each input, and 1^T W 1 in the last place.
        linear = (alpha @ ones) ** 2 - np.sum(ones * blas.dsymm(1.0, inverse, ones, lower=1), axis=0)
        # (W * rbf) [x, 1] = alpha * (rbf (alpha * [x, 1])) - (Ky^-1 * rbf) [x, 1]
        products = alpha[:, None] * (self._rbf @ (alpha[:, None] * ones))
        inverse *= self._rbf.T
        products -= blas.dsymm(1.0, inverse, ones, lower=1)
        quadratic = np.sum(ones * products, axis=0)
        squares = data.inputs**2
        lengths = (products[:, -1] @ squares - quadratic[:-1]) / hyper.lengthscales**2
        gradient = np.concatenate(
            [
                [quadratic[-1]],
                lengths,
                linear[:-1] * hyper.linear_stds**2,
                [linear[-1] * hyper.bias_std**2, 0.0],
            ]
        )
        contrasts = data.rows - data.counts.size
        by_noise = 0.5 * (diagonal + data.scatter / noise**2 - contrasts / noise)
        gradient[-1] = 2.0 * hyper.noise_std**2 * by_noise
        return gradient
