"""From poses of a model's sites to what of its geometry is off (Mooring, Roth and Driels 1991).

The laboratory's numbers (the frame of the motion capture, its delay) are always fitted; a zero, a length or a turn of
the robot must be worth it. All is linearised anew until the same numbers are chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gpsim.channels import FloatArray
from gpsim.findings import (
    Estimate,
    GeometryFound,
    GeometryPlace,
    InPlaceOf,
    Inseparable,
    ToolError,
)
from gpsim.findings import Kinematics as Told
from gpsim.kinematics.evidence import Linear, counting
from gpsim.kinematics.least_squares import (
    DELAY,
    WILD,
    Fit,
    Problem,
    fitted,
    samples_of,
    scales,
    weighed,
)
from gpsim.mjcf import Kinematics, MjcfSimulator, Moved
from gpsim.recordings import Recording, evenly

AGAIN = 5  # times that all is linearised anew
LATEST, DELAYS = 2.5, 21  # of the usual delay, either way, and how many are tried
FEW = 200  # samples by which a first delay is sought
FAR = 0.3  # of how far the sites travel: a frame further off is first put in place as a whole
NINETY = 1.645  # standard deviations of a normal error, in which 90 % lie
MOST = 4  # that are told in a number's place


@dataclass(frozen=True)
class Calibration:
    """What is told, and how the model is to be moved."""

    told: Told
    moved: tuple[Moved, ...]


def calibrate(recording: Recording, simulator: MjcfSimulator) -> Calibration | None:
    """What a motion capture says of a model's geometry; None where none saw its sites."""
    samples = samples_of(recording, simulator)
    if samples is None:
        return None
    problem = Problem(Kinematics.of(simulator.body, samples.names, samples.turned), samples)
    whole = fitted(problem, np.arange(problem.size), _start(problem))
    share = counting(whole, problem)
    linear = Linear.of(problem, whole, share)
    chosen, fit = linear.selected(), whole
    for _ in range(AGAIN):
        numbers = np.array([*linear.nuisance, *chosen])
        fit = fitted(problem, numbers, fit.theta, whole.sigma)
        linear = Linear.of(problem, fit, share)
        again = linear.selected()
        if again == chosen:
            break
        chosen = again
    placed = fitted(problem, np.array(linear.nuisance), fit.theta)
    error = _errors(problem, placed, fit, whole)
    if chosen and not any(e.after < e.placed for e in error.values()):
        chosen, fit = (), placed
        linear, error = Linear.of(problem, placed, share), _errors(problem, placed, placed, whole)
    told = _told(problem, linear, chosen, fit, error)
    moved = tuple(Moved(problem.kinematics.places[i], float(fit.theta[i])) for i in chosen)
    return Calibration(told, moved)


def _start(problem: Problem) -> FloatArray:
    """(P + 1,): a frame that is far off put in place, and the delay at which the whole geometry leaves least."""
    theta = np.zeros(problem.size)
    training = np.flatnonzero(problem.samples.training)
    few = Problem(problem.kinematics, problem.samples.take(training[evenly(len(training), FEW)]))
    points = few.samples.points
    seen = np.isfinite(points).all(axis=2)
    said = few.kinematics.poses(few.samples.at(0.0)[0], theta[:-1]).points
    reach = float(np.median(np.linalg.norm(said[seen] - said[seen].mean(axis=0), axis=1)))
    off = float(np.median(np.linalg.norm(points[seen] - said[seen], axis=1)))
    if off > FAR * reach:
        theta[:6] = _placed(said[seen], points[seen], problem.kinematics.pivot)
    late = np.linspace(-LATEST, LATEST, DELAYS) * DELAY
    theta[-1] = min(late, key=lambda delay: (_left(few, theta, float(delay)), abs(delay)))
    return theta


def _placed(said: FloatArray, seen: FloatArray, pivot: FloatArray) -> FloatArray:
    """(6,): the turn and the place of a frame that lay points (N, 3) best upon others (Kabsch 1976), leaps left out."""
    rows = np.ones(len(said), dtype=np.bool_)
    turn, shift = Rotation.identity(), np.zeros(3)
    for _ in range(AGAIN):
        centre, there = said[rows].mean(axis=0), seen[rows].mean(axis=0)
        turn, _ = Rotation.align_vectors(seen[rows] - there, said[rows] - centre)
        shift = there - turn.apply(centre)
        left = np.linalg.norm(seen - turn.apply(said) - shift, axis=1)
        rows = left <= WILD * float(np.median(left)) / 2.0
    return np.concatenate([turn.as_rotvec(), turn.apply(pivot) + shift - pivot])


def _left(problem: Problem, start: FloatArray, delay: float) -> float:
    """What one step of least squares leaves at a delay."""
    theta = start.copy()
    theta[-1] = delay
    residual, slopes = problem.residual(theta), problem.place_slopes(theta)
    scale, usual = scales(residual, problem.turns), problem.usual[:-1]
    weights = np.where(np.abs(residual) < WILD * scale, scale**-2, 0.0)
    normal, pull = weighed(slopes, weights, residual)
    after = residual - slopes @ np.linalg.solve(normal + np.diag(usual**-2), pull)
    return float(scales(after, problem.turns)[0])


def _errors(problem: Problem, placed: Fit, fit: Fit, whole: Fit) -> dict[str, ToolError]:
    """Of each target, on held-out samples that were seen and do not leap."""
    base = problem.residual(np.zeros(problem.size))
    out = {}
    for k, name in enumerate(problem.samples.names):
        at, sigma = slice(3 * k, 3 * k + 3), float(whole.sigma[3 * k])
        distances = np.stack(
            [np.linalg.norm(r[:, at], axis=1) for r in (base, placed.residual, fit.residual)]
        )
        held = distances[:, ~problem.samples.training & np.isfinite(distances).all(axis=0)]
        typical = float(np.median(held[2])) if held.size else np.inf
        held = held[:, held[2] <= WILD * max(typical, sigma)]
        sizes = np.sqrt((held**2).mean(axis=1)).tolist() if held.size else [float("nan")] * 3
        out[name] = ToolError(before=sizes[0], placed=sizes[1], after=sizes[2], noise=sigma * 3.0**0.5)
    return out


def _told(
    problem: Problem, linear: Linear, chosen: Sequence[int], fit: Fit, error: dict[str, ToolError]
) -> Told:
    """In numbers: what is off, what would do as well in its place, and what cannot be told from others."""
    places = [GeometryPlace(p.kind, p.on, p.axis) for p in problem.kinematics.places]
    places.append(GeometryPlace("delay", "", ""))
    units = [*(place.unit for place in problem.kinematics.places), "s"]
    every = (*linear.nuisance, *chosen)
    sizes = dict(zip(every, linear.estimates(every)[1], strict=True))

    def instead(number: int) -> tuple[InPlaceOf, ...]:
        rest = [k for k in every if k != number]
        return tuple(
            InPlaceOf(
                place=places[c], value=float(linear.estimates([*rest, c])[0][-1]), unit=units[c], exact=exact
            )
            for c, exact in linear.instead(number, every)[:MOST]
        )

    found = []
    for i in (*chosen, *linear.told(chosen)):
        value, half = float(fit.theta[i]), NINETY * float(sizes[i])
        size = Estimate(value, value - half, value + half, units[i])
        found.append(GeometryFound(place=places[i], size=size, model=i in chosen, instead=instead(i)))
    return Told(
        targets=problem.samples.names,
        samples=len(problem.samples),
        lost=int((~fit.kept).sum()),
        held_out=int((~problem.samples.training).sum()),
        independent=linear.independent,
        found=tuple(found),
        error=error,
        inseparable=tuple(
            Inseparable(place=places[i], of=tuple(places[k] for k in of), weights=tuple(map(float, weights)))
            for i, of, weights in linear.inseparable()
        ),
    )
