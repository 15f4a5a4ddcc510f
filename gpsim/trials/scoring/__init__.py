"""What a diagnosis claims, held against the answer: families and places, gates, parameters, held-out fit."""

from gpsim.trials.scoring.contradictions import contradictions
from gpsim.trials.scoring.curve_rules import score_plan_kinds
from gpsim.trials.scoring.rules import score
from gpsim.trials.scoring.trial_scores import score_trial

__all__ = ["contradictions", "score", "score_plan_kinds", "score_trial"]
