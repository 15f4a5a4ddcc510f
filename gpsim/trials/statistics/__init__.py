"""From the scores of all trials to figures with intervals, and the goals that they must reach."""

from gpsim.trials.statistics.goals import EQUIVALENT, GOALS, bounds_of
from gpsim.trials.statistics.groups import plan_figures
from gpsim.trials.statistics.intervals import rate
from gpsim.trials.statistics.summary import summarise

__all__ = ["EQUIVALENT", "GOALS", "bounds_of", "plan_figures", "rate", "summarise"]
