"""A plant is anything that a policy can drive in batches: a simulator, a corrected simulator or the target."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.simulators.simulator import Integrator, Simulator

Memory = dict[str, FloatArray]
"""What a plant remembers of the running episodes: arrays whose first axis is the batch."""


class Plant(Protocol):
    """Steps a batch of episodes; what an episode remembers is in `memory`, fresh from `begin` at each reset."""

    @property
    def state(self) -> Channels:
        """The state's channels."""
        ...

    @property
    def action(self) -> Channels:
        """The action's channels."""
        ...

    @property
    def dt(self) -> float:
        """The control step [s]."""
        ...

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """The memory of `count` new episodes."""
        ...

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, S): the next state; `memory` is changed in place."""
        ...

    def measure(self, state: FloatArray, memory: Memory, rng: np.random.Generator) -> FloatArray:
        """(B, S): what the sensors say of true states; policies see this, rewards do not.

        `state` is the one that `step` returned last, or an episode's first; asking twice changes nothing.
        """
        ...


def restart(memory: Memory, rows: BoolArray, fresh: Memory) -> None:
    """Put `fresh` (for rows.sum() episodes) in the place of the masked rows."""
    for key, values in memory.items():
        values[rows] = fresh[key]


def part_of(memory: Memory, prefix: str) -> Memory:
    """The views of one part's memory: what is kept under names that begin so, without the beginning."""
    return {key.removeprefix(prefix): values for key, values in memory.items() if key.startswith(prefix)}


@dataclass(frozen=True)
class SimulatorPlant:
    """A simulator with fixed parameters; it remembers nothing."""

    simulator: Simulator
    parameters: Mapping[str, float]
    integrator: Integrator
    dt: float

    @property
    def state(self) -> Channels:
        """The simulator's state channels."""
        return self.simulator.state

    @property
    def action(self) -> Channels:
        """The simulator's action channels."""
        return self.simulator.action

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Nothing to remember."""
        return {}

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """One control step with the action held."""
        dt = np.full(len(state), self.dt)
        return self.simulator.step(state, action, self.parameters, dt, self.integrator)

    def measure(self, state: FloatArray, memory: Memory, rng: np.random.Generator) -> FloatArray:
        """The state itself."""
        return state


@dataclass(frozen=True)
class RandomisedPlant(SimulatorPlant):
    """Domain randomisation: every episode draws each parameter uniformly within +-spread of its value.

    Tobin et al. (2017), "Domain randomization for transferring deep neural networks from simulation to the real
    world"; the thesis (section 4.5.1) uses spread 0.1. With `of` actions each episode draws a gain of each action
    instead (a simulator may have no parameters), with both those as well.
    """

    spread: float = 0.1
    of: Literal["parameters", "actions", "both"] = "parameters"

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """One draw (count,) of every parameter, of every action's gain, or of both."""
        parameters = {} if self.of == "actions" else self.parameters
        gains = {} if self.of == "parameters" else dict.fromkeys(map(_gain, self.action.names), 1.0)
        return {
            name: value * rng.uniform(1.0 - self.spread, 1.0 + self.spread, count)
            for name, value in {**parameters, **gains}.items()
        }

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """One control step under each episode's own draw."""
        dt = np.full(len(state), self.dt)
        if self.of != "parameters":
            action = np.column_stack([memory[_gain(name)] for name in self.action.names]) * action
        parameters = self.parameters if self.of == "actions" else memory
        return self.simulator.step(state, action, parameters, dt, self.integrator)


def _gain(action: str) -> str:
    return f"gain of {action}"
