"""Traces: what base and corrected simulator say beside what was measured, for pictures, Rerun and Foxglove."""

from gpsim.traces.alongside import Along, Alongside, alongside
from gpsim.traces.frequency import COHERENT, MEASURED, Response, frequency
from gpsim.traces.pictured import BASE, EFFECTS, Course, Trace, Traces, course, traces

__all__ = [
    "BASE", "COHERENT", "EFFECTS", "MEASURED", "Along", "Alongside", "Course", "Response", "Trace", "Traces",
    "alongside", "course", "frequency", "traces",
]  # fmt: skip
