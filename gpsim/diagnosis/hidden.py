"""States that nobody measured: the recording is completed by what a hypothesis says they were.

A window's start state is estimated together with the parameters, so a channel that was not observed needs no more than
a guess to begin with. Where values are needed at every sample (single steps, rollouts, the Gaussian process, bins),
they are those of the windows' simulation after their start states were fitted to the channels that were measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.predicting import traced
from gpsim.diagnosis.problem import Problem
from gpsim.diagnosis.shooting import fit
from gpsim.diagnosis.windows import cut
from gpsim.recordings import Episode, Recording
from gpsim.simulators import Simulator

SMOOTHING_ROUNDS = 12


def hidden_channels(recording: Recording, simulator: Simulator) -> tuple[str, ...]:
    """State channels that the simulator gives a guess for and the recording does not hold."""
    return tuple(n for n in simulator.state.names if n in simulator.start and n not in recording.state.names)


def guessed(recording: Recording, simulator: Simulator) -> Recording:
    """The recording with every hidden channel at the simulator's guess."""
    if not hidden_channels(recording, simulator):
        return recording
    names = recording.state.names
    episodes = []
    for episode in recording.episodes:
        columns = [
            episode.states[:, names.index(n)] if n in names else np.full(len(episode.t), simulator.start[n])
            for n in simulator.state.names
        ]
        episodes.append(replace(episode, states=np.stack(columns, axis=1)))
    recorded = {channel.name: channel for channel in recording.state}
    channels = Channels(tuple(recorded.get(channel.name, channel) for channel in simulator.state))
    return replace(recording, state=channels, episodes=tuple(episodes))


def smoothed(
    problem: Problem, recording: Recording, hypothesis: Hypothesis, hidden: Sequence[str]
) -> Recording:
    """The completed recording with its hidden channels as the hypothesis's own windows say."""
    if not hidden:
        return recording
    windows = cut(recording)
    part = problem.on(windows)
    said = traced(part, fit(part, hypothesis.frozen(), windows.measured[:, 0], iterations=SMOOTHING_ROUNDS))
    columns = [recording.state.index(name) for name in hidden]
    episodes = []
    for index, episode in enumerate(recording.episodes):
        rows = windows.episode == index
        valid = windows.valid[rows]
        episodes.append(
            _filled(episode, columns, windows.t[rows][valid], said[rows][valid]) if rows.any() else episode
        )
    return replace(recording, episodes=tuple(episodes))


def _filled(episode: Episode, columns: Sequence[int], t: FloatArray, said: FloatArray) -> Episode:
    """Between and beyond windows the hidden channel goes straight on from its neighbours."""
    states = np.array(episode.states)
    for column in columns:
        states[:, column] = np.interp(episode.t, t, said[:, column])
    return replace(episode, states=states)
