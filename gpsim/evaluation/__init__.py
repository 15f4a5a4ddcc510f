"""Evaluation: one step, rollout, return - the thesis's three layers - and which starts can be solved at all."""

from gpsim.evaluation.monitor import BETS, Monitor, MonitorSettings, Usual, one_step_errors, usual_errors
from gpsim.evaluation.one_step import OneStep, coverage_warnings, outside_range
from gpsim.evaluation.replay import WARM_UP, replay, windows_of
from gpsim.evaluation.returns import (
    episode_returns,
    mean_and_worst,
    robustness_lines,
    summarise_all,
    worst_tenth,
)
from gpsim.evaluation.rollout import compare, roll_out
from gpsim.evaluation.safe_drive import NEVER, ChangingPlant, Drives, Limits, drive
from gpsim.evaluation.statistics import nrmse
from gpsim.evaluation.summary import start_sets, summarise_seeds
from gpsim.evaluation.trips import AllTrips, Trips, behind, path_length, success_by_set, take_trips

__all__ = [
    "BETS",
    "NEVER",
    "WARM_UP",
    "AllTrips",
    "ChangingPlant",
    "Drives",
    "Limits",
    "Monitor",
    "MonitorSettings",
    "OneStep",
    "Trips",
    "Usual",
    "behind",
    "compare",
    "coverage_warnings",
    "drive",
    "episode_returns",
    "mean_and_worst",
    "nrmse",
    "one_step_errors",
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
    "usual_errors",
    "windows_of",
    "worst_tenth",
]
