"""From a recording to the question: windows to learn from and to judge on, what was observed, and how well."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import Fit, fit
from gpsim.diagnosis.windows import LENGTH, Windows, cut
from gpsim.errors import UsageError
from gpsim.recordings import Recording
from gpsim.residuals import check_match, check_varies
from gpsim.simulators import Simulator
from gpsim.simulators.simulator import INTEGRATORS

SEARCHED, FITTED = 72, 480  # windows that the search looks at, and that the final fits use, at most
LONGEST_SUBSTEP = 0.0125  # s
FEWEST_WINDOWS = 4


@dataclass(frozen=True)
class Question:
    """The problem on all training windows, on those that the search uses, and on the held-out ones."""

    recording: Recording
    everything: Problem
    searched: Problem
    held_out: Problem
    base_scheme: str


def prepare(recording: Recording, simulator: Simulator, parameters: Mapping[str, float]) -> Question:
    """Cut, split and measure; raises UsageError when recording and simulator do not match or it is too short."""
    check_match(recording, simulator)
    check_varies(recording)
    if recording.integrator not in INTEGRATORS:
        raise UsageError(
            f"recording: integrator '{recording.integrator}' is not one of {', '.join(INTEGRATORS)}"
        )
    windows = cut(recording, _length(recording))
    held = held_out_mask(recording, windows)
    training = windows.take(~held)
    if len(training) < FEWEST_WINDOWS:
        raise UsageError(
            f"too short to judge: {recording.transition_count} transitions make {len(training)} windows of "
            f"{LENGTH} to learn from, {FEWEST_WINDOWS} are needed; record more, or hold out less"
        )
    observed = np.array([_observed(recording, simulator, name) for name in simulator.state.names])
    scale = np.maximum(windows.measured[windows.valid].std(axis=0), 1e-9)
    known = np.array([recording.noise.get(name, 0.0) for name in simulator.state.names])
    floor = np.sqrt(known**2 + (1e-8 * scale) ** 2)
    substeps = int(np.clip(np.ceil(recording.dt / LONGEST_SUBSTEP), 2, 6))
    problem = Problem(simulator, parameters, recording.dt, training, observed, floor, scale, substeps)
    problem = replace(problem, floor=np.hypot(floor, numerical_error(problem.on(spread_out(training, 40)))))
    return Question(
        recording,
        problem.on(spread_out(training, FITTED)),
        problem.on(spread_out(training, SEARCHED)),
        problem.on(spread_out(windows.take(held), FITTED)),
        recording.integrator,
    )


def numerical_error(problem: Problem, at: Fit | None = None) -> FloatArray:
    """(S,) root mean square change of the simulated windows when the substep is halved."""
    null = at or fit(problem, Hypothesis(), problem.windows.measured[:, 0], iterations=4)
    finer = replace(problem, substeps=2 * problem.substeps)
    theta = null.hypothesis.theta[None]
    change = finer.residuals(null.hypothesis, theta, null.starts[None])[0] - null.residuals
    return np.asarray(np.sqrt(np.mean(change[problem.windows.valid] ** 2, axis=0)))


def spread_out(windows: Windows, most: int) -> Windows:
    """At most `most` windows, evenly spread; those that do not begin an episode first, where there are enough."""
    later = np.flatnonzero(~windows.fresh)
    rows = (
        later if len(later) >= max(FEWEST_WINDOWS, 2 * int(windows.fresh.sum())) else np.arange(len(windows))
    )
    if len(rows) > most:
        rows = rows[np.linspace(0, len(rows) - 1, most).round().astype(np.int64)]
    return windows.take(rows)


def held_out_mask(recording: Recording, windows: Windows) -> BoolArray:
    """(W,) which windows are kept for judging: as the recording says, else the last fifth of episodes or of time."""
    rule = recording.held_out
    if rule is not None and rule.time_from is not None:
        return np.asarray(windows.t[:, 0] >= rule.time_from)
    if rule is not None and rule.episodes_from is not None:
        return np.asarray(windows.episode >= rule.episodes_from)
    count = len(recording.episodes)
    if count >= 5:
        return np.asarray(windows.episode >= count - max(1, count // 5))
    order = np.arange(len(windows))
    return np.asarray(order >= 0.8 * len(windows))


def _length(recording: Recording) -> int:
    longest = max(len(episode) for episode in recording.episodes)
    return min(LENGTH, max(longest, 3))


def _observed(recording: Recording, simulator: Simulator, name: str) -> bool:
    """Differentiated velocities carry the smoothing's errors and no news: positions are observed only."""
    velocities = {coordinate.velocity for coordinate in simulator.coordinates}
    return not (recording.velocities == "differentiated" and name in velocities)
