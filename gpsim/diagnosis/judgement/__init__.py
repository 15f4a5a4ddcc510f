"""Judgement: the verdict on what was selected, and its rivals."""

from gpsim.diagnosis.judgement.odds import odds_against
from gpsim.diagnosis.judgement.verdict import Judgement, judge

__all__ = [
    "Judgement",
    "judge",
    "odds_against",
]
