"""Least squares of a geometry: residuals and slopes at one guess, and Gauss and Newton's way to the best one.

y = what was seen, f(theta) = where the model says it is; theta: a value of every place, the delay last. Errors of
samples that leap weigh little (Huber 1964), and are left out at the end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.kinematics.samples import Samples
from gpsim.mjcf import Kinematics, Place

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
        return np.array([*(_usual(p) for p in self.kinematics.places), DELAY])

    @property
    def turns(self) -> BoolArray:
        """(M,): whether a residual is an angle."""
        points = 3 * len(self.samples.names)
        return np.arange(points + 3 * sum(self.samples.turned)) >= points

    def residual(self, theta: FloatArray) -> FloatArray:
        """(N, M): what was seen minus what the model says, NaN where either is not known."""
        qpos, _, known = self.samples.at(float(theta[-1]))
        poses = self.kinematics.poses(qpos, theta[:-1])
        off = (self.samples.points - poses.points).reshape(len(qpos), -1)
        turned = [
            _turn_between(self.samples.quats[:, k], poses.axes[:, k])
            for k, own in enumerate(self.samples.turned)
            if own
        ]
        whole = np.hstack([off, *turned])
        return np.where(known[:, None], whole, np.nan)

    def place_slopes(self, theta: FloatArray) -> FloatArray:
        """(N, M, P): of what the model says by its places."""
        found = self.kinematics.slopes(self.samples.at(float(theta[-1]))[0], theta[:-1])
        turned = [found.axes[:, k] for k, own in enumerate(self.samples.turned) if own]
        return np.concatenate([found.points.reshape(len(self.samples), -1, len(theta) - 1), *turned], axis=1)

    def slopes(self, theta: FloatArray) -> FloatArray:
        """(N, M, P + 1): the same, and by the delay."""
        qpos, speeds, _ = self.samples.at(float(theta[-1]))
        here, there = (self.kinematics.poses(q, theta[:-1]) for q in (qpos, qpos - AHEAD * speeds))
        late = [(there.points - here.points).reshape(len(qpos), -1)]
        late += [
            _vector(there.axes[:, k] @ here.axes[:, k].swapaxes(1, 2))
            for k, own in enumerate(self.samples.turned)
            if own
        ]
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
    theta, usual = np.zeros(problem.size), problem.usual
    theta[active] = start[active]
    training = problem.samples.training
    residual = problem.residual(theta)
    for _ in range(ROUNDS):
        scale = sigma if sigma is not None else scales(residual[training], problem.turns)
        weights = _weights(residual, scale) * training[:, None] / scale**2
        normal, pull = weighed(problem.slopes(theta)[:, :, active], weights, residual)
        normal += np.diag(usual[active] ** -2)
        pull -= theta[active] / usual[active] ** 2
        step = np.linalg.solve(normal, pull)
        whole = np.zeros_like(theta)
        whole[active] = step
        step *= min(1.0, FARTHEST / max(float(np.linalg.norm(whole[:3])), LEAST))
        theta[active] += step
        residual = problem.residual(theta)
        if np.abs(step / usual[active]).max() < SETTLED:
            break
    scale = sigma if sigma is not None else scales(residual[training], problem.turns)
    return Fit(theta, residual, _kept(residual, scale), scale)


def weighed(slopes: FloatArray, weights: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J'WJ (P, P) and J'Wy (P,) of slopes (N, M, P), weights (N, M) and values (N, M), NaN where they weigh 0."""
    root = np.sqrt(weights).reshape(-1, 1)
    flat = root * slopes.reshape(len(root), -1)
    return np.asarray(flat.T @ flat), np.asarray(flat.T @ (root[:, 0] * np.nan_to_num(values).ravel()))


def scales(residual: FloatArray, turns: BoolArray) -> FloatArray:
    """(M,): the standard deviation of residuals (N, M), one of all points and one of all angles, whatever leaps."""
    out = np.empty(len(turns))
    for kind in (False, True):
        if (turns == kind).any():
            errors = residual[:, turns == kind]
            out[turns == kind] = max(MAD * float(np.nanmedian(np.abs(errors))), LEAST)
    return out


def _weights(residual: FloatArray, scale: FloatArray) -> FloatArray:
    """(N, M): what each counts; 0 where nothing was seen, and of a leap as much as a usual error."""
    size = np.abs(residual / scale)
    return np.where(np.isfinite(size), HUBER / np.maximum(np.nan_to_num(size), HUBER), 0.0)


def _kept(residual: FloatArray, scale: FloatArray) -> BoolArray:
    """(N,): whether something was seen in a sample, and nothing of it leaps."""
    size = np.abs(residual / scale)
    return np.asarray(np.isfinite(size).any(axis=1) & ~(np.nan_to_num(size) > WILD).any(axis=1))


def _usual(place: Place) -> float:
    return SLIDE if place.kind == "joint zero" and place.unit == "m" else SIZES[place.kind]


def _turn_between(quats: FloatArray, axes: FloatArray) -> FloatArray:
    """(N, 3) rad: the rotation vector from axes (N, 3, 3) to quaternions (N, 4), in the frame; NaN without any."""
    length = np.linalg.norm(quats, axis=1, keepdims=True)
    seen = np.isfinite(length[:, 0]) & (length[:, 0] > 0.0)
    out = np.full((len(quats), 3), np.nan)
    out[seen] = _vector(_matrices(quats[seen] / length[seen]) @ axes[seen].swapaxes(1, 2))
    return out


def _matrices(quats: FloatArray) -> FloatArray:
    """(N, 3, 3) of unit quaternions (N, 4)."""
    w, v = quats[:, :1, None], quats[:, 1:]
    cross = np.zeros((len(quats), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]] = v
    cross[:, [1, 2, 0], [2, 0, 1]] = -v
    return np.asarray(np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross)


def _vector(turns: FloatArray) -> FloatArray:
    """(N, 3) rad: rotation vectors of matrices (N, 3, 3), through the sine near 0."""
    odd = 0.5 * np.stack(
        [turns[:, 2, 1] - turns[:, 1, 2], turns[:, 0, 2] - turns[:, 2, 0], turns[:, 1, 0] - turns[:, 0, 1]],
        axis=1,
    )
    sine = np.linalg.norm(odd, axis=1, keepdims=True)
    angle = np.arctan2(sine, 0.5 * (np.trace(turns, axis1=1, axis2=2)[:, None] - 1.0))
    return np.asarray(odd * np.where(sine > LEAST, angle / np.maximum(sine, LEAST), 1.0))
