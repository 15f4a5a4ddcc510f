"""What commands teach, in nats: between rivals, of the leader's parameters, and where nothing was visited.

Between rivals (T-optimal; Atkinson and Fedorov 1975): the log likelihood that one explanation loses to another one that
is true, after its own parameters have moved to where they mimic the other best, as far as their posterior lets them.
Of parameters (D-optimal): by how much the leader's posterior shrinks. Both are linear in the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from gpsim.channels import FloatArray, IntArray
from gpsim.planning.models import Model

Pair = tuple[int, int]


@dataclass(frozen=True)
class Sums:
    """Over all that is played of each candidate e: fisher[k] (E, P, P); of a pair squares (E,), slopes (E, P)."""

    fisher: tuple[FloatArray, ...]
    squares: dict[Pair, FloatArray]
    slopes: dict[Pair, FloatArray]

    def plus(self, other: Sums) -> Sums:
        """Sums of both; one candidate of the first goes with each of the other."""
        return Sums(
            tuple(a + b for a, b in zip(self.fisher, other.fisher, strict=True)),
            {p: self.squares[p] + other.squares[p] for p in self.squares},
            {p: self.slopes[p] + other.slopes[p] for p in self.slopes},
        )

    def only(self, index: int) -> Sums:
        """One candidate."""
        row = slice(index, index + 1)
        return Sums(
            tuple(f[row] for f in self.fisher),
            {p: v[row] for p, v in self.squares.items()},
            {p: v[row] for p, v in self.slopes.items()},
        )


def nothing_played(models: Sequence[Model]) -> Sums:
    """Sums over no command."""
    sizes = [m.size for m in models]
    pairs = [(a, b) for a in range(len(sizes)) for b in range(len(sizes)) if a != b]
    return Sums(
        tuple(np.zeros((1, p, p)) for p in sizes),
        {pair: np.zeros(1) for pair in pairs},
        {(a, b): np.zeros((1, sizes[b])) for a, b in pairs},
    )


def summed(models: Sequence[Model], said: Sequence[FloatArray], noise: FloatArray) -> Sums:
    """Of what each model says (C, E, L + 1, S); noise (S,), infinite where nothing is measured."""
    state_error, courses, slopes = models[0].machine.simulator.state_error, [s[0] for s in said], []
    for model, one in zip(models, said, strict=True):
        moved = state_error(one[1 : 1 + model.size], one[:1]) / noise
        flat = moved.reshape(model.size, moved.shape[1], -1) / model.nudges[:, None, None]
        slopes.append(np.moveaxis(flat, 0, 2))  # (E, N, P)
    squares, against = {}, {}
    for a in range(len(models)):
        for b in range(len(models)):
            if a != b:
                left = (state_error(courses[a], courses[b]) / noise).reshape(courses[a].shape[0], -1)
                squares[a, b] = (left**2).sum(axis=1)
                against[a, b] = np.einsum("enp,en->ep", slopes[b], left)
    return Sums(tuple(np.einsum("enp,enq->epq", s, s) for s in slopes), squares, against)


def separations(models: Sequence[Model], sums: Sums) -> FloatArray:
    """(E, pairs) nats between each two explanations, the less of both ways."""
    pairs = [(a, b) for a, b in sums.squares if a < b]
    out = [np.minimum(_nats(models[b], sums, (a, b)), _nats(models[a], sums, (b, a))) for a, b in pairs]
    return np.stack(out, axis=1) if out else np.empty((len(sums.fisher[0]), 0))


def _nats(model: Model, sums: Sums, pair: Pair) -> FloatArray:
    """(E,) that the second of a pair loses where the first is true."""
    square, slope, fisher = sums.squares[pair], sums.slopes[pair], sums.fisher[pair[1]]
    if model.size:
        scale, prior = _prior(model)
        moved = np.linalg.solve(fisher * np.outer(scale, scale) + prior, (slope * scale)[..., None])[..., 0]
        square = square - (slope * scale * moved).sum(axis=1)
    return np.asarray(0.5 * np.maximum(square, 0.0))


def precisions(model: Model, sums: Sums) -> FloatArray:
    """(E,) nats by which the leader's parameters are known better."""
    if not model.size:
        return np.zeros(len(sums.fisher[0]))
    scale, known = _prior(model)
    after = np.linalg.slogdet(sums.fisher[0] * np.outer(scale, scale) + known)[1]
    return np.asarray(0.5 * (after - np.linalg.slogdet(known)[1]))


def _prior(model: Model) -> tuple[FloatArray, FloatArray]:
    """Each parameter's deviation (P,), and in its units the precision (P, P), a little less than singular."""
    covariance = model.explanation.covariance
    scale = np.sqrt(np.diag(covariance))
    return scale, np.linalg.inv(covariance / np.outer(scale, scale) + 1e-9 * np.eye(len(scale)))


@dataclass(frozen=True)
class Unvisited:
    """Nats of a Gaussian process that knows nothing but where it has been: rows (M, C) in units of `scale` (C,)."""

    rows: FloatArray
    scale: FloatArray
    columns: IntArray

    def nats(self, visits: FloatArray) -> FloatArray:
        """(E,) of visits (E, K, C)."""
        points = self.scaled(visits)
        size = points.shape[1]
        known = _alike(self.rows, self.rows) + VARIANCE * np.eye(len(self.rows))
        beside = _alike(points.reshape(-1, points.shape[2]), self.rows)
        root = solve_triangular(np.linalg.cholesky(known), beside.T, lower=True).T
        root = root.reshape(len(points), size, -1)
        left = np.stack([_alike(p, p) for p in points]) - root @ root.transpose(0, 2, 1)
        return np.asarray(0.5 * np.maximum(np.linalg.slogdet(np.eye(size) + left / VARIANCE)[1], 0.0))

    def scaled(self, visits: FloatArray) -> FloatArray:
        """Visits in the columns that are known, in their units."""
        return np.asarray(visits[..., self.columns] / self.scale)

    def with_visits(self, visits: FloatArray) -> Unvisited:
        """The same after being there, too."""
        return Unvisited(np.concatenate([self.rows, self.scaled(visits)]), self.scale, self.columns)


VARIANCE = 0.1  # of the process's noise, of its own 1
POINTS = 12  # of a piece, which stand for where it goes


def unvisited(rows: FloatArray) -> Unvisited:
    """After the recording: rows (M, S + A); columns that it does not show, or that never change, do not count."""
    spread = rows.std(axis=0)
    columns = np.flatnonzero(np.isfinite(spread) & (spread > 0.0))
    return Unvisited(rows[:, columns] / spread[columns], spread[columns], columns)


def _alike(one: FloatArray, other: FloatArray) -> FloatArray:
    """(N, M) covariance of a squared exponential of unit length."""
    apart = ((one[:, None] - other[None]) ** 2).sum(axis=2)
    return np.asarray(np.exp(-0.5 * apart))
