"""Gaussian processes: what nobody can name. Exact fit, fast prediction, float64 (thesis section 4.2.3)."""

from typing import TYPE_CHECKING

from gpsim.doors import opened

if TYPE_CHECKING:
    from gpsim.gp.arrays import from_arrays, to_arrays
    from gpsim.gp.chained import ChainedPredictor, ChainSettings, fit_chain
    from gpsim.gp.exact import JITTER, NotPositiveDefiniteError, log_marginal_likelihood
    from gpsim.gp.fit_report import FitOutcome, FitReport
    from gpsim.gp.fitting import FitSettings, GaussianProcess, condition, first_start, fit, fit_outputs
    from gpsim.gp.functions import DrawnFunctions
    from gpsim.gp.kernels import Bounds, HyperParameters, Interval, covariance
    from gpsim.gp.predictor import Predictor
    from gpsim.gp.training_data import MOST_ROWS, Standardisation, TooManyRowsError, TrainingData
else:
    __getattr__ = opened(__name__)

__all__ = [
    "JITTER", "MOST_ROWS", "Bounds", "ChainSettings", "ChainedPredictor", "DrawnFunctions", "FitOutcome",
    "FitReport", "FitSettings", "GaussianProcess", "HyperParameters", "Interval", "NotPositiveDefiniteError",
    "Predictor", "Standardisation", "TooManyRowsError", "TrainingData", "condition", "covariance", "first_start",
    "fit", "fit_chain", "fit_outputs", "from_arrays", "log_marginal_likelihood", "to_arrays",
]  # fmt: skip
