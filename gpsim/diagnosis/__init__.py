"""Diagnosis: where simulator and recording differ, which physics was left out, and how sure that is."""

from gpsim.diagnosis.assessment import score
from gpsim.diagnosis.diagnosis import Outcome, diagnose
from gpsim.diagnosis.left_open import Explanation, LeftOpen, Visited
from gpsim.diagnosis.left_open_file import OLDER, from_two_files, left_open_data, left_open_from
from gpsim.diagnosis.report import SCHEMA, Diagnosis, schema

__all__ = [
    "OLDER",
    "SCHEMA",
    "Diagnosis",
    "Explanation",
    "LeftOpen",
    "Outcome",
    "Visited",
    "diagnose",
    "from_two_files",
    "left_open_data",
    "left_open_from",
    "schema",
    "score",
]
