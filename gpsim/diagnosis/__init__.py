"""Diagnosis: where simulator and recording differ, which physics was left out, and how sure that is."""

from gpsim.diagnosis.diagnosis import Diagnosis, diagnose

__all__ = [
    "Diagnosis",
    "diagnose",
]
