"""What there is to know of a simulator before anybody records anything: plain data."""

from __future__ import annotations

import copy
import time
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gpsim.channels import FloatArray
from gpsim.effects import FAMILIES
from gpsim.mjcf.loading import notes_of
from gpsim.mjcf.optional import mujoco, quiet
from gpsim.mjcf.simulator import MjcfSimulator
from gpsim.simulators import Simulator

PLACES = 200  # random states at which what differs is compared
ALIKE = 0.98  # cosine of what two of them change, above which no recording tells them apart easily
NUDGE = 1e-3  # of a parameter
SECONDS = 1.0  # of free motion over which energy is watched
RUNS, STEPS = 64, 200  # simulations and their steps, by which speed is measured


@dataclass(frozen=True)
class Declared:
    """What a simulator declares, each name with its unit, parameters with their values; families by place.

    notes: what of a model is not as its file says.
    """

    name: str
    coordinates: dict[str, str]
    state: dict[str, str]
    actions: dict[str, str]
    parameters: dict[str, tuple[float, str]]
    families: dict[str, tuple[str, ...]]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Checked:
    """What was tried: the model's step [s], steps a processor second, energy, and what is hard to tell apart.

    control_step: [s], of the environment that the model is from (its frame skip times the step), None of a file.
    energy_drift: its largest change in a second of free motion, as a part of what moved; None: nothing did.
    """

    step: float
    control_step: float | None
    steps_a_second: float
    energy_drift: float | None
    confusable: tuple[tuple[str, str, float], ...]


def declared(simulator: Simulator) -> Declared:
    """What a simulator declares, and which families of the catalogue find a place in it."""
    return Declared(
        simulator.name,
        {c.name: c.force_unit for c in simulator.coordinates},
        simulator.state.units,
        simulator.action.units,
        {name: (p.default, p.unit) for name, p in simulator.parameters.items()},
        {f: places for f, effect in FAMILIES.items() if (places := effect.places(simulator))},
        notes_of(simulator.name),
    )


def checked(simulator: MjcfSimulator, rng: np.random.Generator) -> Checked:
    """What a MuJoCo model is like: speed, energy, and which parameters and laws change its motion alike."""
    told = _speed(simulator, rng), _energy_drift(simulator), _confusable(simulator, rng)
    return Checked(simulator.own_step, simulator.control_step, *told)


def _states(simulator: MjcfSimulator, count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Random states around the model's own, and commands, within their ranges."""
    state = np.tile(simulator.rest_state, (count, 1))
    moving = [simulator.state.index(n) for c in simulator.coordinates for n in (c.name, c.velocity)]
    state[:, moving] += 0.5 * rng.normal(size=(count, len(moving)))
    return state, 0.5 * rng.normal(size=(count, len(simulator.action)))


def _speed(simulator: MjcfSimulator, rng: np.random.Generator) -> float:
    state, action = _states(simulator, RUNS, rng)
    commands, step = np.repeat(action[:, None], STEPS, axis=1), np.full(RUNS, simulator.own_step)
    for some in (commands[:, :1], commands):  # once to make what is made once
        began = time.process_time()
        simulator.rolled((), simulator.defaults(), (), state, some, step, np.zeros(RUNS))
    return RUNS * STEPS / max(time.process_time() - began, 1e-9)


def _energy_drift(simulator: MjcfSimulator) -> float | None:
    """Free motion without damping, friction, motors and contacts keeps its energy; a coarse step does not."""
    mj, model = mujoco(), copy.copy(simulator.body.base)
    for bit in ("DAMPER", "ACTUATION", "CONTACT", "LIMIT", "FRICTIONLOSS"):
        model.opt.disableflags |= int(getattr(mj.mjtDisableBit, f"mjDSBL_{bit}"))
    data = mj.MjData(model)
    model.opt.enableflags |= int(mj.mjtEnableBit.mjENBL_ENERGY)
    data.qvel[:] = 1.0
    with quiet():
        mj.mj_forward(model, data)
    first, moving, most = float(data.energy.sum()), float(data.energy[1]), 0.0
    if moving <= 0.0:
        return None
    with quiet():
        for _ in range(round(SECONDS / simulator.own_step)):
            mj.mj_step(model, data)
            moving = max(moving, float(data.energy[1]))
            most = max(most, abs(float(data.energy.sum()) - first))
    return most / moving


def _confusable(simulator: MjcfSimulator, rng: np.random.Generator) -> tuple[tuple[str, str, float], ...]:
    """Pairs whose small changes accelerate alike wherever it is, the most alike first."""
    state, action = _states(simulator, PLACES, rng)
    believed = simulator.defaults()
    base = simulator.rates(state, action, believed)
    changes: dict[str, FloatArray] = {}
    for name, p in simulator.parameters.items():
        more = believed[name] + NUDGE * (p.additive or abs(believed[name]))
        changes[name] = simulator.rates(state, action, {**believed, name: more}) - base
    for i, action_name in enumerate(simulator.action.names):
        stronger = action.copy()
        stronger[:, i] *= 1.0 + NUDGE
        changes[f"gain of {action_name}"] = simulator.rates(state, stronger, believed) - base
    for i, coordinate in enumerate(simulator.coordinates):
        speed = state[:, simulator.state.index(coordinate.velocity)]
        laws = {"viscous friction": -speed, "Coulomb friction": -np.sign(speed)}
        for law, force in (laws | {"constant force": np.ones(PLACES)}).items():
            forces = np.zeros((PLACES, len(simulator.coordinates)))
            forces[:, i] = NUDGE * force
            changes[f"{law} on {coordinate.name}"] = simulator.rates(state, action, believed, forces) - base
    sized = {n: c.ravel() / s for n, c in changes.items() if (s := float(np.linalg.norm(c))) > 1e-12}
    pairs = [(a, b, abs(float(sized[a] @ sized[b]))) for a, b in combinations(sized, 2)]
    return tuple(sorted((p for p in pairs if p[2] > ALIKE), key=lambda p: -p[2]))
