"""What was seen of a robot's sites, and the geometry that explains it best by least squares.

y = what was seen, f(theta) = where the model says it is; theta: a value of every place, the delay last. Gauss and
Newton's way; errors of samples that leap weigh little (Huber 1964), and are left out at the end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.mjcf import Kinematics, MjcfSimulator
from gpsim.recordings import PLACE, TURN, Episode, Recording, evenly, gaps, pieces

MOST = 2000  # samples that are looked at: more of one motion say little more
HELD_OUT = 0.2  # of the samples, the last ones, are judged on alone
FEWEST_OF_A_SPLINE = 4  # samples that a cubic needs
FEWEST = 20  # samples in which a site was seen, below which nothing is asked


@dataclass(frozen=True)
class Samples:
    """N moments of a recording.

    t: (N,) s; piece: (N,) of `pieces`, stretches without a gap: qpos over the clock [s]; points: (N, T, 3) m, NaN where
    nothing was seen; quats: (N, T, 4), real part first, NaN too; turned: of which targets the orientation was measured;
    training: (N,).
    """

    names: tuple[str, ...]
    turned: tuple[bool, ...]
    t: FloatArray
    piece: IntArray
    pieces: tuple[CubicSpline, ...]
    points: FloatArray
    quats: FloatArray
    training: BoolArray

    def __len__(self) -> int:
        """N."""
        return len(self.t)

    def take(self, rows: IntArray) -> Samples:
        """Some of them."""
        kept = {name: getattr(self, name)[rows] for name in ("t", "piece", "points", "quats", "training")}
        return replace(self, **kept)

    def at(self, delay: float) -> tuple[FloatArray, FloatArray, BoolArray]:
        """(N, nq), (N, nq) 1/s, (N,): positions and speeds `delay` s before, and whether the joints were read then."""
        width = self.pieces[0].c.shape[-1]
        positions, speeds = np.zeros((len(self), width)), np.zeros((len(self), width))
        then = self.t - delay
        known = np.zeros(len(self), dtype=np.bool_)
        for number, spline in enumerate(self.pieces):
            rows = self.piece == number
            inside = np.clip(then[rows], spline.x[0], spline.x[-1])
            positions[rows], speeds[rows] = spline(inside), spline(inside, 1)
            known[rows] = inside == then[rows]
        return positions, speeds, known


def samples_of(recording: Recording, simulator: MjcfSimulator) -> Samples | None:
    """The samples of a recording in which somebody saw something; None where nobody did."""
    channels = recording.poses
    names = tuple(name.removesuffix(".x") for name in channels.names if name.endswith(".x"))
    t, piece, poses, splines = [], [], [], list[CubicSpline]()
    for episode in recording.episodes:
        if episode.poses is None:
            continue
        ends = np.flatnonzero(gaps(episode.t, recording.dt)).tolist()
        qpos = _positions(episode, recording, simulator)
        for first, last in pieces(ends, len(episode)):
            if last - first + 1 >= FEWEST_OF_A_SPLINE:
                part = slice(first, last + 1)
                t.append(episode.t[part])
                piece.append(np.full(last + 1 - first, len(splines)))
                poses.append(episode.poses[part])
                splines.append(CubicSpline(episode.t[part], qpos[part]))
    if not names or not splines:
        return None
    values = np.concatenate(poses)
    points = values[:, [channels.index(f"{name}.{part}") for name in names for part in PLACE]]
    seen = np.flatnonzero(np.isfinite(points).any(axis=1))
    if len(seen) < FEWEST:
        return None
    turned = tuple(f"{name}.qw" in channels.names for name in names)
    quats = np.full((len(values), len(names), 4), np.nan)
    for k, name in enumerate(names):
        if turned[k]:
            quats[:, k] = values[:, [channels.index(f"{name}.{part}") for part in TURN]]
    rows = seen[evenly(len(seen), MOST)]
    return Samples(
        names,
        turned,
        np.concatenate(t)[rows],
        np.concatenate(piece)[rows],
        tuple(splines),
        points[rows].reshape(len(rows), len(names), 3),
        quats[rows],
        np.arange(len(rows)) < len(rows) - round(HELD_OUT * len(rows)),
    )


def _positions(episode: Episode, recording: Recording, simulator: MjcfSimulator) -> FloatArray:
    """(K + 1, nq): every joint as its encoder says, angles running on."""
    layout = simulator.layout
    qpos = np.tile(layout.qpos, (len(episode.t), 1))
    for column, place in zip(layout.q_columns, layout.q_places, strict=True):
        name = simulator.state.names[column]
        if name in recording.state.names:
            own = recording.state.index(name)
            values = episode.states[:, own]
            qpos[:, place] = np.unwrap(values) if recording.state.items[own].unit == "rad" else values
    return qpos


SIZES = {
    "frame turn": 1.0,
    "frame place": 1.0,
    "joint zero": 0.05,
    "body place": 0.005,
    "body turn": 0.02,
    "site place": 0.01,
    "site turn": 0.05,
}
"""Usual sizes [rad, m], standard deviations: of a laboratory's frame anything; a joint is homed to 3 degrees; links are
made to millimetres and squared to a degree; a marker is glued on by hand."""
SLIDE = 0.005  # m, of the zero of a joint that slides
DELAY = 0.1  # s, by which a camera's pictures usually come late
AHEAD = 1e-4  # s, over which the slope by the delay is taken
ROUNDS, SETTLED = 30, 1e-4  # of Gauss and Newton; of the usual sizes, a step that ends them
FARTHEST = 0.5  # rad, of a turn in one step: beyond, a slope says nothing
HUBER = 2.0  # standard deviations, beyond which an error counts by its size alone
WILD = 6.0  # standard deviations, beyond which a sample leaps: 1 in 10^8 of a normal error
MAD = 1.4826  # standard deviations of a normal error to one of its median
LEAST = 1e-9  # m, rad: what no motion capture tells


@dataclass(frozen=True)
class Problem:
    """A model's kinematics and the samples to be explained; M = 3 T numbers of points, then 3 of each orientation."""

    kinematics: Kinematics
    samples: Samples

    @property
    def size(self) -> int:
        """How many numbers are asked, the delay among them."""
        return len(self.kinematics.places) + 1

    @property
    def usual(self) -> FloatArray:
        """(P + 1,): usual sizes."""
        slides = [place.kind == "joint zero" and place.unit == "m" for place in self.kinematics.places]
        sizes = [SIZES[place.kind] for place in self.kinematics.places]
        return np.array([*np.where(slides, SLIDE, sizes), DELAY])

    @property
    def turns(self) -> BoolArray:
        """(M,): whether a residual is an angle."""
        points = 3 * len(self.samples.names)
        return np.arange(points + 3 * sum(self.samples.turned)) >= points

    @property
    def measured(self) -> list[int]:
        """The targets of which the orientation was measured."""
        return [k for k, own in enumerate(self.samples.turned) if own]

    def residual(self, theta: FloatArray) -> FloatArray:
        """(N, M): what was seen minus what the model says, NaN where either is not known."""
        qpos, _, known = self.samples.at(float(theta[-1]))
        poses = self.kinematics.poses(qpos, theta[:-1])
        off = [(self.samples.points - poses.points).reshape(len(qpos), -1)]
        for k in self.measured:
            quats, turned = self.samples.quats[:, k], np.full((len(qpos), 3), np.nan)
            seen = np.isfinite(quats).all(axis=1) & (quats != 0.0).any(axis=1)
            there = Rotation.from_quat(np.roll(quats[seen], -1, axis=1))  # its real part is last
            turned[seen] = (there * Rotation.from_matrix(poses.axes[seen, k]).inv()).as_rotvec()
            off.append(turned)
        return np.where(known[:, None], np.hstack(off), np.nan)

    def place_slopes(self, theta: FloatArray) -> FloatArray:
        """(N, M, P): of what the model says by its places."""
        found = self.kinematics.slopes(self.samples.at(float(theta[-1]))[0], theta[:-1])
        points = found.points.reshape(len(self.samples), -1, len(theta) - 1)
        return np.concatenate([points, *(found.axes[:, k] for k in self.measured)], axis=1)

    def slopes(self, theta: FloatArray) -> FloatArray:
        """(N, M, P + 1): the same, and by the delay."""
        qpos, speeds, _ = self.samples.at(float(theta[-1]))
        here, there = (self.kinematics.poses(q, theta[:-1]) for q in (qpos, qpos - AHEAD * speeds))
        late = [(there.points - here.points).reshape(len(qpos), -1)]
        for k in self.measured:
            now, then = (Rotation.from_matrix(poses.axes[:, k]) for poses in (here, there))
            late.append((then * now.inv()).as_rotvec())
        return np.concatenate([self.place_slopes(theta), np.hstack(late)[..., None] / AHEAD], axis=2)


@dataclass(frozen=True)
class Fit:
    """theta: (P + 1,); residual: (N, M); kept: (N,) samples that were seen and do not leap; sigma: (M,) of errors."""

    theta: FloatArray
    residual: FloatArray
    kept: BoolArray
    sigma: FloatArray


def fitted(problem: Problem, active: IntArray, start: FloatArray, sigma: FloatArray | None = None) -> Fit:
    """The best values of the `active` numbers, all others 0; sigma: (M,) where it is known already."""
    theta, usual = np.zeros(problem.size), problem.usual[active]
    theta[active] = start[active]
    training = problem.samples.training

    def errors() -> tuple[FloatArray, FloatArray, FloatArray]:
        """Residuals, their standard deviations, and sizes in these; 0 where nothing was seen."""
        residual = problem.residual(theta)
        scale = sigma if sigma is not None else scales(residual[training], problem.turns)
        return residual, scale, np.nan_to_num(np.abs(residual / scale))

    residual, scale, size = errors()
    for _ in range(ROUNDS):
        weights = np.where(np.isfinite(residual), HUBER / np.maximum(size, HUBER), 0.0)
        weights *= training[:, None] / scale**2
        normal, pull = weighed(problem.slopes(theta)[:, :, active], weights, residual)
        step = np.linalg.solve(normal + np.diag(usual**-2), pull - theta[active] / usual**2)
        turn = float(np.linalg.norm(step[active < 3]))  # of the frame, which is first
        step *= min(1.0, FARTHEST / max(turn, LEAST))
        theta[active] += step
        residual, scale, size = errors()
        if np.abs(step / usual).max() < SETTLED:
            break
    kept = np.isfinite(residual).any(axis=1) & ~(size > WILD).any(axis=1)
    return Fit(theta, residual, np.asarray(kept), scale)


def weighed(slopes: FloatArray, weights: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J'WJ (P, P) and J'Wy (P,) of slopes (N, M, P), weights (N, M) and values (N, M), NaN where they weigh 0."""
    root = np.sqrt(weights).reshape(-1, 1)
    flat = root * slopes.reshape(len(root), -1)
    return np.asarray(flat.T @ flat), np.asarray(flat.T @ (root[:, 0] * np.nan_to_num(values).ravel()))


def scales(residual: FloatArray, turns: BoolArray) -> FloatArray:
    """(M,): the standard deviation of residuals (N, M), one of all points and one of all angles, whatever leaps."""
    out = np.empty(len(turns))
    for kind in set(turns.tolist()):
        out[turns == kind] = max(MAD * float(np.nanmedian(np.abs(residual[:, turns == kind]))), LEAST)
    return out
