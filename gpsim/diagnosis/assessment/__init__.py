"""Assessment: what the answer is worth on held-out data, where the mismatch lies, what is left."""

from gpsim.diagnosis.assessment.combinations import identifiable_combinations
from gpsim.diagnosis.assessment.comparison import Comparison, compare
from gpsim.diagnosis.assessment.estimates import averaged, covariance, estimates, intervals
from gpsim.diagnosis.assessment.experiment_design import design_experiment
from gpsim.diagnosis.assessment.location import SINCE_REVERSAL, depends_on, locate, most_telling
from gpsim.diagnosis.assessment.rollouts import Model
from gpsim.diagnosis.assessment.scoring import by_recording, posed, replayed, score
