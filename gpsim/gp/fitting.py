"""Fit the hyper-parameters by maximising (4.10): L-BFGS-B on logarithms, early stopping, a few starts.

The likelihood has many optima, and structure that a start misses ends as noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .exact import Likelihood, NotPositiveDefiniteError, PosteriorTerms, log_marginal_likelihood, posterior
from .fit_report import FitOutcome, FitReport, at_bounds
from .kernels import Bounds, FloatArray, HyperParameters
from .training_data import (
    Standardisation,
    TrainingData,
    check_finite,
    checked_inputs,
    checked_targets,
    constant_columns,
)


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


if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

# Stands for "minus infinity" where no Cholesky factor exists: the line search needs a number to shrink from.
_UNUSABLE = 1e25
# Noise above this share of the targets' standard deviation may be structure that the ascent has missed.
_MUCH_NOISE = 0.3


@dataclass(frozen=True)
class FitSettings:
    """How to fit. `bounds`: box of the optimiser in standardised units.

    `restarts`: starts besides the data-driven first one: the best of those that turn quickly along one input; and
    where the better of these leaves much of the targets to noise, the best of those that expect so, one that turns
    along every input, then random ones. Each start is followed for `screening_iterations`, the best one to the end
    (0 restarts: none). The ascent stops when the likelihood gained less than `minimum_improvement` (natural logarithm
    units) over `patience`
    iterations, or at `max_iterations`. `average_replicates`: rows with identical inputs collapse to their mean;
    exact, and faster where there are any.
    """

    bounds: Bounds = field(default_factory=Bounds)
    restarts: int = 3
    screening_iterations: int = 10
    max_iterations: int = 500
    minimum_improvement: float = 3e-2
    patience: int = 5
    average_replicates: bool = True

    def __post_init__(self) -> None:
        if self.restarts < 0:
            raise ValueError(f"restarts must be at least 0, got {self.restarts}")
        for name in ("screening_iterations", "max_iterations", "patience"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not self.minimum_improvement > 0.0:
            raise ValueError(f"minimum_improvement must be positive, got {self.minimum_improvement}")


@dataclass(frozen=True, eq=False)
class GaussianProcess:
    """One GP: data, hyper-parameters (standardised units) and posterior terms. Predict with `Predictor`.

    `report` is None where the hyper-parameters were given and not fitted.
    """

    standardisation: Standardisation
    data: TrainingData
    hyper_parameters: HyperParameters
    terms: PosteriorTerms
    report: FitReport | None

    @property
    def hyper_parameters_original(self) -> HyperParameters:
        """In units of the raw inputs and targets; the linear term and the bias are about the mean input."""
        own = self.standardisation
        return self.hyper_parameters.scaled(own.input_scale, own.target_scale)


def condition(
    inputs: ArrayLike,
    targets: ArrayLike,
    hyper_parameters: HyperParameters,
    *,
    average_replicates: bool = True,
    standardisation: Standardisation | None = None,
) -> GaussianProcess:
    """GP with given hyper-parameters, in standardised units; inputs (N, D) and targets (N,) raw.

    `standardisation`: measured on these rows unless given. ValueError as in `fit`, and for a D that
    disagrees.
    """
    raw_inputs = checked_inputs(inputs, hyper_parameters.dimension)
    raw_targets = checked_targets(targets, len(raw_inputs))
    scaling = standardisation or Standardisation.of(raw_inputs, raw_targets)
    data = TrainingData.of(scaling.inputs(raw_inputs), scaling.targets(raw_targets), average_replicates)
    return GaussianProcess(scaling, data, hyper_parameters, posterior(data, hyper_parameters), None)


def fit(
    inputs: ArrayLike, targets: ArrayLike, settings: FitSettings, rng: np.random.Generator
) -> GaussianProcess:
    """Fit one GP to raw inputs (N, D) and raw targets (N,); its `report` says how that went.

    `rng` draws the random starts and nothing else. Raises ValueError for wrong shapes and for values that are
    not finite, naming row and column.
    """
    raw_inputs = checked_inputs(inputs)
    raw_targets = checked_targets(targets, len(raw_inputs))
    scaling = Standardisation.of(raw_inputs, raw_targets)
    data = TrainingData.of(
        scaling.inputs(raw_inputs), scaling.targets(raw_targets), settings.average_replicates
    )
    search = _Search(data, settings)
    hyper = search.run(rng)
    reached = log_marginal_likelihood(data, hyper)
    report = FitReport(
        outcome=search.outcome,
        log_marginal_likelihood=reached,
        initial_log_marginal_likelihood=search.initial,
        log_marginal_likelihood_original=reached - data.rows * float(np.log(scaling.target_scale)),
        hyper_parameters=hyper,
        hyper_parameters_original=hyper.scaled(scaling.input_scale, scaling.target_scale),
        evaluations=search.likelihood.evaluations,
        iterations=search.iterations,
        rows=data.rows,
        distinct_rows=data.counts.size,
        start_likelihoods=search.start_likelihoods,
        at_bounds=at_bounds(hyper, settings.bounds),
        data_warnings=_data_warnings(raw_inputs, raw_targets),
    )
    return GaussianProcess(scaling, data, hyper, posterior(data, hyper), report)


def fit_outputs(
    inputs: ArrayLike, targets: ArrayLike, settings: FitSettings, rng: np.random.Generator
) -> tuple[GaussianProcess, ...]:
    """One independent GP per column of the raw targets (N, R), each with its own child of `rng`."""
    columns = np.asarray(targets, dtype=np.float64)
    if columns.ndim != 2:
        raise ValueError(f"targets must have shape (N, R), one column per output, got {columns.shape}")
    check_finite("targets", columns)
    children = rng.spawn(columns.shape[1])
    return tuple(
        fit(inputs, column, settings, child) for column, child in zip(columns.T, children, strict=True)
    )


class _Search:
    """Ascents on one likelihood, and the book-keeping that the report needs."""

    def __init__(self, data: TrainingData, settings: FitSettings) -> None:
        self.likelihood = Likelihood(data)
        self.settings = settings
        self.box = settings.bounds.log_box(data.inputs.shape[1])
        self.initial = -np.inf
        self.outcome = FitOutcome.ITERATION_LIMIT
        self.iterations = 0
        self.start_likelihoods: tuple[float, ...] = ()

    def run(self, rng: np.random.Generator) -> HyperParameters:
        """Screen the starts, follow the best to the end."""
        start = self._inside(first_start(self.likelihood.data))
        self.initial = -self._negative(start)[0]
        if self.settings.restarts > 0:
            start = self._screened(start, rng)
        result = self._ascend(start, self.settings.max_iterations)
        self.start_likelihoods = self.start_likelihoods or (_likelihood_of(result),)
        self.outcome, self.iterations = _outcome_of(result), int(result.nit)
        return HyperParameters.from_log_vector(result.x)

    def _screened(self, first: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Where the best of the starts stands after the screening."""
        data, restarts = self.likelihood.data, self.settings.restarts
        ends = [self._screen(first), self._screen(self._likeliest(turning_starts(data)))]
        if HyperParameters.from_log_vector(_best(ends).x).noise_std > _MUCH_NOISE:
            others = [self._likeliest(noisy_starts(data)), self._inside(wiggly_start(data))]
            others += [self._inside(random_start(data, rng)) for _ in range(restarts - 3)]
            ends += [self._screen(start) for start in others[: restarts - 1]]
        self.start_likelihoods = tuple(map(_likelihood_of, ends))
        return np.asarray(_best(ends).x)

    def _likeliest(self, starts: list[HyperParameters]) -> FloatArray:
        """Before any ascent."""
        return min(map(self._inside, starts), key=lambda vector: self._negative(vector)[0])

    def _screen(self, start: FloatArray) -> OptimizeResult:
        return self._ascend(start, self.settings.screening_iterations)

    def _inside(self, start: HyperParameters) -> FloatArray:
        return np.clip(start.to_log_vector(), *self.box.T)

    def _negative(self, log_vector: FloatArray) -> tuple[float, FloatArray]:
        try:
            value, gradient = self.likelihood(log_vector)
        except NotPositiveDefiniteError:
            return _UNUSABLE, np.zeros_like(log_vector)
        return -value, -gradient

    def _ascend(self, start: FloatArray, iterations: int) -> OptimizeResult:
        from scipy.optimize import minimize  # here: half a second that who only predicts need not wait for

        reached: list[float] = []

        def stop_early(intermediate_result: OptimizeResult) -> None:
            reached.append(float(intermediate_result.fun))
            patience = self.settings.patience
            before = reached[-1 - patience] if len(reached) > patience else np.inf
            if before - reached[-1] < self.settings.minimum_improvement:
                raise StopIteration

        # ftol 0: our own rule above decides. maxfun is out of the way, iterations are what counts.
        options = {"maxiter": iterations, "maxfun": 50 * iterations, "ftol": 0.0, "gtol": 1e-6, "maxcor": 20}
        how = {"jac": True, "method": "L-BFGS-B", "bounds": self.box, "options": options}
        return minimize(self._negative, start, callback=stop_early, **how)


def _best(results: list[OptimizeResult]) -> OptimizeResult:
    return min(results, key=lambda result: float(result.fun))


def _likelihood_of(result: OptimizeResult) -> float:
    return -float(result.fun) if result.fun < _UNUSABLE else -np.inf


def _outcome_of(result: OptimizeResult) -> FitOutcome:
    """From scipy's status (99: the callback stopped it; 0, as ftol is 0: no gradient or no change)."""
    gradient = "GRADIENT" in str(result.message)
    settled = FitOutcome.GRADIENT_VANISHED if gradient else FitOutcome.LIKELIHOOD_SETTLED
    by_status = {0: settled, 1: FitOutcome.ITERATION_LIMIT, 99: FitOutcome.LIKELIHOOD_SETTLED}
    return by_status.get(int(result.status), FitOutcome.LINE_SEARCH_FAILED)


def _data_warnings(inputs: FloatArray, targets: FloatArray) -> tuple[str, ...]:
    found = [
        f"input column {column} is constant ({inputs[0, column]:g}): the data do not determine its influence, and "
        "predictions at other values are guesses"
        for column in np.flatnonzero(constant_columns(inputs))
    ]
    if constant_columns(targets[:, None])[0]:
        found.append(f"the targets are constant ({targets[0]:g}): there is nothing to learn")
    parameters = 2 * inputs.shape[1] + 3
    if len(targets) < parameters:
        found.append(f"{len(targets)} row(s) cannot determine {parameters} hyper-parameters: add data")
    return tuple(found)
