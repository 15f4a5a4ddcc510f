"""Residuals: where a recording meets a simulator, what happened minus what was predicted."""

from gpsim.residuals.checks import OWN_DT, check_clock, check_match, check_rates, read_table, table_recording
from gpsim.residuals.residuals import (
    Residuals,
    build_residuals,
    either_wraps,
    from_table,
    to_table,
)
from gpsim.residuals.split import SHARE, check_each_holds_out, first_held_out, held_out_names, holding_out
