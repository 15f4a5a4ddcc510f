"""Diagnosis: where simulator and recording differ, which physics was left out, and how sure that is."""
