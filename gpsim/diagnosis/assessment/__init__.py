"""Assessment: what the answer is worth on held-out data, where the mismatch lies, what is left."""

from gpsim.diagnosis.assessment.by_recording import by_recording
from gpsim.diagnosis.assessment.combinations import combinations
from gpsim.diagnosis.assessment.comparison import Comparison, compare
from gpsim.diagnosis.assessment.estimates import Sizes, estimates
from gpsim.diagnosis.assessment.experiment_design import tell_apart
from gpsim.diagnosis.assessment.gated import acts_in
from gpsim.diagnosis.assessment.intervals import correlations, covariance, intervals
from gpsim.diagnosis.assessment.location import SINCE_REVERSAL, depends_on, locate, most_telling
from gpsim.diagnosis.assessment.model_error import model_error, with_model_error
from gpsim.diagnosis.assessment.replay import replayed
from gpsim.diagnosis.assessment.rollouts import Model
from gpsim.diagnosis.assessment.scoring import posed, score

__all__ = [
    "SINCE_REVERSAL",
    "Comparison",
    "Model",
    "Sizes",
    "acts_in",
    "by_recording",
    "combinations",
    "compare",
    "correlations",
    "covariance",
    "depends_on",
    "estimates",
    "intervals",
    "locate",
    "model_error",
    "most_telling",
    "posed",
    "replayed",
    "score",
    "tell_apart",
    "with_model_error",
]
