"""Run: what one diagnosis carries along from step to step: settings, workers, budget, memory, trace."""

from gpsim.diagnosis.run.memo import Memo, kept
from gpsim.diagnosis.run.pool import Workers, cores
from gpsim.diagnosis.run.run import Run
from gpsim.diagnosis.run.trace import Decision

__all__ = ["Decision", "Memo", "Run", "Workers", "cores", "kept"]
