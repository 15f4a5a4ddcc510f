"""Evaluation: one step, rollout, return - the thesis's three layers - and which starts can be solved at all."""

from gpsim.evaluation.monitor import BETS, Monitor, MonitorSettings, Usual, one_step_errors, usual_errors
from gpsim.evaluation.predictions import (
    WARM_UP,
    OneStep,
    compare,
    coverage_warnings,
    outside_range,
    replay,
    roll_out,
    windows_of,
)
from gpsim.evaluation.returns import (
    episode_returns,
    mean_and_worst,
    nrmse,
    robustness_lines,
    start_sets,
    summarise_all,
    summarise_seeds,
    worst_tenth,
)
from gpsim.evaluation.safe_drive import NEVER, ChangingPlant, Drives, Limits, drive
from gpsim.evaluation.trips import AllTrips, Trips, behind, path_length, solvable, success_by_set, take_trips
