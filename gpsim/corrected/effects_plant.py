"""The simulator corrected by named effects (and a Gaussian process on what is left), as a plant that policies drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gpsim.channels import BoolArray, Channels, FloatArray
from gpsim.corrected.gp_plant import RateCorrection
from gpsim.effects import (
    PRE_ROLL,
    Chain,
    ForceEffect,
    Measured,
    Scheme,
    Term,
    VehicleEffect,
    from_json,
    origins,
    to_json,
)
from gpsim.errors import UsageError
from gpsim.recordings import Recording
from gpsim.simulators import INTEGRATORS, Memory, Simulator, part_of, restart

SCHEMA = "gpsim.corrected/1"


@dataclass(frozen=True)
class EffectsPlant:
    """Base simulator plus terms: every episode of the batch has its own memory (delays, lags, late sensors, its age).

    States are the true ones; `measure` says what the corrected sensors make of them, as late as they are. Terms that
    began inside the recording (`since`) act from the start, whether its clock ran on over the episodes or began anew in
    each: they describe the system as it is now. Onsets and ages are moments of the clock that the diagnosis looked at,
    0 at the start of a recording whose own was set long before; an episode that is driven shares nothing with it but
    its age.

    ages: s. What changes with time by itself, a battery, goes by an episode's age: drawn anew for every episode,
    uniformly from these, the first and the last moment at which an episode of the recording began.
    """

    simulator: Simulator
    parameters: Mapping[str, float]
    terms: tuple[Term, ...]
    scheme: Scheme
    substeps: int
    dt: float
    correction: RateCorrection | None = None
    ages: tuple[float, float] = (0.0, 0.0)

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
        begun = tuple(replace(t, gate=t.gate.opened) for t in self.terms)
        return Chain(self.simulator, self.parameters, begun, self.scheme, self.dt)

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Actuators at rest, clocks at the episodes' ages, sensors that have seen nothing."""
        memory = {f"effects/{k}": np.repeat(v, count, axis=0) for k, v in self._rested.items()}
        memory |= {f"bristles/{k}": v for k, v in self.chain.unbent(count).items()}
        memory["clock"] = self._drawn_ages(count, rng)
        if self.chain.sensors.remember:
            memory |= {f"seen/{k}": v for k, v in self._still(np.zeros((count, len(self.state)))).items()}
            memory["met"] = np.zeros(count)
        if self.correction is not None:
            memory |= {f"gp/{k}": v for k, v in self.correction.begin(count, rng).items()}
        return memory

    def step(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, S): the true state after one control step."""
        count, chain, several = len(state), self.chain, round(self.dt / self._step)
        effects, bends = part_of(memory, "effects/"), part_of(memory, "bristles/")
        values, seen, step = (
            self._values(count, memory),
            self._seen(state, memory),
            np.full(count, self._step),
        )
        extra = None
        if self.correction is not None:
            extra = self.correction.rates(state, action, part_of(memory, "gp/"), rng)
        # What gates of commands look at happens on the way.
        if chain.closed is not None and not chain.actuation.looks:
            begin = memory["clock"].copy()
            held = np.repeat(action[:, None], several, axis=1), np.repeat(state[:, None], several + 1, axis=1)
            times = np.full((count, several), self._step), begin[:, None] + self._step * np.arange(several)
            commands = chain.commands(*held, values, effects, *times)
            path = chain.rolled(chain.closed, state, commands, values, step, begin, extra, bends)
            for k in range(several if chain.sensors.remember else 0):
                chain.sensors.watch(path[:, k], values, seen, step)
            memory["clock"] += several * self._step
            return path[:, -1]
        for _ in range(several):
            now = memory["clock"]
            command = chain.command(action, state, values, effects, step, now)
            state = chain.advance(state, command, values, step, now, extra, bends)
            memory["clock"] += step
            chain.sensors.watch(state, values, seen, step)
        return state

    def measure(self, state: FloatArray, memory: Memory, rng: np.random.Generator) -> FloatArray:
        """(B, S): what the corrected sensors say, their noise left out."""
        count = len(state)
        return self.chain.sensors.measure(
            state, self._values(count, memory), self._seen(state, memory), np.full(count, self._step)
        )

    def extrapolates(self, state: FloatArray, action: FloatArray) -> BoolArray:
        """(B,) whether a measured curve is asked where its recording never was, so that what it says is a guess."""
        found = np.zeros(len(state), dtype=bool)
        for term in self.terms:
            if isinstance(term.effect, Measured):
                found |= term.effect.shape.outside(*self._asked_of(term, state, action))
        return found

    def _asked_of(self, term: Term, state: FloatArray, action: FloatArray) -> tuple[FloatArray, ...]:
        """(B,) each: what the curve of a term is a function of."""
        effect, simulator = term.effect, self.simulator
        if isinstance(effect, ForceEffect):
            (coordinate,) = (c for c in simulator.coordinates if c.name == term.on)
            name = coordinate.name if term.variant == "position" else coordinate.velocity
            return (state[:, simulator.state.index(name)],)
        if isinstance(effect, VehicleEffect):
            rates = simulator.rates(state, action, self.parameters)
            return rates[:, simulator.rate.index("v")], rates[:, simulator.rate.index("w")]
        if term.on in simulator.action.names:
            return (action[:, simulator.action.index(term.on)],)
        return (state[:, simulator.state.index(term.on)],)

    @cached_property
    def _rested(self) -> Memory:
        """What the actuators of one episode remember before it: no command, for as long as the diagnosis looks back.

        A bias in front of a lag has arrived by then. Where gates look at the state nothing is known yet: at rest.
        """
        chain, step = self.chain, self._step
        rest = chain.actuation.rest(1, step)
        if not chain.actuation or chain.actuation.looks:
            return rest
        count = PRE_ROLL * round(self.dt / step)
        settled = {key: values.copy() for key, values in rest.items()}
        nothing, still = np.zeros((1, count, len(self.action))), np.zeros((1, count + 1, len(self.state)))
        steps, t = np.full((1, count), step), np.zeros((1, count))
        said = chain.commands(nothing, still, self._values(1), settled, steps, t)
        return settled if said.any() else rest

    def _values(self, count: int, memory: Memory | None = None) -> list[dict[str, FloatArray]]:
        """Of each term its values (count,): those that the memory holds of an episode are the episode's own."""
        drawn = memory or {}
        return [
            {k: drawn.get(value_key(i, k), np.full(count, v)) for k, v in term.values.items()}
            for i, term in enumerate(self.terms)
        ]

    def _seen(self, state: FloatArray, memory: Memory) -> Memory:
        """What the sensors remember; those of a new episode have seen its first state only, standing still."""
        seen = part_of(memory, "seen/")
        if seen and not memory["met"].all():
            new = memory["met"] == 0.0
            restart(seen, new, self._still(state[new]))
            memory["met"][new] = 1.0
        return seen

    def _still(self, state: FloatArray) -> Memory:
        """The memory of sensors that have long looked at a state (B, S)."""
        back, count = self.chain.sensors.reach(self._values(1), np.array([self._step])), len(state)
        history, step = np.repeat(state[:, None], back, axis=1), np.full(count, self._step)
        return self.chain.sensors.begin(history, self._values(count), step)

    @property
    def youngest(self) -> float:
        """The least age [s] of an episode; a drift that began inside the recording is no younger than its onset."""
        onsets = [t.gate.since or 0.0 for t in self.terms if t.effect.drifts]
        return max(self.ages[0], *onsets) if onsets else 0.0

    def _drawn_ages(self, count: int, rng: np.random.Generator) -> FloatArray:
        """(count,) s."""
        if not any(t.effect.drifts for t in self.terms):
            return np.zeros(count)
        youngest = self.youngest
        oldest = max(self.ages[1], youngest)
        return rng.uniform(youngest, oldest, count) if oldest > youngest else np.full(count, youngest)

    @property
    def _step(self) -> float:
        return self.dt / (self.substeps * self.chain.refinement if self.scheme == "fine" else 1)


def value_key(term: int, name: str) -> str:
    """Under what an episode's memory may hold its own value of a parameter, which a plant of draws puts there."""
    return f"values/{term}/{name}"


def ages_of(recording: Recording) -> tuple[float, float]:
    """The first and the last moment [s] of a recording's clock at which an episode began."""
    starts = [float(episode.t[0]) for episode in recording.episodes]
    return min(starts), max(starts)


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
        **({"effects": brought} if (brought := origins(term.family for term in plant.terms)) else {}),
        "ages": list(plant.ages),
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
        low, high = data.get("ages", (0.0, 0.0))  # earlier versions knew none
        return EffectsPlant(
            simulator,
            simulator.defaults(data["parameters"]),
            tuple(from_json(term) for term in data["terms"]),
            data["scheme"],
            int(data["substeps"]),
            float(data["dt"]),
            correction,
            (float(low), float(high)),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise UsageError(
            f"corrected.json: not a corrected simulator that this version can read ({error!r})"
        ) from error
