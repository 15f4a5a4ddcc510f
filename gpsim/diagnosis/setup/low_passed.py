"""A recording below a frequency: what moved and what was commanded, and what the forces on its joints were.

Forces are compared after the same filter as the motion, so that what it does to one side it does to the other: the
parallel filter of robots' identification (Gautier, Janot and Vandanjon 2013, IEEE Transactions on Control Systems
Technology 21(2)).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.effects import closed
from gpsim.recordings import Episode, Recording
from gpsim.simulators import Simulator

ORDER = 4  # of the filter (Butterworth), applied forwards and backwards
GAP = 5.0  # samples that are missing, behind which a recording begins anew
USUAL, SLOW = 0.95, 0.1  # quantile of speeds that is the usual one; of it, below which a joint may stick
MOSTLY = 0.8  # of the rows about one, in which a joint moves: where it sticks, nobody knows how much friction holds it
LONGEST = 20_000  # rows in all, of which the beginnings of longer stretches are taken, for a second or two
SHORTEST, FEWEST = 60, 20  # samples and rows of a stretch, so that what the filter does at its ends is little


@dataclass(frozen=True)
class LowPassed:
    """What moved below a share of the Nyquist frequency, as densely as that needs, stretch after stretch.

    states (N, S); acceleration (N, C); ends: rows at which stretches end; free (N, C): coordinates that neither a limit
    nor a contact pushes; every: samples from a row to the next.
    """

    simulator: Simulator
    states: FloatArray
    acceleration: FloatArray
    ends: tuple[int, ...]
    free: BoolArray
    every: int
    wide: float
    came: tuple[tuple[Episode, FloatArray], ...]

    def actions(self, late: float) -> FloatArray:
        """(N, A): what was commanded, if commands come late by so many s."""
        parts = _below(self.wide, (_held(episode, t - late) for episode, t in self.came))
        return np.concatenate([part[:: self.every] for part in parts])

    def heard(self, force: FloatArray, narrow: float) -> FloatArray:
        """(K, C, ...): forces (N, C, ...) below a share of the Nyquist frequency, at rows that tell something new.

        Nothing of a coordinate that something else pushes meanwhile, or where the filter has not settled.
        """
        every = np.concatenate(_below(narrow * self.every, np.split(force, self.ends[:-1])))
        rows, told = self.told(narrow)
        return np.asarray(every[rows] * told.reshape(told.shape + (1,) * (force.ndim - 2)))

    def told(self, narrow: float) -> tuple[IntArray, BoolArray]:
        """(K,) those rows, and (K, C) whether they tell of a coordinate."""
        spacing = max(round(1.0 / narrow / self.every), 1)
        firsts = (0, *self.ends[:-1])
        rows = np.concatenate(
            [np.arange(a + spacing, b - spacing, spacing) for a, b in zip(firsts, self.ends, strict=True)]
        )
        about = rows[:, None] + np.arange(-spacing, spacing + 1)
        moves = self._moving[about].mean(axis=1) >= MOSTLY
        return rows, np.asarray(moves & self.free[about].all(axis=1))

    @cached_property
    def _moving(self) -> BoolArray:
        """(N, C): which coordinates move."""
        names, coordinates = self.simulator.state, self.simulator.coordinates
        speeds = np.abs(self.states[:, [names.index(c.velocity) for c in coordinates]])
        return np.asarray(speeds > SLOW * np.quantile(speeds, USUAL, axis=0))


def low_passed(simulator: Simulator, recording: Recording, wide: float) -> LowPassed | None:
    """The motion below a share of the Nyquist frequency; None where every stretch is too short."""
    every = max(int(1.0 / wide), 1)
    states, acceleration, came = [], [], []
    part = min(1.0, LONGEST * every / sum(len(e) for e in recording.episodes))
    for episode in recording.episodes:
        for start, stop in _stretches(episode, recording.dt):
            grid = np.arange(start, start + part * (stop - start), recording.dt)
            if len(grid) < max(SHORTEST, FEWEST * every):
                continue
            (smooth,) = _below(wide, [_positions(simulator, episode)(grid)])
            path = CubicSpline(grid, smooth)
            t = grid[1:-1]
            states.append(_states(simulator, path(t[::every]), path(t[::every], 1)))
            acceleration.append(path(t[::every], 2))
            came.append((episode, t))
    if not states:
        return None
    ends = tuple(int(n) for n in np.cumsum([len(part) for part in states]))
    moved = np.concatenate(states)
    system = closed(simulator)
    assert system is not None
    return LowPassed(
        simulator,
        moved,
        np.concatenate(acceleration),
        ends,
        ~system.hindered(moved),
        every,
        wide,
        tuple(came),
    )


def _below(share: float, parts: Iterable[FloatArray]) -> list[FloatArray]:
    """Each of the parts (N, ...) below a share of the Nyquist frequency, without a delay."""
    from scipy.signal import butter, sosfiltfilt  # here: most commands need not wait for it

    sos = butter(ORDER, share, output="sos")
    return [sosfiltfilt(sos, part, axis=0) for part in parts]


def _stretches(episode: Episode, dt: float) -> list[tuple[float, float]]:
    """From when to when it was recorded, but for long gaps."""
    breaks = np.flatnonzero(np.diff(episode.t) > GAP * dt)
    firsts, lasts = [0, *(breaks + 1)], [*breaks, len(episode) - 1]
    return [(episode.t[first], episode.t[last]) for first, last in zip(firsts, lasts, strict=True)]


def _positions(simulator: Simulator, episode: Episode) -> Callable[[FloatArray], FloatArray]:
    """Of moments (M,) the positions (M, C), by cubic splines through the samples that count."""
    names, paths = simulator.state, []
    for coordinate in simulator.coordinates:
        i = names.index(coordinate.name)
        good = np.ones(len(episode.t), bool) if episode.weights is None else episode.weights[:, i] > 0.0
        read = episode.states[good, i]
        paths.append(CubicSpline(episode.t[good], np.unwrap(read) if names.wraps[i] else read))
    return lambda t: np.stack([path(t) for path in paths], axis=1)


def _held(episode: Episode, t: FloatArray) -> FloatArray:
    """(M, A): what was commanded at moments (M,), as a line through the middles of what was held."""
    middle = (episode.t[1:] + episode.t[:-1]) / 2.0
    return np.stack([np.interp(t, middle, given) for given in episode.actions.T], axis=1)


def _states(simulator: Simulator, positions: FloatArray, speeds: FloatArray) -> FloatArray:
    """(M, S): states of coordinates and their velocities."""
    out = np.empty((len(positions), len(simulator.state)))
    for c, q, v in zip(simulator.coordinates, positions.T, speeds.T, strict=True):
        out[:, simulator.state.index(c.name)], out[:, simulator.state.index(c.velocity)] = q, v
    return out
