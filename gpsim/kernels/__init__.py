"""Kernels: the built-in simulators and laws in compiled form, many times faster than array by array.

NumPy is the reference (`gpsim.effects.Chain`): what a chain needs that is not here, it does.
"""

from gpsim.kernels.marching import (
    Commands,
    Past,
    actuators_of,
    at_rest,
    can_compile,
    is_compiled,
    marched,
    read_late,
    travelled,
)
from gpsim.kernels.program import Program, program_of
from gpsim.kernels.tables import Hat
