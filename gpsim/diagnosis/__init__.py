"""Diagnosis: where simulator and recording differ, which physics was left out, and how sure that is."""

from gpsim.diagnosis.assessment import score
from gpsim.diagnosis.diagnosis import Outcome, diagnose
from gpsim.findings import SCHEMA, Diagnosis, schema
