"""Multiple shooting: all parameters of a hypothesis at once, each window's start state eliminated.

Gauss-Newton on the windows' residuals (Bock 1981): the start states are projected out window by window, steps are
damped (Levenberg and Marquardt) and taken where the whole is better, start states where their window is. Dry friction
makes joint steps stall, so every round ends with a step of the start states alone. Residuals count in standard
deviations of the noise, which holds what a fit leaves, its correlation and the simulation's own error; samples far out
count less (Huber 1964). All costs are nats.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from gpsim.channels import BoolArray, FloatArray, IntArray
from gpsim.diagnosis.fitting.hypothesis import Coordinates, Hypothesis, coordinates
from gpsim.diagnosis.fitting.problem import Problem
from gpsim.effects import closed

STATE_STEP = 1e-5  # of a channel's size: by which start states are moved to see what that changes
STEP, STEP_OF_JUMPS = 1e-3, 0.03  # of a coordinate's scale: the same of parameters; of laws that jump
STEP_OF_DRY = 0.01  # of a coordinate's scale, where dry friction stops bodies
PATIENCE = 3  # rounds without a gain, each more cautious, after which start states alone stand
ATTEMPTS = 4  # steps of one round, each more cautious, before parameters stand still
ALONE = 6  # the same of start states of a robot: each costs a tenth of a round
TOLERANCE = 0.1  # a round that gains less ends a fit [nats]
OUTLYING = 4.0  # standard deviations beyond which a sample counts as one there, in absolute terms
LIFTS = (-2.0, -1.0, 1.0, 2.0)  # standard deviations by which the height of what stands is moved
CORE = 6.0  # robust standard deviations to which residuals are clipped where the noise is told


@dataclass(frozen=True)
class Noise:
    """What a residual counts by.

    white: (S,) standard deviation of each channel; times: (S,) by how much correlation makes a sample count less;
    weights: (W, L + 1, S) of samples, 0 where nothing was observed.
    """

    white: FloatArray
    times: FloatArray
    weights: FloatArray

    @property
    def whitening(self) -> FloatArray:
        """(W, L + 1, S) what a residual is multiplied by."""
        return np.asarray(self.weights / (self.white * np.sqrt(self.times)))

    @property
    def effective(self) -> float:
        """How many independent samples there are."""
        return float(((self.weights > 0).sum(axis=(0, 1)) / self.times).sum())


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to windows, or where its fit stands.

    z: (P,) its coordinates; starts: (W, S); residuals: (W, L + 1, S) in the channels' units, 0 where nothing counts;
    costs: (W,) nats under the noise; prior: nats; by_window: (W, P, P) each one's information on the coordinates, start
    states projected out, and gradients: (W, P), where slopes were last found.
    """

    hypothesis: Hypothesis
    z: FloatArray
    starts: FloatArray
    residuals: FloatArray
    costs: FloatArray
    prior: float
    noise: Noise
    by_window: FloatArray
    gradients: FloatArray

    @property
    def cost(self) -> float:
        """All of it [nats]."""
        return float(self.costs.sum()) + self.prior

    @property
    def information(self) -> FloatArray:
        """(P, P) the Hessian of the cost, with the prior's."""
        own = coordinates(self.hypothesis.parameters)
        return np.asarray(self.by_window.sum(axis=0) + np.diag(1.0 / own.prior**2))

    def learnt_from(self, windows: IntArray) -> Hypothesis:
        """The hypothesis as some of the windows alone say: one step from the whole, as a jackknife takes."""
        own = coordinates(self.hypothesis.parameters)
        held, of = 1.0 / own.prior**2, self.gradients
        back = held * (self.z - own.centre)
        information = self.by_window[windows].sum(axis=0) + np.diag(held)
        pull = of[windows].sum(axis=0) - back - (of.sum(axis=0) - back) * len(windows) / len(of)
        move = bounded_step(information, pull, 1e-9, self.z, own)
        return self.hypothesis.having(own.natural(np.clip(self.z + move, own.low, own.high)))


@dataclass(frozen=True)
class Slopes:
    """Whitened residual r (W, M), and its slopes by parameters (W, M, P) and by start states (W, M, N)."""

    r: FloatArray
    by_theta: FloatArray
    by_start: FloatArray

    def gram(self, damping: FloatArray | float = 1e-9) -> FloatArray:
        """(W, N, N) of the start states."""
        g = np.einsum("wmi,wmj->wij", self.by_start, self.by_start, optimize=True)
        diagonal = np.einsum("wii->wi", g)
        least = 1e-12 * diagonal.max(axis=1, keepdims=True) + np.finfo(float).tiny
        g += (np.reshape(damping, (-1, 1)) * diagonal + least)[:, :, None] * np.eye(g.shape[1])
        return np.asarray(g)

    def projected(
        self, damping: FloatArray | float = 1e-9
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Information (W, P, P) and gradients (W, P) with the start states eliminated; and their answers to either."""
        solve = np.linalg.solve(self.gram(damping), self.by_start.transpose(0, 2, 1))
        follow, alone = solve @ self.by_theta, (solve @ self.r[:, :, None])[:, :, 0]
        left = self.by_theta - self.by_start @ follow
        transposed = left.transpose(0, 2, 1)
        information = self.by_theta.transpose(0, 2, 1) @ left
        gradients = (transposed @ self.r[:, :, None])[:, :, 0]
        return information, gradients, follow, alone

    def off_starts(self, columns: FloatArray) -> FloatArray:
        """(W, M, K) columns with what start states could follow taken off."""
        fitted = np.linalg.solve(self.gram(), self.by_start.transpose(0, 2, 1) @ columns)
        return np.asarray(columns - self.by_start @ fitted)


class Shooting:
    """The windows of a problem under one noise model; every fit of a hypothesis to them."""

    def __init__(self, problem: Problem, noise: Noise | None = None) -> None:
        self.problem = problem
        shape = problem.windows.measured.shape
        self.base_weights = np.asarray(problem.root_weights, dtype=float) * np.ones(shape)
        self.noise = noise or Noise(np.maximum(problem.floor, 1e-300), np.ones(shape[2]), self.base_weights)
        self._nudges = STATE_STEP * problem.scale
        self._dear = closed(problem.simulator) is not None
        self._by_start: FloatArray | None = None

    # What a hypothesis leaves

    def residuals(self, hypothesis: Hypothesis, thetas: FloatArray, starts: FloatArray) -> FloatArray:
        """(C, W, L + 1, S) in the channels' units, unweighted but 0 where nothing counts."""
        return self.problem.gaps(hypothesis, thetas, starts)

    def costs(self, residual: FloatArray) -> FloatArray:
        """(..., W) half the sum of squares of residuals (..., W, L + 1, S) [nats]."""
        white = residual * self.noise.whitening
        out = 0.5 * np.einsum("...wls,...wls->...w", white, white)
        return np.asarray(np.where(np.isfinite(out), out, 1e30))

    def at(self, hypothesis: Hypothesis, starts: FloatArray) -> Fit:
        """A hypothesis as it is."""
        residual, costs = self._left(hypothesis, starts)
        own = coordinates(hypothesis.parameters)
        z, count = own.of(hypothesis.theta), len(starts)
        nothing = np.zeros((count, len(z), len(z))), np.zeros((count, len(z)))
        return Fit(hypothesis, z, starts, residual, costs, prior(own, z), self.noise, *nothing)

    def _left(self, hypothesis: Hypothesis, starts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(W, L + 1, S) residuals and (W,) costs with the hypothesis's own values."""
        residual = self.residuals(hypothesis, hypothesis.theta[None], starts[None])[0]
        return residual, self.costs(residual)

    def _where_less(
        self, hypothesis: Hypothesis, starts: FloatArray, at: tuple[FloatArray, ...], rows: BoolArray
    ) -> tuple[tuple[FloatArray, ...], BoolArray]:
        """Start states (W, S), residuals and costs, those of other starts in the rows that cost less so; and which."""
        less = np.zeros(len(rows), dtype=np.bool_)
        if not (some := np.flatnonzero(rows)).size:
            return at, less
        problem, before = self.problem.on(self.problem.windows.take(some)), at[2]
        residual = problem.gaps(hypothesis, hypothesis.theta[None], starts[some][None])[0]
        white = residual * self.noise.whitening[some]
        cost = 0.5 * np.einsum("wls,wls->w", white, white)
        less[some] = cost < before[some]
        at = tuple(own.copy() for own in at)
        for own, new in zip(at, (starts[some], residual, cost), strict=True):
            own[less] = new[less[some]]
        return at, less

    def counted(self, point: Fit) -> Fit:
        """The same place under the noise as it is now."""
        return replace(point, costs=self.costs(point.residuals), noise=self.noise)

    # Slopes

    def slopes(self, point: Fit, own: Coordinates | None = None, parameters: bool = True) -> Slopes:
        """By finite differences, all in one batch; coarser steps serve where only differences count.

        Where every simulation is dear, slopes by start states serve all fits: acceptance sees to the rest.
        """
        own = own or coordinates(point.hypothesis.parameters)
        n, p, rough = point.starts.shape[1], len(own.parameters) if parameters else 0, self.problem.slopes
        widths = step_sizes(point.hypothesis, own)
        widths = np.where(point.z + widths <= own.high, widths, -widths)[:p]
        steps = np.concatenate([self._nudges, widths])
        zs, copies = np.tile(point.z, (n + p, 1)), np.tile(point.starts, (n + p, 1, 1))
        copies[np.arange(n), :, np.arange(n)] += self._nudges[:, None]
        zs[n + np.arange(p), np.arange(p)] += widths
        before = point.residuals
        if rough is not self.problem:
            before = rough.gaps(point.hypothesis, own.natural(point.z[None]), point.starts[None])[0]
        first = 0 if self._by_start is None else n
        columns = np.zeros((n + p, *before.shape))
        if first < n + p:
            moved = rough.gaps(point.hypothesis, own.natural(zs[first:]), copies[first:])
            with np.errstate(all="ignore"):
                columns[first:] = (before - moved) / steps[first:, None, None, None]
        columns = np.nan_to_num(columns, nan=0.0, posinf=0.0, neginf=0.0)
        if self._by_start is not None:
            columns[:n] = self._by_start
        elif self._dear:
            self._by_start = columns[:n].copy()
        white = self.noise.whitening
        flat = (columns * white).reshape(n + p, len(point.starts), -1).transpose(1, 2, 0)
        r = (point.residuals * white).reshape(len(point.starts), -1)
        return Slopes(r, np.ascontiguousarray(flat[:, :, n:]), np.ascontiguousarray(flat[:, :, :n]))

    # Fits

    def fit(self, point: Fit, rounds: int = 8, tolerance: float = TOLERANCE, released: bool = True) -> Fit:
        """From a point to where nothing gains `tolerance` nats any more, in so many rounds at most.

        released: start states follow; else they stay where they are.
        """
        own = coordinates(point.hypothesis.parameters)
        held = np.diag(1.0 / own.prior**2)
        damping, per_window, still = 1e-3, np.full(len(point.starts), 1e-6), 0
        dry = released and any(getattr(t.effect, "dry", False) for t in point.hypothesis.terms)
        patience = PATIENCE if not len(own.parameters) else int(dry)
        for _ in range(rounds):
            slopes = self.slopes(point, own)
            if not released:
                slopes = replace(slopes, by_start=np.zeros_like(slopes.by_start))
            by_window, gradients, follow, alone = slopes.projected(per_window)
            information = by_window.sum(axis=0) + held
            pull = gradients.sum(axis=0) - held @ (point.z - own.centre)
            before = point.cost
            point = replace(point, by_window=by_window, gradients=gradients)
            for _attempt in range(ATTEMPTS):
                move = bounded_step(information, pull, damping, point.z, own)
                new, better = self._moved(point, own, point.z + move, alone + point.starts - follow @ move)
                per_window = np.where(
                    better, np.maximum(per_window / 5, 1e-9), np.minimum(per_window * 10, 10.0)
                )
                if new.cost < point.cost:
                    point, damping = new, max(damping / 5, 1e-7)
                    break
                damping = min(damping * 8, 1e6)
                if not len(move):
                    break
            if released:
                many = self._dear and (len(own.parameters) or rounds < ALONE)  # else rounds are attempts
                attempts = ALONE if many else 1
                point, per_window = self.starts_alone(point, slopes, per_window, attempts)
                point = self._lifted(point)
            still = still + 1 if before - point.cost < tolerance else 0
            if still > patience:
                break
            if still and dry:  # where friction lets go elsewhere the way on is another
                damping, per_window = 1e-3, np.full(len(point.starts), 1e-6)
        return point

    def _moved(
        self, point: Fit, own: Coordinates, z: FloatArray, starts: FloatArray
    ) -> tuple[Fit, BoolArray]:
        """The point at z, each window from its new start state or, where that is worse, its old one."""
        z = np.clip(z, own.low, own.high)
        moved = point.hypothesis.having(own.natural(z))
        residual, costs = self._left(moved, starts)
        better = costs <= point.costs + 1e-9
        at, _ = self._where_less(moved, point.starts, (starts, residual, costs), ~better)
        starts, residual, costs = at
        new = replace(
            point, hypothesis=moved, z=z, starts=starts, residuals=residual, costs=costs, prior=prior(own, z)
        )
        return new, better

    def starts_alone(
        self, point: Fit, slopes: Slopes, damping: FloatArray | float = 1e-6, attempts: int = 1
    ) -> tuple[Fit, FloatArray]:
        """A step of the start states with the parameters held, kept window by window; and the windows' damping then.

        attempts: in how many, each more cautious, a window has to find one that is better.
        """
        r = (point.residuals * self.noise.whitening).reshape(len(point.starts), -1)
        pull = slopes.by_start.transpose(0, 2, 1) @ r[:, :, None]
        done, cautious = np.zeros(len(point.starts), dtype=np.bool_), damping + np.zeros(len(point.starts))
        for _ in range(attempts):
            step = np.linalg.solve(slopes.gram(cautious), pull)[:, :, 0]
            point, better = self._where_better(point, point.starts + np.where(done[:, None], 0.0, step))
            less, more = np.maximum(cautious / 5, 1e-9), np.minimum(cautious * 10, 1e4)
            cautious = np.where(better, less, np.where(done, cautious, more))
            done |= better
        return point, cautious

    def _lifted(self, point: Fit) -> Fit:
        """What stands begins a little higher or lower where that is better: no slope tells where a foot will touch."""
        columns = self.problem.simulator.heights
        for column, times in product(columns, LIFTS):
            starts = point.starts.copy()
            starts[:, column] += times * self.noise.white[column]
            point, _ = self._where_better(point, starts)
        return point

    def _where_better(self, point: Fit, starts: FloatArray) -> tuple[Fit, BoolArray]:
        """The point with other start states (W, S) in the windows that cost less with them; and which these are."""
        now, other = (point.starts, point.residuals, point.costs), (starts != point.starts).any(axis=1)
        (starts, residual, costs), better = self._where_less(point.hypothesis, starts, now, other)
        return replace(point, starts=starts, residuals=residual, costs=costs), better

    # Noise

    def told_by(self, residual: FloatArray) -> None:
        """Set the noise to what a fit leaves (W, L + 1, S): never less than is known, more where that is correlated."""
        problem, seen = self.problem, self.problem.counted
        white, times = problem.floor.copy(), np.ones(len(problem.floor))
        weights = self.base_weights.copy()
        for i in np.flatnonzero(problem.observed):
            own = residual[..., i][seen[..., i]] if seen[..., i].any() else np.zeros(1)
            core = CORE * (1.4826 * float(np.median(np.abs(own)))) + 1e-300
            sd = float(np.sqrt(np.mean(np.minimum(own**2, core**2))))
            white[i] = max(problem.floor[i], sd, 1e-300)
            z = np.abs(residual[..., i]) / white[i]
            weights[..., i] *= np.sqrt(OUTLYING / np.maximum(z, OUTLYING))
            times[i] = correlated(residual[..., i] * weights[..., i], seen[..., i])
        self.noise = Noise(white, times, weights)


def prior(own: Coordinates, z: FloatArray) -> float:
    """Nats that sizes cost a priori."""
    return float(0.5 * (((z - own.centre) / own.prior) ** 2).sum()) if len(z) else 0.0


def step_sizes(hypothesis: Hypothesis, own: Coordinates) -> FloatArray:
    """(P,) by how much coordinates are moved to see their slopes."""
    shares = []
    for term, group in zip(hypothesis.terms, hypothesis.declared, strict=True):
        smooth = STEP_OF_DRY if getattr(term.effect, "dry", False) else STEP
        for p in group:
            jumps = p.falls or p.step is not None or len(p.starts) > 1
            shares.append(STEP_OF_JUMPS if jumps else smooth)
    return np.array(shares, dtype=float) * own.scale


def bounded_step(
    information: FloatArray, pull: FloatArray, damping: float, z: FloatArray, own: Coordinates
) -> FloatArray:
    """(P,) the damped step; what a bound would stop stands still and the others adapt."""
    move = np.zeros(len(z))
    if not len(z):
        return move
    diagonal = np.maximum(np.diag(information), np.finfo(float).tiny)
    scale = 1.0 / np.sqrt(diagonal)
    normal = information * scale[:, None] * scale + (damping + 1e-12) * np.eye(len(z))
    free = np.ones(len(z), dtype=bool)
    for _ in range(3):
        move[:] = 0.0
        at = np.flatnonzero(free)
        if not len(at):
            break
        move[at] = np.linalg.lstsq(normal[np.ix_(at, at)], (pull * scale)[at], rcond=1e-12)[0] * scale[at]
        stopped = free & (((z <= own.low) & (move < 0)) | ((z >= own.high) & (move > 0)))
        if not stopped.any():
            break
        free &= ~stopped
    return np.clip(z + move, own.low, own.high) - z


def correlated(residual: FloatArray, counted: BoolArray) -> float:
    """The integrated autocorrelation time of residuals (W, L + 1) within windows, at least 1 (Sokal 1997)."""
    power = float((residual**2).sum()) / max(float(counted.sum()), 1.0)
    total = 1.0
    for lag in range(1, residual.shape[1] // 2 + 1):
        pairs = counted[:, lag:] & counted[:, :-lag]
        rho = float((residual[:, lag:] * residual[:, :-lag] * pairs).sum()) / max(float(pairs.sum()), 1.0)
        rho /= max(power, 1e-300)
        if rho < 0.05:
            break
        total += 2.0 * rho
    return total


def fit(
    problem: Problem,
    hypothesis: Hypothesis,
    starts: FloatArray | None = None,
    rounds: int = 8,
    noise: Noise | None = None,
    tolerance: float = TOLERANCE,
) -> Fit:
    """A hypothesis fitted to a problem's windows, from its values and start states (W, S), those measured without any.

    noise: what residuals count by; without one it is told by what the fit leaves halfway.
    """
    shooting = Shooting(problem, noise)
    found = shooting.at(hypothesis, np.array(problem.windows.measured[:, 0] if starts is None else starts))
    if not len(problem.windows):
        return found
    if noise is None:
        shooting.told_by(found.residuals)
        found = shooting.fit(shooting.counted(found), max(rounds // 2, 1), tolerance)
        shooting.told_by(found.residuals)
        found = shooting.counted(found)
    return shooting.fit(found, rounds, tolerance)
