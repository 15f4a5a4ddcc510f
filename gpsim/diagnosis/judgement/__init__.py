"""Judgement: the leader, its rivals, what is left over, the verdict and the odds."""

from gpsim.diagnosis.judgement.curved import Curved, curved
from gpsim.diagnosis.judgement.doubts import claimed, doubts_of, without_claims
from gpsim.diagnosis.judgement.judgement import Judgement, judge, withheld
from gpsim.diagnosis.judgement.laws import Laws, laws_of
from gpsim.diagnosis.judgement.odds import odds_against
from gpsim.diagnosis.judgement.rivals import likeliest
from gpsim.diagnosis.judgement.verdict import as_far_as_asked, beats_the_base, verdict_of

__all__ = [
    "Curved",
    "Judgement",
    "Laws",
    "as_far_as_asked",
    "beats_the_base",
    "claimed",
    "curved",
    "doubts_of",
    "judge",
    "laws_of",
    "likeliest",
    "odds_against",
    "verdict_of",
    "withheld",
    "without_claims",
]
