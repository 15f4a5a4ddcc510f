"""States that nobody measured: the recording is completed by what a hypothesis says they were.

A window's start state is estimated together with the parameters, so a channel that was not observed needs no more than
a guess to begin with. Where values are needed at every sample (single steps, rollouts, the Gaussian process, bins),
they are those of the windows' simulation after their start states were fitted to the channels that were measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.data import Windows, cut_in_parts
from gpsim.diagnosis.fitting import Hypothesis, Problem, fit, predicted
from gpsim.effects import closed
from gpsim.recordings import Episode, Recording

COMPLETION_ITERATIONS = 8  # of the fit of start states that a recording is completed with
COMPLETED_GAIN = 0.05
"""That a round must gain where only start states are fitted, to complete a recording [nats a window]."""


def smoothed(
    problem: Problem, recording: Recording, hypothesis: Hypothesis, hidden: Sequence[str]
) -> Recording:
    """The completed recording with its hidden channels as the hypothesis's own windows say."""
    if not hidden:
        return recording
    columns = [recording.state.index(name) for name in hidden]
    known: dict[
        int, list[tuple[FloatArray, FloatArray]]
    ] = {}  # of each episode: moments, and what is said of them
    for part in cut_in_parts(recording, problem.run.settings.windows):
        windows = completed(problem.on(part), hypothesis, hidden)
        for index in np.unique(windows.episode):
            rows = windows.episode == index
            valid = windows.valid[rows]
            said = windows.measured[rows][valid][:, columns]
            known.setdefault(int(index), []).append((windows.t[rows][valid], said))
    episodes = [
        _filled(episode, columns, *map(np.concatenate, zip(*known[index], strict=True)))
        if index in known
        else episode
        for index, episode in enumerate(recording.episodes)
    ]
    return replace(recording, episodes=tuple(episodes))


def completed(problem: Problem, hypothesis: Hypothesis, hidden: Sequence[str]) -> Windows:
    """The problem's windows with their hidden channels as the hypothesis says, its start states fitted."""
    windows = problem.windows
    if not hidden:
        return windows
    tolerance = COMPLETED_GAIN * len(windows)
    found = fit(problem, hypothesis.frozen(), rounds=COMPLETION_ITERATIONS, tolerance=tolerance)
    columns = [problem.simulator.state.index(name) for name in hidden]
    measured = np.array(windows.measured)
    said = predicted(problem, windows, found.hypothesis, starts=found.starts)
    measured[..., columns] = said[..., columns]
    return replace(windows, measured=measured)


class Completions:
    """A recording as each hypothesis completes it: worked out once for each, whoever asks.

    account: the leading one, which completes it for all where every step is dear.
    """

    def __init__(
        self, problem: Problem, recording: Recording, hidden: Sequence[str], account: Hypothesis
    ) -> None:
        self._asked = problem, recording, hidden
        self._for_all = account if closed(problem.simulator) is not None else None
        self._known: list[tuple[Hypothesis, Recording]] = []

    def by(self, hypothesis: Hypothesis) -> Recording:
        """The recording with its hidden channels as the hypothesis's own windows say."""
        hypothesis = self._for_all or hypothesis
        for known, recording in self._known:
            if known == hypothesis:
                return recording
        problem, recording, hidden = self._asked
        self._known.append((hypothesis, smoothed(problem, recording, hypothesis, hidden)))
        return self._known[-1][1]


def _filled(episode: Episode, columns: Sequence[int], t: FloatArray, said: FloatArray) -> Episode:
    """Between and beyond windows the hidden channel goes straight on from its neighbours."""
    states = np.array(episode.states)
    for i, column in enumerate(columns):
        states[:, column] = np.interp(episode.t, t, said[:, i])
    return replace(episode, states=states)
