"""Attribution: how much of the mismatch is explained, by which effects, and which of them are claims."""

from gpsim.diagnosis.attribution.attribution import SEED, Attribution, attribute, explained_by
from gpsim.diagnosis.attribution.forces_or_fit import forces_lead, with_values_of_forces
from gpsim.diagnosis.attribution.judges import Judge, RolloutJudge, judge_at
from gpsim.diagnosis.attribution.less import fits_without
from gpsim.diagnosis.attribution.rollout_windows import rollouts_in
from gpsim.diagnosis.attribution.shares import draws
from gpsim.diagnosis.attribution.support import supported

__all__ = [
    "SEED",
    "Attribution",
    "Judge",
    "RolloutJudge",
    "attribute",
    "draws",
    "explained_by",
    "fits_without",
    "forces_lead",
    "judge_at",
    "rollouts_in",
    "supported",
    "with_values_of_forces",
]
