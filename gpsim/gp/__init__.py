"""Gaussian processes: what nobody can name. Exact fit, fast prediction, float64 (thesis section 4.2.3)."""

from .arrays import from_arrays, to_arrays
from .exact import JITTER, NotPositiveDefiniteError, PosteriorTerms, log_marginal_likelihood
from .fit_report import AtBound, FitOutcome, FitReport
from .fitting import FitSettings, GaussianProcess, condition, fit, fit_outputs
from .kernels import Bounds, HyperParameters, Interval
from .predictor import Predictor
from .training_data import Standardisation, TrainingData

__all__ = [
    "JITTER",
    "AtBound",
    "Bounds",
    "FitOutcome",
    "FitReport",
    "FitSettings",
    "GaussianProcess",
    "HyperParameters",
    "Interval",
    "NotPositiveDefiniteError",
    "PosteriorTerms",
    "Predictor",
    "Standardisation",
    "TrainingData",
    "condition",
    "fit",
    "fit_outputs",
    "from_arrays",
    "log_marginal_likelihood",
    "to_arrays",
]
