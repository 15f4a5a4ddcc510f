"""What each explanation says of planned commands, at its estimate, beside it, and at draws of its parameters.

A plan may be played around a policy: each command is what that says of the sensors, plus a dither, within all limits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant, value_key
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting import Hypothesis, has_sensors, simulate, without_sensors
from gpsim.diagnosis.run import Run
from gpsim.effects import PRE_ROLL, Chain
from gpsim.posterior import Explanation
from gpsim.simulators import Simulator

Steer = Callable[[FloatArray], FloatArray]
"""steer(what the sensors say (B, S)) -> commands (B, A)."""
FAR = 1e6  # what a state that has run away is clipped to: out of any box, and its square is still a number
AFTERWARDS = 2**31  # number of an episode that comes after all others
NUDGE, SMALLEST = 0.5, 1e-4  # of a standard deviation, and of a typical size: a step of a finite difference


@dataclass(frozen=True)
class Around:
    """A policy and what may be commanded: low, high, idle (A,) in the commands' units, rate (A,) a second; dt: s."""

    steer: Steer
    low: FloatArray
    high: FloatArray
    rate: FloatArray
    idle: FloatArray
    dt: float

    def command(self, seen: FloatArray, dither: FloatArray, last: FloatArray) -> FloatArray:
        """(B, A): what is commanded where the sensors say `seen` (B, S), after the commands `last` (B, A)."""
        step = self.rate * self.dt
        wanted = np.clip(self.steer(seen) + dither, self.low, self.high)
        return np.clip(wanted, last - step, last + step)

    def driven(
        self,
        plant: EffectsPlant,
        hypothesis: Hypothesis,
        thetas: FloatArray,
        starts: FloatArray,
        dithers: FloatArray,
        begin: float,
        noise: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """(C, E, L + 1, S) twice: what the sensors would say, and the true states, of every copy under every dither.

        thetas: (C, P) of the hypothesis, whose corrected simulator `plant` is; starts: (C, S); dithers: (E, L, A);
        begin: s on the clock; noise: (S,) of what the policy is told, the same numbers in every call.
        """
        copies, several, steps = len(thetas), len(dithers), dithers.shape[1]
        rng, count = np.random.default_rng(0), copies * several
        memory = plant.begin(count, rng)
        for i, values in enumerate(hypothesis.spread(thetas, several)):
            memory |= {value_key(i, name): each for name, each in values.items()}
        memory["clock"] += begin
        state, last = np.repeat(starts, several, axis=0), np.tile(self.idle, (count, 1))
        true, said = np.empty((2, count, steps + 1, starts.shape[1]))
        with np.errstate(all="ignore"):  # what runs away is clipped, and safe it is not
            true[:, 0], said[:, 0] = state, plant.measure(state, memory, rng)
            for k in range(steps):
                seen = said[:, k] + noise * rng.standard_normal(state.shape) if noise.any() else said[:, k]
                last = self.command(seen, np.tile(dithers[:, k], (copies, 1)), last)
                state = _clip_diverged(plant.step(state, last, memory, rng))
                true[:, k + 1], said[:, k + 1] = state, _clip_diverged(plant.measure(state, memory, rng))
        shape = (copies, several, steps + 1, -1)
        return said.reshape(shape), true.reshape(shape)


def _clip_diverged(state: FloatArray) -> FloatArray:
    return np.clip(np.nan_to_num(state, nan=FAR), -FAR, FAR)


@dataclass(frozen=True)
class Machine:
    """The simulator that explanations correct. substeps: of a control step of dt [s] where the scheme is fine.

    around: the policy that steers it while a plan is played; None where its commands are played as they are.
    """

    simulator: Simulator
    parameters: Mapping[str, float]
    dt: float
    substeps: int
    run: Run
    around: Around | None = None

    def chain(self, hypothesis: Hypothesis) -> Chain:
        """What simulates an explanation."""
        return hypothesis.chain(self.simulator, self.parameters, self.dt)

    def steps(self, chain: Chain) -> int:
        """Of a control step."""
        if chain.closed is not None:
            return self.substeps
        return self.substeps * chain.refinement if chain.scheme == "fine" else 1


@dataclass(frozen=True)
class Model:
    """One explanation, simulated in C copies: the estimate, P beside it, then draws of the posterior.

    heard: (S,) standard deviation of the noise that a policy steers by; none where courses are compared.
    """

    machine: Machine
    explanation: Explanation
    nudges: FloatArray  # (P,)
    thetas: FloatArray  # (C, P)
    heard: FloatArray | float = 0.0

    @property
    def size(self) -> int:
        """How many parameters it has."""
        return len(self.nudges)

    def said(
        self, starts: FloatArray, actions: FloatArray, idle: FloatArray, begin: float
    ) -> tuple[FloatArray, FloatArray]:
        """(C, E, L + 1, S) twice: what the sensors would say, and the true states.

        starts: (C, S); actions: (E, L, A), each after a long time of `idle` commands (A,), or dithers of a policy's;
        begin: s on the clock.
        """
        if self.machine.around is not None:
            return self._steered(self.machine.around, starts, actions, begin)
        windows = _windows(starts, actions, idle, begin, self.machine.dt)
        everywhere = np.repeat(starts[:, None], len(actions), axis=1)
        hypothesis = self.explanation.hypothesis
        measured = self._simulated(hypothesis, windows, everywhere, self.thetas)
        if not has_sensors(hypothesis):
            return measured, measured
        kept = [
            np.full(len(group), t.effect.site != "sensor")
            for t, group in zip(hypothesis.terms, hypothesis.declared, strict=True)
        ]
        columns = np.concatenate(kept) if kept else np.empty(0, dtype=np.bool_)
        return measured, self._simulated(
            without_sensors(hypothesis), windows, everywhere, self.thetas[:, columns]
        )

    def _steered(
        self, around: Around, starts: FloatArray, dithers: FloatArray, begin: float
    ) -> tuple[FloatArray, FloatArray]:
        machine, hypothesis = self.machine, self.explanation.hypothesis
        how = (hypothesis.scheme, machine.substeps, machine.dt)
        plant = EffectsPlant(machine.simulator, machine.parameters, hypothesis.terms, *how)
        noise = np.broadcast_to(self.heard, starts.shape[1:])
        return around.driven(plant, hypothesis, self.thetas, starts, dithers, begin, noise)

    def _simulated(
        self, hypothesis: Hypothesis, windows: Windows, starts: FloatArray, thetas: FloatArray
    ) -> FloatArray:
        chain = self.machine.chain(hypothesis)
        steps = self.machine.steps(chain)
        return simulate(self.machine.run, chain, windows, starts, hypothesis.spread, thetas, steps)


def model_of(machine: Machine, explanation: Explanation, draws: int, rng: np.random.Generator) -> Model:
    """The estimate, a step beside it for each parameter, and draws."""
    hypothesis = explanation.hypothesis
    theta, deviation = hypothesis.theta, np.sqrt(np.diag(explanation.covariance))
    scales = np.array([p.scale for p in hypothesis.parameters])
    nudges = np.maximum(NUDGE * deviation, SMALLEST * scales)
    low, high = (np.array([getattr(p, edge) for p in hypothesis.parameters]) for edge in ("low", "high"))
    nudges = np.where(theta + nudges > high, -nudges, nudges)
    beside = np.clip(theta + np.diag(nudges), low, high) if theta.size else np.empty((0, 0))
    thetas = np.concatenate([theta[None], beside, explanation.drawn(rng, draws)])
    return Model(machine, explanation, nudges, thetas)


def drawn_model(
    machine: Machine, explanation: Explanation, draws: int, rng: np.random.Generator, heard: FloatArray
) -> Model:
    """Draws of the posterior alone, the estimate first among them."""
    theta = explanation.hypothesis.theta
    thetas = np.concatenate([theta[None], explanation.drawn(rng, max(draws - 1, 0))])
    return Model(machine, explanation, np.empty(0), thetas, heard)


def _windows(starts: FloatArray, actions: FloatArray, idle: FloatArray, begin: float, dt: float) -> Windows:
    count, steps = actions.shape[:2]
    start, t = np.median(starts, axis=0), begin + dt * np.arange(-PRE_ROLL, steps + 1)
    return Windows(
        np.tile(start, (count, steps + 1, 1)),
        actions,
        np.tile(t[PRE_ROLL:], (count, 1)),
        np.ones((count, steps + 1), dtype=np.bool_),
        np.tile(start, (count, PRE_ROLL, 1)),
        np.tile(idle, (count, PRE_ROLL, 1)),
        np.tile(t[: PRE_ROLL + 1], (count, 1)),
        np.full(count, AFTERWARDS),
        np.ones(count, dtype=np.bool_),
    )
