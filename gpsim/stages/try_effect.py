"""`gpsim effects check`: a law tried on batches, then found again in a world made with it, or what else explains it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known
from gpsim.effects import PLACE, Brought, Check, Place, Term, tried
from gpsim.errors import UsageError
from gpsim.recordings import Episode, Recording
from gpsim.simulators import SIMULATORS, Simulator, make_simulator

EPISODES, STEPS, HELD, DT, NOISE = 8, 120, 8, 0.02, 1e-3
PUSH = 3.0  # size of the commands, in their units
NEAR = 0.1  # of a size: what is found again


@dataclass(frozen=True)
class Recovered:
    """What a diagnosis says of a world made with an effect: true and found sizes, and the verdict.

    instead: what explains that world where the effect is not asked, and which share of the mismatch.
    """

    simulator: str
    on: str
    verdict: str
    said: tuple[str, ...]
    sizes: dict[str, tuple[float, float]]
    instead: tuple[str, ...]
    explained: float

    @property
    def right(self) -> bool:
        """Whether it is named alone, with sizes near the truth."""
        near = [abs(found - true) <= NEAR * abs(true) for true, found in self.sizes.values()]
        return self.verdict == "named" and len(self.said) == 1 and bool(near) and all(near)

    @property
    def confusable(self) -> bool:
        """Whether others explain that world nearly as well."""
        return self.explained > 0.95


def systems_for(brought: Brought, simulator: str | None) -> tuple[Simulator, str]:
    """A simulator that has a place for the effect, and that place: the one named, or the first registered one."""
    for name in (simulator,) if simulator else SIMULATORS:
        found = make_simulator(name)
        if places := brought.effect.places(found):
            return found, places[0]
    where = simulator or "no registered simulator"
    raise UsageError(f"{brought.reference}: {where} has no place for it; name another with --simulator")


def checks(brought: Brought, seed: int) -> Iterator[Check]:
    """What a law does on batches."""
    return tried(brought.effect, PLACE, np.random.default_rng(seed))


def world_with(
    brought: Brought, simulator: Simulator, on: str, seed: int
) -> tuple[Recording, dict[str, float]]:
    """A recording of the simulator with the effect, as strong as a fit of it starts, and those sizes."""
    values = {p.name: p.starts[0] for p in brought.effect.parameters(Place(on, "1"))}
    return made(simulator, Term(brought.effect.family, on, values), np.random.default_rng(seed)), values


def recovered(brought: Brought, simulator: Simulator, on: str, seed: int) -> Recovered:
    """Make a world with the effect, diagnose it with and without asking for it."""
    family = brought.effect.family
    recording, values = world_with(brought, simulator, on, seed)
    found, without = (
        diagnose(
            recording, simulator, simulator.defaults(), np.random.default_rng(seed), run=Run(known=known)
        ).diagnosis
        for known in (Known(also=(family,)), Known())
    )
    mine = [effect for effect in found.effects if effect.family == family]
    sizes = {name: (values[name], effect.parameters[name].value) for effect in mine for name in values}
    said, instead = (tuple(f"{e.family} on {e.place}" for e in one.effects) for one in (found, without))
    share = without.explained.rollout
    explained = 0.0 if share is None else share.share
    return Recovered(simulator.name, on, found.verdict, said, sizes, instead, explained)


def made(simulator: Simulator, term: Term, rng: np.random.Generator) -> Recording:
    """A recording of the simulator with one effect: commands of many levels, little noise."""
    parameters = simulator.defaults()
    plant = EffectsPlant(simulator, parameters, (term,), "fine", 2, DT)
    count, states = EPISODES, len(simulator.state)
    state = 0.3 * rng.normal(size=(count, states))
    memory = plant.begin(count, rng)
    actions = PUSH * np.repeat(rng.normal(size=(STEPS // HELD, count, len(simulator.action))), HELD, axis=0)
    seen = [plant.measure(state, memory, rng)]
    for action in actions:
        state = plant.step(state, action, memory, rng)
        seen.append(plant.measure(state, memory, rng))
    read = np.stack(seen)
    sd = NOISE * np.maximum(read.std(axis=(0, 1)), 1e-9)
    read = read + sd * rng.normal(size=read.shape)
    t = np.asarray(DT * np.arange(len(read)), dtype=np.float64)
    return Recording(
        system=simulator.name,
        parameters=parameters,
        integrator="rk4",
        dt=DT,
        state=simulator.state,
        action=simulator.action,
        episodes=tuple(Episode(str(e), t, read[:, e], actions[:, e]) for e in range(count)),
        noise=dict(zip(simulator.state.names, map(float, sd), strict=True)),
    )
