"""The simulator corrected by named effects (and a Gaussian process on what is left), as a plant that policies drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.corrected import RateCorrection
from gpsim.effects import Term
from gpsim.effects.chain import Chain, Scheme
from gpsim.effects.term import from_json, to_json
from gpsim.errors import UsageError
from gpsim.simulators import Simulator
from gpsim.simulators.plant import Memory
from gpsim.simulators.simulator import INTEGRATORS

SCHEMA = "gpsim.corrected/1"


@dataclass(frozen=True)
class EffectsPlant:
    """Base simulator plus terms: every episode of the batch has its own memory (delays, lags, time since its start).

    States are the true ones; `measure` says what the corrected sensors make of them. Terms that began inside the
    recording (`since`) act from the start: they describe the system as it is now.
    """

    simulator: Simulator
    parameters: Mapping[str, float]
    terms: tuple[Term, ...]
    scheme: Scheme
    substeps: int
    dt: float
    correction: RateCorrection | None = None

    @property
    def state(self) -> Channels:
        """The simulator's state channels."""
        return self.simulator.state

    @property
    def action(self) -> Channels:
        """The simulator's action channels."""
        return self.simulator.action

    @cached_property
    def chain(self) -> Chain:
        """What steps it."""
        return Chain(self.simulator, self.parameters, self.terms, self.scheme, self.dt)

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Actuators at rest, clocks at zero."""
        memory = {f"effects/{k}": v for k, v in self.chain.rest(count, self._step).items()}
        memory["clock"] = np.full(count, self._latest)
        if self.correction is not None:
            memory |= {f"gp/{k}": v for k, v in self.correction.begin(count, rng).items()}
        return memory

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, S): the true state after one control step."""
        count = len(state)
        effects = {k.removeprefix("effects/"): v for k, v in memory.items() if k.startswith("effects/")}
        values = [{k: np.full(count, v) for k, v in term.values.items()} for term in self.terms]
        extra = None
        if self.correction is not None:
            own = {k.removeprefix("gp/"): v for k, v in memory.items() if k.startswith("gp/")}
            extra = self.correction.rates(state, action, own, rng)
        step = np.full(count, self._step)
        for _ in range(round(self.dt / self._step)):
            now = memory["clock"]
            command = self.chain.command(action, state, values, effects, step, now)
            state = self.chain.advance(state, command, values, step, now, extra)
            memory["clock"] += step
        return state

    def measure(self, state: FloatArray, rng: np.random.Generator) -> FloatArray:
        """(B, S): what the corrected sensors say, their delays and noise left out."""
        still = Chain(
            self.simulator,
            self.parameters,
            tuple(t for t in self.terms if t.family != "sensor_delay"),
            self.scheme,
            self.dt,
        )
        values = [{k: np.full(len(state), v) for k, v in term.values.items()} for term in still.terms]
        return still.measure(state, values, {}, np.full(len(state), self.dt))

    @property
    def _step(self) -> float:
        return self.dt / (self.substeps * self.chain.refinement if self.scheme == "fine" else 1)

    @property
    def _latest(self) -> float:
        """The clock at an episode's start: late enough for every onset to have passed."""
        return max((t.gate.since for t in self.terms if t.gate.since is not None), default=0.0)


def describe(plant: EffectsPlant, gp: bool) -> dict[str, Any]:
    """corrected.json: everything but the Gaussian process itself."""
    return {
        "schema": SCHEMA,
        "simulator": plant.simulator.name,
        "parameters": dict(plant.parameters),
        "dt": plant.dt,
        "scheme": plant.scheme,
        "substeps": plant.substeps,
        "terms": [to_json(term) for term in plant.terms],
        "gp": gp,
    }


def plant_from(
    data: Mapping[str, Any], simulator: Simulator, correction: RateCorrection | None = None
) -> EffectsPlant:
    """The inverse of `describe`; raises UsageError."""
    try:
        if data["schema"] != SCHEMA:
            raise UsageError(f"corrected.json: schema '{data['schema']}', expected {SCHEMA}")
        if data["scheme"] not in ("fine", *INTEGRATORS):
            raise UsageError(
                f"corrected.json: scheme '{data['scheme']}' is not one of fine, {', '.join(INTEGRATORS)}"
            )
        return EffectsPlant(
            simulator,
            simulator.defaults(data["parameters"]),
            tuple(from_json(term) for term in data["terms"]),
            data["scheme"],
            int(data["substeps"]),
            float(data["dt"]),
            correction,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise UsageError(
            f"corrected.json: not a corrected simulator that this version reads ({error!r})"
        ) from error
