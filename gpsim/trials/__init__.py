"""Trials: concealed worlds with a known truth. Conceal, diagnose blind, reveal, score.

Nothing here imports `gpsim.effects`: the truth is written down a second time, so that a mistake in one law cannot
hide behind the same mistake in the other. `gpsim.diagnosis` can never import this package, which knows the answers.
"""
