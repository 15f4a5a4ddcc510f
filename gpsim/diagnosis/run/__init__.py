"""Run: what one diagnosis carries along from step to step: workers, budget, memory."""

from gpsim.diagnosis.run.budget import Budget
from gpsim.diagnosis.run.memo import Memo, kept
from gpsim.diagnosis.run.pool import Workers, cores
from gpsim.diagnosis.run.run import Run

__all__ = ["Budget", "Memo", "Run", "Workers", "cores", "kept"]
