"""From the scores of all trials to figures with intervals, and the goals that they must reach."""

from gpsim.trials.statistics.goals import EQUIVALENT, GOALS, bounds_of
from gpsim.trials.statistics.intervals import interval, mean_interval, median_interval, rate, share_interval
from gpsim.trials.statistics.plan_figures import plan_figures
from gpsim.trials.statistics.summary import parameter_figures, summarise, worst_fit

__all__ = [
    "EQUIVALENT",
    "GOALS",
    "bounds_of",
    "interval",
    "mean_interval",
    "median_interval",
    "parameter_figures",
    "plan_figures",
    "rate",
    "share_interval",
    "summarise",
    "worst_fit",
]
