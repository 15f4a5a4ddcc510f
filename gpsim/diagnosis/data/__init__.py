"""Data: a recording's clock, what its single samples are, and the windows that it is cut into, some held out."""

from gpsim.diagnosis.data.clock import rebased, thinned
from gpsim.diagnosis.data.samples import (
    THIRD_DIFFERENCE,
    TYPICAL,
    held_with,
    integral,
    outliers,
    quantum,
    repeats,
    rms,
    typical,
    whole_packets,
)
from gpsim.diagnosis.data.windows import (
    FEWEST_TRANSITIONS_OF_A_WINDOW,
    Windows,
    at,
    cut,
    cut_in_parts,
    held_out_mask,
    shortest,
    since_reversal,
    stretches,
)
