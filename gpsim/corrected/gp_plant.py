"""The corrected simulator: base rates plus what recordings have taught about them.

A Gaussian process as one function an episode: what is not known of a machine does not change from step to step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected.command_filter import CommandFilter, mean_rates
from gpsim.corrected.features import Features
from gpsim.effects import closed
from gpsim.simulators import Memory, SimulatorPlant

if TYPE_CHECKING:
    from gpsim.gp import DrawnFunctions, Predictor
    from gpsim.residuals import Residuals

Prediction = Literal["mean", "sample"]
PREDICTIONS: tuple[Prediction, ...] = ("mean", "sample")


class RateCorrection(Protocol):
    """Something added to the simulator's rates, held over a control step; it owns its memory."""

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """The memory of `count` new episodes."""
        ...

    def rates(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, R): added to the base rates."""
        ...


@dataclass(frozen=True)
class GpCorrection:
    """A Gaussian process per rate on features of (state, action): the thesis's correction (section 4.3.1).

    prediction `mean` adds the posterior mean; `sample` draws anew at every step, from the posterior of the function
    or, with sample_noise, from the predictive distribution of an observation (function plus Gaussian noise).
    """

    predictor: Predictor
    features: Features
    prediction: Prediction
    sample_noise: bool

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Draws are independent from step to step: nothing to remember."""
        return {}

    def rates(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, R) correction of the rates."""
        inputs = self.features(np.concatenate((state, action), axis=1))
        if self.prediction == "mean":
            return self.predictor.mean(inputs)
        return self.predictor.sample(inputs, rng, include_noise=self.sample_noise)


@dataclass(frozen=True)
class CorrectedPlant(SimulatorPlant):
    """A simulator whose rates are corrected; the correction is taken at the step's start and held over it.

    That is how residuals are defined: mean rates over a step at the state and action it starts from. With a filter,
    simulator and correction get the command that arrives, not the one that was sent.
    """

    correction: RateCorrection
    filter: CommandFilter | None = None

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """The correction's memory and the filter's."""
        memory = self.correction.begin(count, rng)
        if self.filter is not None:
            memory = memory | {f"filter/{k}": v for k, v in self.filter.begin(count).items()}
        return memory

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """One control step with action and correction held."""
        if self.filter is not None:
            own = {k.removeprefix("filter/"): v for k, v in memory.items() if k.startswith("filter/")}
            action = self.filter.step(action, own)
        extra = self.correction.rates(state, action, memory, rng)
        if (owner := closed(self.simulator)) is not None:  # it integrates by itself, the correction held
            count = owner.steps_of(self.dt)
            held, step = np.repeat(action[:, None], count, axis=1), np.full(len(state), self.dt / count)
            begun = np.zeros(len(state))
            return owner.rolled((), self.parameters, (), state, held, step, begun, extra)[:, -1]
        return self.simulator.integrate(
            state,
            lambda s: self.simulator.rates(s, action, self.parameters) + extra,
            np.full(len(state), self.dt),
            self.integrator,
        )


def arrived_inputs(plant: CorrectedPlant, data: Residuals) -> tuple[FloatArray, FloatArray]:
    """What the correction sees of recorded transitions, and what the filter alone changes of the rates.

    Returns state and arrived action (N, S + A), and the base's rates (N, R) under what arrived minus what was sent.
    """
    if plant.filter is None:
        return data.inputs, np.zeros_like(data.simulated)
    states, actions = np.split(data.inputs, [len(plant.state)], axis=1)
    arrived = plant.filter.arrived(actions, data.episode, data.t, data.over_gaps)
    return np.hstack([states, arrived]), mean_rates(plant, states, arrived) - data.simulated


@dataclass(frozen=True)
class FunctionCorrection:
    """Adds to the rates one of a few functions that were drawn from the posterior; every episode keeps its own."""

    functions: DrawnFunctions
    features: Features

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Which function each episode has."""
        return {"function": rng.integers(0, self.functions.count, count).astype(float)}

    def rates(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, R) correction of the rates."""
        return self.functions(self.features(np.concatenate((state, action), axis=1)), memory["function"])
