"""A fit under way, round by round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.fitting.gauss_newton import damped_step, jacobians, promised_gain
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.pattern_search import FIRST_DAMPING, searched_pattern
from gpsim.diagnosis.fitting.point import Point, point_at
from gpsim.diagnosis.fitting.problem import Problem, variance_of
from gpsim.diagnosis.fitting.steps import stepped, stepped_dearly
from gpsim.effects import closed

MANY_PARAMETERS = 12
"""Parameters of which the slopes serve as long (by hand: all of a robot's own at once, which are fitted for
comparison)."""
PATIENCE = 4  # rejected steps in a row, each more cautious, before a fit is taken to stand still
PATIENCE_OF_STARTS = 2  # the same where only start states are fitted
DAMPING_SHRINKS = 5.0  # divides the damping after an accepted step
DAMPING_GROWS = 8.0  # multiplies the damping after a rejected step
MOST_DAMPING = 1e6  # damping at most
LEAST_DAMPING = 1e-9  # damping at least, as long as steps are accepted
NO_DAMPING = 1e-14
"""Damping at least where a step without any promises more: what a rejected step can still multiply."""
PATTERN_ROUNDS = (1, 3, 5, 8)  # steps before which places of a law that jumps are looked for far and near
NEAR_BY = (1.5, 1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.1, 0.06, 0.04, 0.02, 0.01)  # near places of both patterns
FIRST_PATTERN = (
    12.0, 11.5, 11.0, 10.5, 10.0, 9.5, 9.0, 8.5, 8.0, 7.5, 7.0, 6.5, 6.0, 5.5, 5.0, 4.5, 4.0, 3.5, 3.0, 2.5, 2.0,
    *NEAR_BY,
)  # fmt: skip
"""Distances to either side that are looked at the first time: a threshold's valley may be as narrow as a step [of a
parameter's own finite-difference steps]."""
PATTERN = (12.0, 8.0, 6.0, 4.0, 3.0, 2.0, *NEAR_BY)
"""Distances that are looked at later [of a parameter's own finite-difference steps]."""


class Descent:
    """Where a fit stands, the slopes there, how much its steps are damped, and for how many rounds it stood still.

    A round searches thresholds, looks which way is down, and steps.
    """

    def __init__(
        self,
        problem: Problem,
        hypothesis: Hypothesis,
        starts: FloatArray,
        *,
        near: bool,
        known: FloatArray | None,
    ) -> None:
        """From the hypothesis's values and the start states (W, S); near and known as `fit` takes them."""
        self.problem, self.hypothesis, self.near, self.known = problem, hypothesis, near, known
        bounds = np.array([(p.low, p.high) for p in hypothesis.parameters], dtype=float).reshape(-1, 2)
        self.low, self.high = bounds[:, 0], bounds[:, 1]
        theta = np.clip(hypothesis.theta, self.low, self.high)
        residual = problem.residuals(hypothesis, theta[None], starts[None])[0]
        self.at = point_at(problem, theta, np.array(starts), residual)
        self.damping, self.least = FIRST_DAMPING, LEAST_DAMPING
        self.per_window = np.full(len(starts), self.damping)
        self.moved, self.still = True, 0
        self.seen_from: FloatArray | None = None
        self.by_state = np.empty(0) if known is None else known
        self.by_theta = np.empty(0)
        self.dear = closed(problem.simulator) is not None

    def search(self, round_: int) -> None:
        """In some rounds: thresholds of laws that jump, far and near."""
        rounds = PATTERN_ROUNDS
        if self.near or round_ not in rounds or not any(p.step for p in self.hypothesis.parameters):
            return
        first = round_ == rounds[0]
        pattern = np.array(FIRST_PATTERN if first else PATTERN)
        slopes = self.by_state if self.dear and self.by_state.size else None
        self.at = searched_pattern(
            self.problem, self.hypothesis, self.at, pattern, self.low, self.high, self.per_window, slopes
        )

    def look(self, round_: int) -> None:
        """The slopes where it stands; after a rejected step it stands where it stood."""
        if self.seen_from is self.at.residual:
            return
        serves = self.moved and (
            self.known is not None if round_ == 0 else bool(round_ % self.problem.every_slope)
        )
        enough = self.at.theta.size >= MANY_PARAMETERS
        if not (serves and self.by_theta.size and enough):
            at = self.at
            self.by_state, self.by_theta = jacobians(
                self.problem,
                self.hypothesis,
                at.theta,
                at.starts,
                at.residual,
                by_state=self.by_state if serves else None,
            )
        self.seen_from = self.at.residual

    def step(self) -> float:
        """One damped step, taken where it is better; what it gains [nats], less than nothing where it is not taken."""
        problem, hypothesis, at = self.problem, self.hypothesis, self.at
        variance = variance_of(problem, at.residual)
        step = damped_step(
            problem, at.residual, self.by_state, self.by_theta, variance, self.damping, self.per_window,
            at.theta, self.low, self.high,
        )  # fmt: skip
        if self.dear:
            new, self.moved, own, anchored = stepped_dearly(
                problem, hypothesis, at, step, self.low, self.high
            )
        else:
            # After a rejected step of theta, and where there is none, the start states may have to go alone.
            alone = not (self.moved and at.theta.size)
            new, self.moved, own, anchored = stepped(
                problem, hypothesis, at, step, self.low, self.high, alone=alone
            )
        gain = at.value - new.value
        shrinks, grows, most = (
            DAMPING_SHRINKS,
            DAMPING_GROWS,
            MOST_DAMPING,
        )
        self.per_window = np.clip(
            np.where(own, self.per_window / shrinks, self.per_window * grows), self.least, most
        )
        damping = self.damping / shrinks if self.moved else self.damping * grows
        self.damping = float(np.clip(damping, self.least, most))
        if self.dear and gain > 0:
            self._learn(at, new)
        self.at = new if gain > 0 else replace(at, anchored=anchored)
        return gain

    def _learn(self, before: Point, after: Point) -> None:
        """Slopes that agree with what a step changed, window by window (Broyden 1965): they serve several rounds.

        Not in windows where they foresaw next to nothing of it: something jumped there.
        """
        by_start = after.starts - before.starts
        by_theta = after.theta - before.theta
        foreseen = np.einsum("wlsi,wi->wls", self.by_state, by_start) + self.by_theta @ by_theta
        missed = after.residual - before.residual - foreseen
        seen, scale = self.problem.observed, self.problem.scale
        sizes = np.array([p.scale for p in self.hypothesis.parameters])
        weight = ((by_start / scale) ** 2).sum(axis=1) + ((by_theta / sizes) ** 2).sum()
        small, large = (
            ((part[..., seen] / scale[seen]) ** 2).sum(axis=(1, 2)) for part in (missed, foreseen)
        )
        good = (small < large) & (weight > 0.0)
        share = np.where(good, 1.0 / np.where(good, weight, 1.0), 0.0)[:, None, None]
        missed = np.where(good[:, None, None], missed, 0.0) * share
        self.by_state = self.by_state + missed[..., None] * (by_start / scale**2)[:, None, None, :]
        if by_theta.size:
            self.by_theta = self.by_theta + missed[..., None] * (by_theta / sizes**2)

    def stands(self, gain: float, tolerance: float) -> bool:
        """Whether it is at its end, after a step that gained this much [nats]; if not for sure, damping is given up.

        Where one channel is known far better than another, a little damping may be all that holds it.
        """
        at = self.at
        patience = PATIENCE if at.theta.size else PATIENCE_OF_STARTS
        self.still = 0 if gain >= tolerance else self.still + 1
        if self.still < (1 if self.moved else patience):
            return False
        promised = promised_gain(
            self.problem, at.residual, self.by_state, self.by_theta, at.theta, self.low, self.high
        )
        if self.least < LEAST_DAMPING or promised < tolerance:
            return True
        self.least, self.still = NO_DAMPING, 0
        self.damping, self.per_window = self.least, np.full(len(at.starts), self.least)
        return False
