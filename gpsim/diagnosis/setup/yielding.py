"""Friction that yields: a scan over how far bristles may bend, by what the base simulator misses of the forces.

Of each way d the bend of Dahl's bristles (1968) follows from the speeds that were read: z' = (v - |v| z) / d,
between -1 and 1. What is missed is held against it and its damping, beside what smooth laws of position, speed and
command explain. The shortest way that noise lets through, and the sign of the speed, stand for friction that does not
yield: a longer one has to do surely better. So nothing is told where a sensor or a clock cannot resolve it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from gpsim.channels import FloatArray, difference
from gpsim.effects import closed
from gpsim.recordings import Episode, Recording
from gpsim.simulators import Coordinate, Simulator

Yields = tuple[float, float] | tuple[()]
ROWS = 4000  # transitions that are looked at, about
FEWEST = 200  # below nothing is told
WAYS = 10  # that are tried
LONGEST = 0.25  # of the whole way: a longer one is a spring
SHORTEST = 1e-3  # of the whole way
NOISES = 3.0  # standard deviations of a position's noise: what bends by less, nobody sees
STRETCH = 25  # transitions over which what was missed is summed, as long as a window
BETTER = 12.0  # nats by which a way must beat none, and friction that does not yield: residuals are not white


def yields(
    recording: Recording, simulator: Simulator, parameters: Mapping[str, float], coordinate: Coordinate
) -> Yields:
    """(force, way) of friction on a coordinate that surely yields; nothing where none does, or it cannot be seen."""
    if closed(simulator) is not None:
        return ()
    episodes = _some(recording)
    at, speed = (simulator.state.index(n) for n in (coordinate.name, coordinate.velocity))
    moves = [difference(e.states[1:], e.states[:-1], simulator.state)[:, at] for e in episodes]
    ways = _ways(moves, recording.noise.get(coordinate.name))
    if sum(map(len, moves)) < FEWEST or not len(ways):
        return ()
    before, after = (np.concatenate([e.states[s] for e in episodes]) for s in (slice(-1), slice(1, None)))
    actions = np.concatenate([np.hstack([e.actions, np.roll(e.actions, 1, axis=0)]) for e in episodes])
    dt = np.maximum(np.concatenate([np.diff(e.t) for e in episodes]), 1e-9)
    now = actions[:, : len(simulator.action)]
    missed, inertia = _missed(simulator, parameters, coordinate, before, after, now, dt)
    known = _smooth(before[:, at], before[:, speed], actions)
    rigid = np.sign(before[:, [speed]] + after[:, [speed]])
    missed, known = _summed(missed * dt[:, None]), _summed(known * dt[:, None])
    force = _sizes(missed, known, _summed(rigid * dt[:, None]))[0][0]
    if force <= 0.0:
        return ()
    bends = np.concatenate([_bends(e.states[:, speed], ways, np.diff(e.t)) for e in episodes])
    columns = bends[..., 0] + np.sqrt(inertia * ways / force) * bends[..., 1]
    return _best([missed, known, _summed(np.hstack([rigid, columns]) * dt[:, None])], ways)


def _some(recording: Recording) -> list[Episode]:
    """Whole episodes with about as many transitions as are looked at."""
    out: list[Episode] = []
    for episode in recording.episodes:
        if len(episode) > 2 and sum(map(len, out)) < ROWS:
            out.append(episode)
    return out


def _ways(moves: Sequence[FloatArray], noise: float | None) -> FloatArray:
    """The ways that are tried; none where noise lets none through."""
    if not moves:
        return np.empty(0)
    whole = max(float(np.ptp(np.cumsum(moved))) for moved in moves)
    first, last = max(SHORTEST * whole, NOISES * (noise or _noise(moves))), LONGEST * whole
    return np.geomspace(first, last, WAYS) if 0.0 < 2.0 * first < last else np.empty(0)


def _noise(moves: Sequence[FloatArray]) -> float:
    """Of positions, by their differences of high orders: on a slow clock those of low ones are still motion."""
    found = []
    for order in (3, 5, 7):
        apart = np.concatenate([np.diff(moved, order - 1) for moved in moves])
        if len(apart):
            found.append(1.48 * float(np.median(np.abs(apart))) / np.sqrt(math.comb(2 * order, order)))
    return min(found, default=np.inf)


def _bends(speed: FloatArray, ways: FloatArray, dt: FloatArray) -> FloatArray:
    """(N, D, 2) how far bristles are bent in the mean of each of N moves, 1 where they slide; how fast that grows.

    Moves are by the speed (N + 1,), whose noise adds up to less than that of two positions.
    """
    moved = dt * (speed[:-1] + speed[1:]) / 2
    far = np.maximum(np.abs(moved)[:, None] / ways, 1e-9)
    kept, mean, sign = np.exp(-far), -np.expm1(-far) / far, np.sign(moved)[:, None]
    bend, out = np.zeros(len(ways)), np.empty((len(moved), len(ways), 2))
    for k in range(len(moved)):
        after = bend * kept[k] + sign[k] * (1.0 - kept[k])
        out[k, :, 0] = bend * mean[k] + sign[k] * (1.0 - mean[k])
        out[k, :, 1] = (after - bend) / max(float(dt[k]), 1e-9)
        bend = after
    return out


def _missed(
    simulator: Simulator,
    parameters: Mapping[str, float],
    coordinate: Coordinate,
    before: FloatArray,
    after: FloatArray,
    actions: FloatArray,
    dt: FloatArray,
) -> tuple[FloatArray, float]:
    """(N, 1) the force that the base simulator misses in each transition; the coordinate's usual inertia."""
    names, column = [c.name for c in simulator.coordinates], simulator.rate.index(coordinate.rate)
    push = np.zeros((len(before), len(names)))
    push[:, names.index(coordinate.name)] = 1.0
    rates = simulator.rates(before, actions, parameters)[:, column]
    easily = simulator.rates(before, actions, parameters, push)[:, column] - rates
    easily = np.where(np.abs(easily) > 0, easily, np.inf)
    mean = (rates + simulator.rates(after, actions, parameters)[:, column]) / 2  # on a slow clock it changes
    found = simulator.measured_rates(before, after, dt)[:, column] - mean
    return np.nan_to_num(found / easily)[:, None], 1.0 / float(np.median(np.abs(easily)))


def _smooth(q: FloatArray, speed: FloatArray, commands: FloatArray) -> FloatArray:
    """(N, K) what smooth laws may be made of."""
    x, v = (a / max(float(np.std(a)), 1e-300) for a in (q - q.mean(), speed))
    return np.stack(
        [np.ones_like(x), x, x**2, x**3, v, v * np.abs(v), np.sin(q), np.cos(q), *commands.T], axis=1
    )


def _summed(rows: FloatArray) -> FloatArray:
    """(N, K) sums since each stretch began, less their mean: of what a noisy speed misses, noise that is white."""
    count = len(rows) // STRETCH
    sums = np.cumsum(rows[: count * STRETCH].reshape(count, STRETCH, -1), axis=1)
    return np.asarray((sums - sums.mean(axis=1, keepdims=True)).reshape(count * STRETCH, -1))


def _sizes(
    missed: FloatArray, known: FloatArray, columns: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """(K,) how much each column (N, K) alone resists, the squares (K,) that it leaves, those that none takes off."""
    basis, _ = np.linalg.qr(known)
    rest, own = (a - basis @ (basis.T @ a) for a in (missed, columns))
    alike, size = own.T @ rest[:, 0], np.maximum(np.sum(own**2, axis=0), 1e-300)
    power = float(np.sum(rest**2))
    return -alike / size, np.maximum(power - alike**2 / size, 1e-300), power


def _best(together: Sequence[FloatArray], ways: FloatArray) -> Yields:
    """The best way, if it surely is; the first column stands for the sign of the speed."""
    forces, squares, power = _sizes(*together)
    best = int(squares.argmin())
    rigid = min(float(squares[:2].min()), power)
    sure = len(together[0]) / 2 * np.log(rigid / squares[best]) > BETTER
    inner = 2 <= best < len(ways)  # beyond the longest there is a spring
    return (float(forces[best]), float(ways[best - 1])) if inner and forces[best] > 0.0 and sure else ()
