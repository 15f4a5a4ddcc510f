"""A guess for a state that nobody measured, from what was: a fit of start states needs no more to begin with."""

from __future__ import annotations

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.effects import closed
from gpsim.recordings import Episode, Recording
from gpsim.simulators import Simulator

TURN = 24  # headings of a whole turn that are tried
AHEAD = 5  # steps over which they are judged: one alone may be all noise
REACHES = (1, 2, 3, 5, 8, 12)  # samples to either side, over which the slope of a noisy position may be taken


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
            path = np.unwrap(position) if angle else position
            if closed(simulator) is None:
                return np.gradient(path, episode.t)
            return speed_of(path, episode.t, recording.noise.get(coordinate.name))
        if name == coordinate.name and coordinate.velocity in names:
            speed = episode.states[:, names.index(coordinate.velocity)]
            steps = np.diff(episode.t) * 0.5 * (speed[1:] + speed[:-1])
            return np.concatenate([[0.0], np.cumsum(steps)])
    if simulator.state.wraps[simulator.state.index(name)] and len(episode) > 0:
        return _heading(name, episode, recording, simulator)
    return np.zeros(len(episode.t))


def speed_of(path: FloatArray, t: FloatArray, noise: float | None = None) -> FloatArray:
    """(K,) velocity along a position (K,): the slope of a line through neighbours, as many as err least.

    Few of them pass noise on, many round bends off. What the bends make of it shows beside the fewest, less what noise
    explains of that. noise: standard deviation of the position; None: as its third differences say.
    """
    if len(path) <= 2 * REACHES[-1]:
        return np.gradient(path, t)
    if noise is None:
        noise = float(np.median(np.abs(np.diff(path, 3)))) / (0.6745 * np.sqrt(20.0))
    step = float(np.median(np.diff(t)))
    best, least, first = np.gradient(path, t), np.inf, None
    for reach in REACHES:
        slope, passed_on = (
            _slopes(path, t, reach),
            (noise / step) ** 2 * 3.0 / (reach * (reach + 1) * (2 * reach + 1)),
        )
        own = passed_on if first is None else max(first[1] - passed_on, 0.0)
        bent = 0.0 if first is None else max(float(np.mean((slope - first[0]) ** 2)) - own, 0.0)
        first = first or (slope, passed_on)
        if passed_on + bent < least:
            best, least = slope, passed_on + bent
    return best


def _slopes(path: FloatArray, t: FloatArray, reach: int) -> FloatArray:
    """(K,) the slope of a line through so many samples to either side, fewer near the ends."""
    out, count = np.gradient(path, t), len(path)
    for near in range(1, reach + 1):  # the widest that fits is written last
        width = 2 * near + 1
        rows = np.arange(count - width + 1)[:, None] + np.arange(width)
        at, along = t[rows], path[rows]
        at = at - at.mean(axis=1, keepdims=True)
        out[near : count - near] = (at * along).sum(axis=1) / (at**2).sum(axis=1)
    return np.asarray(out)


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
