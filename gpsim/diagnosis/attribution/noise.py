"""The noise of the sensors, as far as a recording shows it."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.data import rms, typical
from gpsim.diagnosis.fitting import Fit, traced
from gpsim.diagnosis.setup import Question


def sensor_noise(question: Question, leader: Fit) -> FloatArray:
    """(S,) standard deviation of every recorded channel's noise, 0 of hidden ones.

    What the recording states, else what second differences of the leader's residual show: a smooth error of the
    model does not move them.
    """
    problem = question.everything
    names = problem.simulator.state.names
    stated = np.array([question.recording.noise.get(name, 0.0) for name in names])
    residual = problem.windows.measured - traced(problem, leader)
    second, windows = np.diff(residual, n=2, axis=1) / np.sqrt(6.0), problem.windows
    sound = np.broadcast_to(windows.valid[..., None], residual.shape)
    sound = sound if windows.weights is None else sound & (windows.weights > 0)
    sound = sound[:, 2:] & sound[:, 1:-1] & sound[:, :-2]
    columns = [second[..., i][sound[..., i]] for i in range(len(names))]
    # Of a quantised channel the median may be 0.
    jumps = np.array([typical(column) or rms(column) if column.size else 0.0 for column in columns])
    hidden = np.array([name in question.hidden for name in names])
    return np.asarray(np.where(hidden, 0.0, np.where(stated > 0, stated, jumps)))
