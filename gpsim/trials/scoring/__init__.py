"""What a diagnosis claims, held against the answer: families and places, gates, parameters, held-out fit."""

from gpsim.trials.scoring.gates import iou
from gpsim.trials.scoring.group_rules import rough_verdicts
from gpsim.trials.scoring.plan_rules import score_plan_kinds
from gpsim.trials.scoring.rules import held_out_fit, score
from gpsim.trials.scoring.trial_scores import score_trial

__all__ = ["held_out_fit", "iou", "rough_verdicts", "score", "score_plan_kinds", "score_trial"]
