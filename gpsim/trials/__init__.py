"""Trials: concealed worlds with a known truth. Conceal, diagnose blind, reveal, score.

Nothing that makes the truth (`running`, `drawing`, and what they import) imports `gpsim.effects`, `gpsim.simulators` or
`gpsim.diagnosis`: the laws are written down a second time, so that a mistake in one cannot hide behind the same mistake
in the other. Only the rule for equivalents fits with the diagnosis's engine, after the reveal. `gpsim.diagnosis` can
never import this package, which knows the answers.
"""

__all__ = ["blind", "concealing", "drawing", "goals", "summary", "trial_scores", "worlds"]
