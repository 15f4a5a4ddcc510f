"""Traces: what base and corrected simulator say beside what was measured, for pictures, Rerun and Foxglove."""

from gpsim.traces.alongside import Along, Alongside, alongside
from gpsim.traces.frequency import COHERENT, MEASURED, Response, frequency
from gpsim.traces.pictured import BASE, EFFECTS, Course, Trace, Traces, course, traces
