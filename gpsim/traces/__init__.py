"""Traces: what base and corrected simulator say beside what was measured, for pictures, Rerun and Foxglove."""

from gpsim.traces.alongside import Along, Alongside, alongside
from gpsim.traces.pictured import BASE, EFFECTS, Course, Trace, Traces, course, traces

__all__ = [
    "BASE", "EFFECTS", "Along", "Alongside", "Course", "Trace", "Traces", "alongside", "course", "traces",
]  # fmt: skip
