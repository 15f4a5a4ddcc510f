"""Judging: how much an account explains, what each effect is worth, its rivals, and what may be said of it."""

from gpsim.diagnosis.judging.attribution import SEED, Attribution, attribute, explained_by
from gpsim.diagnosis.judging.judgement import Judgement, Tried, odds_against, probabilities_of, rivals_among
from gpsim.diagnosis.judging.judges import (
    RolloutJudge,
    draws,
    horizon_of,
    interval_of,
    judge_at,
    rollouts_in,
    share_of,
)
from gpsim.diagnosis.judging.verdict import claimed, doubts_of, forms_of, verdict_of
