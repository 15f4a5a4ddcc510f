"""States from noisy observations, some of them lost: an extended Kalman smoother around a corrected simulator.

Differences of noisy states are rates with the noise over the step. The smoother (Rauch, Tung and Striebel 1965) asks
instead which states the simulator could have passed through, if its rates were off by so much each step. Slopes are
taken over a standard deviation of the noise, not at a point: across a jump, as of friction, a point has none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import BoolArray, FloatArray, difference
from gpsim.corrected.gp_plant import CorrectedPlant, GpCorrection
from gpsim.recordings import Episode
from gpsim.simulators import Memory, SimulatorPlant

TINY = 1e-9  # of the noise: keeps covariances invertible where nothing is unsure


@dataclass(frozen=True)
class _Off:
    """Rates that are off by `off` (B, R) beside what a correction adds."""

    off: FloatArray
    beside: GpCorrection | None

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        return {}

    def rates(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        known = 0.0 if self.beside is None else self.beside.rates(state, action, memory, rng)
        return np.asarray(self.off + known)


@dataclass(frozen=True)
class Smoother:
    """How states follow each other, and how sure that is.

    noise: (S,) standard deviation of an observation; spread: (R,) of what the rates are off by in a control step;
    swing: (A,) of a command that nobody knows.
    """

    base: SimulatorPlant
    correction: GpCorrection | None
    noise: FloatArray
    spread: FloatArray
    swing: FloatArray

    def __call__(self, episode: Episode) -> tuple[Episode, BoolArray]:
        """The episode without gaps, and of each of its transitions whether the command is known.

        A lost sample takes its command along; the last one may still stand, or any other.
        """
        place = np.rint((episode.t - episode.t[0]) / self.base.dt).astype(np.int64)
        count = int(place[-1])
        row = np.searchsorted(place, np.arange(count), side="right") - 1
        actions, known = episode.actions[row], place[row] == np.arange(count)
        seen = np.full((count + 1, len(self.noise)), np.nan)
        seen[place] = episode.states
        states = self._smoothed(seen, actions, known)
        return Episode(
            episode.name, episode.t[0] + self.base.dt * np.arange(count + 1), states, actions
        ), known

    def _smoothed(self, seen: FloatArray, actions: FloatArray, known: BoolArray) -> FloatArray:
        """(K + 1, S) from observations (K + 1, S), NaN where there is none."""
        unsure = np.diag(self.noise**2)
        means, covariances = [seen[0]], [unsure]
        ahead: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        for k, action in enumerate(actions):
            swing = np.zeros_like(self.swing) if known[k] else self.swing
            mean, slope, pushed = self._step(means[-1], action, swing)
            covariance = slope @ covariances[-1] @ slope.T + pushed @ pushed.T + TINY * unsure
            ahead.append((mean, covariance, slope))
            if np.isfinite(seen[k + 1]).all():
                gain = np.linalg.solve(covariance + unsure, covariance).T
                mean = mean + gain @ difference(seen[k + 1], mean, self.base.state)
                covariance = covariance - gain @ covariance
            means.append(mean)
            covariances.append(0.5 * (covariance + covariance.T))
        out = [means[-1]]
        for k in range(len(actions) - 1, -1, -1):
            mean, covariance, slope = ahead[k]
            back = np.linalg.solve(covariance, slope @ covariances[k]).T
            out.append(means[k] + back @ difference(out[-1], mean, self.base.state))
        return np.array(out[::-1])

    def _step(
        self, state: FloatArray, action: FloatArray, swing: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The next state (S,), its slopes by the state (S, S), and what is pushed into it (S, R + A).

        That is what a standard deviation of each rate makes, and of each command.
        """
        size, rates, commands = len(self.noise), len(self.spread), len(swing)
        shifts = np.zeros((1 + 2 * (size + rates + commands), size + rates + commands))
        ups = np.diag(np.concatenate([self.noise, self.spread, swing]))
        shifts[1 : 1 + len(ups)], shifts[1 + len(ups) :] = ups, -ups
        moved, off, other = np.split(shifts, [size, size + rates], axis=1)
        base = self.base
        plant = CorrectedPlant(
            base.simulator, base.parameters, base.integrator, base.dt, _Off(off, self.correction)
        )
        after = plant.step(state + moved, action + other, {}, np.random.default_rng(0))
        effect = 0.5 * difference(after[1 : 1 + len(ups)], after[1 + len(ups) :], base.state).T
        return after[0], effect[:, :size] / self.noise, effect[:, size:]
