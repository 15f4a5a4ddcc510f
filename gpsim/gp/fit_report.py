"""What a fit says about itself: outcome with advice, likelihoods, hyper-parameters at their bounds."""

from __future__ import annotations

import enum
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from .kernels import Bounds, HyperParameters


class FitOutcome(enum.Enum):
    """Why the optimiser stopped; the value is one sentence with advice."""

    LIKELIHOOD_SETTLED = "The likelihood stopped improving: the fit converged."
    GRADIENT_VANISHED = "The likelihood's gradient vanished: the fit converged."
    ITERATION_LIMIT = (
        "The fit still improved at its last iteration: raise max_iterations, or raise minimum_improvement "
        "if the rest does not matter."
    )
    LINE_SEARCH_FAILED = (
        "The line search found no better point: look for hyper-parameters at their bounds, and raise "
        "gp.noise_floor if K is ill-conditioned."
    )

    @property
    def converged(self) -> bool:
        """True where the optimiser stopped because nothing was left to gain."""
        return self in (FitOutcome.LIKELIHOOD_SETTLED, FitOutcome.GRADIENT_VANISHED)

    @property
    def advice(self) -> str:
        """The sentence to print."""
        return self.value


@dataclass(frozen=True)
class AtBound:
    """One hyper-parameter that ended at its bound. `harmless`: the fit only switched a term off."""

    name: str
    side: str
    value: float
    advice: str
    harmless: bool

    def __str__(self) -> str:
        return f"{self.name} is at its {self.side} bound {self.value:g} (standardised units): {self.advice}"


_ADVICE: dict[tuple[str, str], str] = {
    ("signal_std", "lower"): "the RBF term is switched off; linear term and noise explain the targets.",
    ("signal_std", "upper"): "the RBF term acts as a polynomial; predictions between the data are uncertain.",
    ("lengthscales", "lower"): "the GP memorises rows instead of learning along this input; add data.",
    ("lengthscales", "upper"): "the RBF term ignores this input.",
    ("linear_stds", "lower"): "the linear term ignores this input.",
    ("linear_stds", "upper"): "the prior hardly limits the slope along this input.",
    ("bias_std", "lower"): "the bias is switched off (the targets are centred already).",
    ("bias_std", "upper"): "the prior hardly limits the offset.",
    ("noise_std", "lower"): "the data look free of noise; this noise floor is no estimate.",
    ("noise_std", "upper"): "all of the targets count as noise: the inputs explain nothing.",
}
_HARMLESS = {
    ("signal_std", "lower"),
    ("lengthscales", "upper"),
    ("linear_stds", "lower"),
    ("bias_std", "lower"),
}


def at_bounds(hyper: HyperParameters, bounds: Bounds) -> tuple[AtBound, ...]:
    """Every hyper-parameter (standardised units) at one of its bounds, in `HyperParameters.names` order."""
    box = bounds.log_box(hyper.dimension)
    found = []
    for name, value, (low, high) in zip(hyper.names(), hyper.to_log_vector(), box, strict=True):
        # The optimiser lands on a bound exactly; the margin is for the logarithm's rounding only.
        side = "lower" if value <= low + 1e-9 else "upper" if value >= high - 1e-9 else None
        if side is not None:
            key = name.split("[")[0], side
            found.append(AtBound(name, side, float(np.exp(value)), _ADVICE[key], key in _HARMLESS))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class FitReport:
    """Result of one fit; likelihoods are natural logarithms over all rows, replicates included.

    `log_marginal_likelihood` and `initial_log_marginal_likelihood` (at the first, data-driven start) are of
    the standardised targets; `log_marginal_likelihood_original` is of the raw targets, the one to compare
    with other models. `hyper_parameters` are standardised, `hyper_parameters_original` in the units of the
    raw data (bias_std: about the mean input). `start_likelihoods`: reached from each start after screening
    (-inf: never evaluated successfully). `evaluations` counts likelihood evaluations over all starts,
    `iterations` the final ascent's.
    """

    outcome: FitOutcome
    log_marginal_likelihood: float
    initial_log_marginal_likelihood: float
    log_marginal_likelihood_original: float
    hyper_parameters: HyperParameters
    hyper_parameters_original: HyperParameters
    evaluations: int
    iterations: int
    rows: int
    distinct_rows: int
    start_likelihoods: tuple[float, ...]
    at_bounds: tuple[AtBound, ...]
    data_warnings: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether the optimiser stopped because nothing was left to gain."""
        return self.outcome.converged

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences for a reader: about the data, the outcome and the bounds that matter."""
        outcome = () if self.converged else (self.outcome.advice,)
        return (*self.data_warnings, *outcome, *(str(item) for item in self.at_bounds if not item.harmless))

    def to_dict(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "outcome": self.outcome.name.lower(),
            "advice": self.outcome.advice,
            "converged": self.converged,
            **{
                f.name: getattr(self, f.name) for f in fields(self)[1:-1]
            },  # without outcome and data_warnings
            "hyper_parameters": self.hyper_parameters.to_dict(),
            "hyper_parameters_original": self.hyper_parameters_original.to_dict(),
            "start_likelihoods": [value if np.isfinite(value) else None for value in self.start_likelihoods],
            "at_bounds": [str(item) for item in self.at_bounds],
            "warnings": list(self.warnings),
        }
