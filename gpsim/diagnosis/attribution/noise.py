"""What sensors make of a perfect simulation: their noise, and how well rollouts know where they begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting import Fit, Hypothesis, traced
from gpsim.diagnosis.setup import Question, completed, spread_out

TYPICAL = 1.4826  # the median of |e| times this is the standard deviation of a normal error


def sensor_noise(question: Question, leader: Fit) -> FloatArray:
    """(S,) standard deviation of every recorded channel's noise, 0 of hidden ones.

    What the recording states, else what second differences of the leader's residual show: a smooth error of the
    model does not move them.
    """
    problem = question.everything
    names = problem.simulator.state.names
    stated = np.array([question.recording.noise.get(name, 0.0) for name in names])
    residual = problem.windows.measured - traced(problem, leader)
    second = np.diff(residual, n=2, axis=1)[problem.windows.valid[:, 2:]].T / np.sqrt(6.0)
    jumps = np.array(
        [_typical(column) or _rms(column) for column in second]
    )  # quantised: the median may be 0
    hidden = np.array([name in question.hidden for name in names])
    return np.asarray(np.where(hidden, 0.0, np.where(stated > 0, stated, jumps)))


def start_noise(
    question: Question,
    hypothesis: Hypothesis,
    noise: FloatArray,
    unseen: tuple[str, ...],
    rng: np.random.Generator,
) -> FloatArray:
    """(S,) standard deviation of the states with which rollouts begin.

    Of a measured channel its noise, of `unseen` ones what that does to the states that the hypothesis says they had.
    """
    if not unseen:
        return noise
    problem, settings = question.everything, question.everything.run.settings
    some = spread_out(problem.windows, settings.attribution.start_windows, settings.prepare.fewest)
    noisy = replace(some, measured=some.measured + rng.normal(size=some.measured.shape) * noise)
    clean, disturbed = (completed(problem.on(w), hypothesis, unseen).measured for w in (some, noisy))
    moved = (disturbed - clean)[some.valid].std(axis=0)
    lacks = np.array([name in unseen for name in problem.simulator.state.names])
    return np.where(lacks, moved, noise)


def _rms(errors: FloatArray) -> float:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else 0.0


def _typical(errors: FloatArray) -> float:
    return float(TYPICAL * np.median(np.abs(errors))) if errors.size else 0.0
