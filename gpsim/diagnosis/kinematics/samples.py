"""What was seen of a robot's sites, beside the positions of its joints at any delay."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.mjcf import MjcfSimulator
from gpsim.recordings import PLACE, TURN, Episode, Recording, evenly, gaps, pieces

MOST = 2000  # samples that are looked at: more of one motion say little more
HELD_OUT = 0.2  # of the samples, the last ones, are judged on alone
FEWEST_OF_A_SPLINE = 4  # samples that a cubic needs
FEWEST = 20  # samples in which a site was seen, below which nothing is asked


@dataclass(frozen=True)
class Piece:
    """A stretch of an episode without a gap: its clock from `first` to `last` [s], qpos and its slope at any moment."""

    first: float
    last: float
    positions: CubicSpline


@dataclass(frozen=True)
class Samples:
    """N moments of a recording.

    t: (N,) s; piece: (N,) of `pieces`; points: (N, T, 3) m, NaN where nothing was seen; quats: (N, T, 4), real part
    first, NaN too; turned: of which targets the orientation was measured; training: (N,).
    """

    names: tuple[str, ...]
    turned: tuple[bool, ...]
    t: FloatArray
    piece: IntArray
    pieces: tuple[Piece, ...]
    points: FloatArray
    quats: FloatArray
    training: BoolArray

    def __len__(self) -> int:
        """N."""
        return len(self.t)

    def at(self, delay: float) -> tuple[FloatArray, FloatArray, BoolArray]:
        """(N, nq), (N, nq) 1/s, (N,): positions and speeds `delay` s before, and whether the joints were read then."""
        width = self.pieces[0].positions(self.t[0]).size
        positions, speeds = np.zeros((len(self), width)), np.zeros((len(self), width))
        known = np.zeros(len(self), dtype=np.bool_)
        for number, piece in enumerate(self.pieces):
            rows = self.piece == number
            then = np.clip(self.t[rows] - delay, piece.first, piece.last)
            positions[rows], speeds[rows] = piece.positions(then), piece.positions(then, 1)
            known[rows] = then == self.t[rows] - delay
        return positions, speeds, known


def samples_of(recording: Recording, simulator: MjcfSimulator) -> Samples | None:
    """The samples of a recording in which somebody saw something; None where nobody did."""
    names = tuple(name.removesuffix(".x") for name in recording.poses.names if name.endswith(".x"))
    if not names:
        return None
    turned = tuple(f"{name}.qw" in recording.poses.names for name in names)
    found: list[tuple[float, int, FloatArray]] = []
    splines: list[Piece] = []
    for episode in recording.episodes:
        for first, last in _pieces(episode, recording.dt):
            rows = slice(first, last + 1)
            qpos = _positions(episode, recording, simulator)[rows]
            t, poses = episode.t[rows], episode.poses
            assert poses is not None
            splines.append(Piece(float(t[0]), float(t[-1]), CubicSpline(t, qpos)))
            found += [(float(when), len(splines) - 1, row) for when, row in zip(t, poses[rows], strict=True)]
    places = [recording.poses.index(f"{name}.{part}") for name in names for part in PLACE]
    seen = [one for one in found if np.isfinite(one[2][places]).any()]
    if len(seen) < FEWEST:
        return None
    looked = [seen[i] for i in evenly(len(seen), MOST)]
    values = np.stack([row for _, _, row in looked])
    count = len(looked)
    quats = np.full((count, len(names), 4), np.nan)
    for k, name in enumerate(names):
        if turned[k]:
            quats[:, k] = values[:, [recording.poses.index(f"{name}.{part}") for part in TURN]]
    return Samples(
        names,
        turned,
        np.array([when for when, _, _ in looked]),
        np.array([piece for _, piece, _ in looked]),
        tuple(splines),
        values[:, places].reshape(count, len(names), 3),
        quats,
        np.arange(count) < count - round(HELD_OUT * count),
    )


def _pieces(episode: Episode, dt: float) -> Iterator[tuple[int, int]]:
    ends = np.flatnonzero(gaps(episode.t, dt)).tolist()
    if episode.poses is not None:
        yield from ((a, b) for a, b in pieces(ends, len(episode)) if b - a + 1 >= FEWEST_OF_A_SPLINE)


def _positions(episode: Episode, recording: Recording, simulator: MjcfSimulator) -> FloatArray:
    """(K + 1, nq): every joint as its encoder says, angles running on."""
    layout = simulator.layout
    qpos = np.tile(layout.qpos, (len(episode.t), 1))
    for column, place in zip(layout.q_columns, layout.q_places, strict=True):
        name = simulator.state.names[column]
        if name not in recording.state.names:
            continue
        channel = recording.state.items[recording.state.index(name)]
        values = episode.states[:, recording.state.index(name)]
        qpos[:, place] = np.unwrap(values) if channel.unit == "rad" else values
    return qpos
