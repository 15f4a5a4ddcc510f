"""Data: a recording cut into windows, some held out."""

from gpsim.diagnosis.data.clock import rebased
from gpsim.diagnosis.data.decimation import thinned
from gpsim.diagnosis.data.reversals import since_reversal
from gpsim.diagnosis.data.split import first_held_out, held_out_names
from gpsim.diagnosis.data.windows import (
    Windows,
    at,
    cut,
    cut_in_parts,
    held_out_mask,
    shortest,
    stretches,
)

__all__ = [
    "Windows",
    "at",
    "cut",
    "cut_in_parts",
    "first_held_out",
    "held_out_mask",
    "held_out_names",
    "rebased",
    "shortest",
    "since_reversal",
    "stretches",
    "thinned",
]
