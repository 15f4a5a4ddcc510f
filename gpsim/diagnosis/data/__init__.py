"""Data: a recording cut into windows, some held out."""

from gpsim.diagnosis.data.clock import rebased
from gpsim.diagnosis.data.decimation import thinned
from gpsim.diagnosis.data.outliers import outliers
from gpsim.diagnosis.data.quantisation import quantum
from gpsim.diagnosis.data.repeats import held_with, repeats, whole_packets
from gpsim.diagnosis.data.reversals import since_reversal
from gpsim.diagnosis.data.spread import TYPICAL, rms, typical
from gpsim.diagnosis.data.windows import (
    FEWEST_TRANSITIONS_OF_A_WINDOW,
    Windows,
    at,
    cut,
    cut_in_parts,
    held_out_mask,
    shortest,
    stretches,
)

__all__ = [
    "FEWEST_TRANSITIONS_OF_A_WINDOW",
    "TYPICAL",
    "Windows",
    "at",
    "cut",
    "cut_in_parts",
    "held_out_mask",
    "held_with",
    "outliers",
    "quantum",
    "rebased",
    "repeats",
    "rms",
    "shortest",
    "since_reversal",
    "stretches",
    "thinned",
    "typical",
    "whole_packets",
]
