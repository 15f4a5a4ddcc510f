"""Kernels: the built-in simulators and laws in compiled form, one state at a time, many times faster than in batches.

NumPy is the reference (`gpsim.effects.Chain`): what a chain needs that is not here, it does.
"""

from gpsim.kernels.marching import Commands, Past, can_compile, marched
from gpsim.kernels.program import Program, program_of
from gpsim.kernels.tables import Curve, Hat

__all__ = ["Commands", "Curve", "Hat", "Past", "Program", "can_compile", "marched", "program_of"]
