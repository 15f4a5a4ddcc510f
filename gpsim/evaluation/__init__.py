"""Evaluation: one step, rollout, return - the thesis's three layers - and which starts can be solved at all."""

from gpsim.evaluation.one_step import OneStep, coverage_warnings, outside_range
from gpsim.evaluation.replay import WARM_UP, replay, windows_of
from gpsim.evaluation.returns import episode_returns, summarise_all
from gpsim.evaluation.robustness import mean_and_worst, robustness_lines, worst_tenth
from gpsim.evaluation.rollout import compare, roll_out
from gpsim.evaluation.statistics import nrmse
from gpsim.evaluation.summary import start_sets, summarise_seeds
from gpsim.evaluation.trips import AllTrips, Trips, behind, path_length, success_by_set, take_trips

__all__ = [
    "WARM_UP",
    "AllTrips",
    "OneStep",
    "Trips",
    "behind",
    "compare",
    "coverage_warnings",
    "episode_returns",
    "mean_and_worst",
    "nrmse",
    "outside_range",
    "path_length",
    "replay",
    "robustness_lines",
    "roll_out",
    "start_sets",
    "success_by_set",
    "summarise_all",
    "summarise_seeds",
    "take_trips",
    "turning",
    "windows_of",
    "worst_tenth",
]
