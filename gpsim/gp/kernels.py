"""The thesis's covariance function (4.9): ARD RBF + ARD linear + bias, with Gaussian noise (4.5) beside it.

Notation after Rasmussen & Williams, "Gaussian Processes for Machine Learning" (GPML, 2006); docs/method/gp.md has
the table of symbols. Noise is never part of `covariance`: whoever needs it adds it, by name.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def read_only(values: ArrayLike) -> FloatArray:
    """Own float64 copy of `values` that cannot be written to."""
    array = np.array(values, dtype=np.float64, order="C")
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class HyperParameters:
    """Hyper-parameters of (4.9) and (4.5), all of them standard deviations or lengths (never variances).

    `signal_std` sigma_f; `lengthscales` ell_d, shape (D,), unit of input d; `linear_stds` sigma_l,d, shape
    (D,), unit of the target per unit of input d; `bias_std` sigma_b; `noise_std` sigma. Zero switches a
    linear term, the bias or the noise off, but then there is no logarithm to optimise.
    Raises ValueError for a negative or non-finite value, a zero in the RBF term or shapes that disagree.
    """

    signal_std: float
    lengthscales: FloatArray
    linear_stds: FloatArray
    bias_std: float
    noise_std: float

    def __post_init__(self) -> None:
        for name in ("lengthscales", "linear_stds"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        for name in ("signal_std", "bias_std", "noise_std"):
            object.__setattr__(self, name, float(getattr(self, name)))
        if self.lengthscales.ndim != 1 or self.lengthscales.shape != self.linear_stds.shape:
            raise ValueError(
                f"lengthscales {self.lengthscales.shape} and linear_stds {self.linear_stds.shape} "
                "must both have shape (D,), one value per input"
            )
        values = self.to_vector()
        positive = values[: 1 + self.lengthscales.size]
        if not np.all(np.isfinite(values)) or np.any(values < 0.0) or np.any(positive == 0.0):
            raise ValueError(
                f"hyper-parameters must be finite and not negative, those of the RBF term positive: {self}"
            )

    @property
    def dimension(self) -> int:
        """D, the number of inputs."""
        return self.lengthscales.size

    def to_vector(self) -> FloatArray:
        """(2 D + 3,): signal_std, lengthscales, linear_stds, bias_std, noise_std."""
        return np.concatenate(
            [[self.signal_std], self.lengthscales, self.linear_stds, [self.bias_std, self.noise_std]]
        )

    @staticmethod
    def from_vector(vector: ArrayLike) -> HyperParameters:
        """Inverse of `to_vector`."""
        values = np.asarray(vector, dtype=np.float64)
        if values.ndim != 1 or values.size < 5 or values.size % 2 == 0:
            raise ValueError(f"a hyper-parameter vector has shape (2 D + 3,), got {values.shape}")
        d = (values.size - 3) // 2
        return HyperParameters(
            values[0], values[1 : d + 1], values[d + 1 : 2 * d + 1], values[-2], values[-1]
        )

    def to_log_vector(self) -> FloatArray:
        """Natural logarithms of `to_vector`, what the optimiser moves; ValueError if a value is zero."""
        values = self.to_vector()
        if np.any(values <= 0.0):
            raise ValueError("a hyper-parameter of zero has no logarithm: it cannot be optimised")
        return np.log(values)

    @staticmethod
    def from_log_vector(log_vector: ArrayLike) -> HyperParameters:
        """Inverse of `to_log_vector`."""
        return HyperParameters.from_vector(np.exp(np.asarray(log_vector, dtype=np.float64)))

    def names(self) -> tuple[str, ...]:
        """Names in the order of `to_vector`: lengthscales[0] ..."""
        index = range(self.dimension)
        lengths, linears = [f"lengthscales[{d}]" for d in index], [f"linear_stds[{d}]" for d in index]
        return ("signal_std", *lengths, *linears, "bias_std", "noise_std")

    def scaled(self, input_scale: FloatArray, target_scale: float) -> HyperParameters:
        """The same kernel for inputs multiplied by `input_scale` (D,) and targets by `target_scale`."""
        return HyperParameters(
            signal_std=self.signal_std * target_scale,
            lengthscales=self.lengthscales * input_scale,
            linear_stds=self.linear_stds * target_scale / input_scale,
            bias_std=self.bias_std * target_scale,
            noise_std=self.noise_std * target_scale,
        )

    def to_dict(self) -> dict[str, float | list[float]]:
        """JSON-able, by name."""
        return {f.name: np.asarray(getattr(self, f.name)).tolist() for f in fields(self)}


class Interval(NamedTuple):
    """Lower and upper bound, both positive."""

    low: float
    high: float


@dataclass(frozen=True)
class Bounds:
    """Box of the optimiser, in units of the standardised data (inputs and targets have standard deviation 1).

    The noise floor, `noise_std.low`, is the one bound that noise-free data always reach: a well-fitted GP
    then explains everything and drives its noise to zero, where the Cholesky factor of K + sigma^2 I loses
    all its digits. The default 1e-3 (a thousandth of the targets' standard deviation) keeps the condition
    number below about 1e6 N for a prior variance near 1; the fit reports that the floor was reached.
    """

    signal_std: Interval = field(default=Interval(1e-3, 1e2))
    lengthscales: Interval = field(default=Interval(1e-2, 1e3))
    linear_stds: Interval = field(default=Interval(1e-4, 1e1))
    bias_std: Interval = field(default=Interval(1e-4, 1e1))
    noise_std: Interval = field(default=Interval(1e-3, 1e1))

    def __post_init__(self) -> None:
        for item in fields(self):
            low, high = getattr(self, item.name)
            if not 0.0 < low < high < np.inf:
                raise ValueError(f"bounds of {item.name} need 0 < low < high < inf, got ({low}, {high})")
            object.__setattr__(self, item.name, Interval(float(low), float(high)))

    def log_box(self, dimension: int) -> FloatArray:
        """(2 D + 3, 2): logarithms of low and high in the order of `HyperParameters.to_vector`."""
        rows = [self.signal_std, *[self.lengthscales] * dimension, *[self.linear_stds] * dimension]
        return np.log(np.array([*rows, self.bias_std, self.noise_std], dtype=np.float64))


def covariance(a: FloatArray, b: FloatArray, hyper: HyperParameters) -> FloatArray:
    """k(a, b) of (4.9) without noise: inputs (A, D) and (B, D) -> (A, B).

    GPML (5.1) for the RBF term, section 4.2.2 (dot product) for the linear one.
    """
    scaled_a, scaled_b = a / hyper.lengthscales, b / hyper.lengthscales
    # |p - q|^2 = p p' + q q' - 2 p q': one matrix product instead of an (A, B, D) array; rounding may leave
    # it a hair below zero where p = q.
    distance = (
        np.sum(scaled_a**2, axis=1)[:, None] + np.sum(scaled_b**2, axis=1) - 2.0 * scaled_a @ scaled_b.T
    )
    rbf = hyper.signal_std**2 * np.exp(-0.5 * np.maximum(distance, 0.0))
    linear = (a * hyper.linear_stds**2) @ b.T + hyper.bias_std**2
    return np.asarray(rbf + linear)
