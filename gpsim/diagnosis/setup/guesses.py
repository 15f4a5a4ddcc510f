"""A guess for a state that nobody measured, from what was: a fit of start states needs no more to begin with."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.recordings import Episode, Recording
from gpsim.simulators import Simulator

TURN = 24  # headings of a whole turn that are tried
AHEAD = 5  # steps over which they are judged: one alone may be all noise


def guess(name: str, episode: Episode, recording: Recording, simulator: Simulator) -> FloatArray:
    """(K + 1,): a channel as recorded, or what goes with the others.

    The simulator's own guess where it has one; a velocity from its position, a position from its velocity; an angle
    that wraps, as a heading, the one with which the next steps fit best; else 0.
    """
    names = recording.state.names
    if name in names:
        return episode.states[:, names.index(name)]
    if name in simulator.start:
        return np.full(len(episode.t), simulator.start[name])
    for coordinate in simulator.coordinates:
        if name == coordinate.velocity and coordinate.name in names and len(episode) > 0:
            position = episode.states[:, names.index(coordinate.name)]
            angle = simulator.state.units[coordinate.name] == "rad"
            return np.gradient(np.unwrap(position) if angle else position, episode.t)
        if name == coordinate.name and coordinate.velocity in names:
            speed = episode.states[:, names.index(coordinate.velocity)]
            steps = np.diff(episode.t) * 0.5 * (speed[1:] + speed[:-1])
            return np.concatenate([[0.0], np.cumsum(steps)])
    if simulator.state.wraps[simulator.state.index(name)] and len(episode) > 0:
        return _heading(name, episode, recording, simulator)
    return np.zeros(len(episode.t))


def _heading(name: str, episode: Episode, recording: Recording, simulator: Simulator) -> FloatArray:
    """(K + 1,): of a turn's angles the one from which the simulator best reaches the next samples."""
    measured = [n for n in simulator.state.names if n in recording.state.names]
    into = [simulator.state.index(n) for n in measured]
    states = np.zeros((len(episode.t), len(simulator.state)))
    states[:, into] = episode.states[:, [recording.state.index(n) for n in measured]]
    parameters, column = simulator.defaults(recording.parameters), simulator.state.index(name)
    steps, scale = np.diff(episode.t), np.maximum(np.std(states[:, into], axis=0), np.finfo(float).tiny)
    angles = np.linspace(-np.pi, np.pi, TURN, endpoint=False)
    costs = np.zeros((TURN, len(steps)))
    for i, angle in enumerate(angles):
        at = states[:-1].copy()
        at[:, column] = angle
        for ahead in range(AHEAD):
            count = len(steps) - ahead
            if count <= 0:
                break
            at = simulator.step(
                at[:count], episode.actions[ahead:], parameters, steps[ahead:], simulator.integrator
            )
            missed = difference(at, states[ahead + 1 :], simulator.state)[:, into] / scale
            costs[i, :count] += (missed**2).sum(axis=1)
    best = angles[np.argmin(costs, axis=0)]
    return np.concatenate([best, best[-1:]])
