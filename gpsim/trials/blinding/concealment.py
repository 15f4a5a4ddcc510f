"""Concealing a world: the recording that a user would have of it, and the answer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from gpsim.channels import Channels, FloatArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.trials.drawing import draw
from gpsim.trials.truth import OneStep, Visibility, one_step, run, visibilities
from gpsim.trials.worlds import SYSTEMS, Run, World, effect_json, sound, world_json

SCHEMA = "gpsim.answer/1"
FEWEST, ATTEMPTS = 2000, 6
UNFILTERED = range(2026, 2029)  # published seeds: their true model did not know what differentiating does
SHORTEST = 40  # transitions: what an operator would keep of an episode that went wrong


@dataclass(frozen=True)
class Concealed:
    """A world that was run. clean: the recording as perfect sensors would have made it; one_step: of the true model."""

    world: World
    recording: Recording
    clean: Recording
    visible: list[Visibility]
    one_step: OneStep


def conceal(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed. A world in which too little survives is drawn anew."""
    for attempt in range(ATTEMPTS):
        world = draw(seed, number, attempt)
        truth = run(world, world.effects)
        n = truth.per_sample
        kept = sound(world, truth.fine[::n])
        kept = np.where(kept > SHORTEST, kept, 0)
        if np.maximum(kept - 1, 0).sum() >= FEWEST:
            recording = _recording(world, truth.measured, truth, kept)
            clean = _recording(world, truth.clean, truth, kept)
            known = clean
            if seed in UNFILTERED:
                bare = replace(world, velocities=world.velocities and "measured", wrapped=False)
                known = _recording(bare, truth.clean, truth, kept)
            visible = visibilities(world, _shortened(truth, kept))
            return Concealed(world, recording, clean, visible, one_step(world, truth, recording, known, kept))
    raise UsageError(
        f"seed {seed}, trial {number}: no world could be run in {ATTEMPTS} attempts; take another seed"
    )


def answer_of(concealed: Concealed, truth_digest: str) -> dict[str, Any]:
    """What answer.json says."""
    world = concealed.world
    effects = [
        effect_json(effect)
        | {"share": seen.share, "rollout": min(seen.rollout, 1e6), "visible": seen.visible}
        for effect, seen in zip(world.effects, concealed.visible, strict=True)
    ]
    return {
        "schema": SCHEMA,
        "seed": world.seed,
        "trial": world.number,
        # Nobody can find the answer by hashing guesses of it.
        "nonce": world.generator(4).bytes(16).hex(),
        "stratum": world.stratum,
        "long": world.long,
        "effects": effects,
        "visible": all(seen.visible for seen in concealed.visible),
        "transitions": concealed.recording.transition_count,
        "one_step": {
            rate: {"base": _rms(concealed.one_step.base[:, i]), "own": _rms(concealed.one_step.own[:, i])}
            for i, rate in enumerate(SYSTEMS[world.system].rates)
        },
        "world": world_json(world),
        "truth_sha256": truth_digest,
    }


def _recording(world: World, readings: FloatArray, truth: Run, kept: FloatArray) -> Recording:
    """The readings (K + 1, E, S) as a user would have them."""
    system = SYSTEMS[world.system]
    state = Channels.of(system.state, ("yaw",) if system.vehicle else ())
    episodes: list[Episode] = []
    for e in np.flatnonzero(kept):
        count = int(kept[e])
        states = readings[:count, e].copy()
        if world.velocities == "differentiated":
            states[:, 1::2] = _differentiated(states[:, 0::2], world)
        if system.vehicle and world.wrapped:
            states[:, 2] = wrap_angle(states[:, 2])
        t = world.clock_offsets[e] + world.dt * np.arange(count)
        episodes.append(Episode(str(len(episodes)), np.round(t, 9), states, truth.commands[: count - 1, e]))
    held_out = None
    if world.held_out is not None:
        held_out = HeldOut(episodes_from=round(0.8 * len(episodes)))
    noise = {
        n: sd
        for i, (n, sd) in enumerate(world.noise.items())
        if world.noise_known and not (world.velocities == "differentiated" and i % 2)
    }
    return Recording(
        system=world.system,
        state=state,
        action=Channels.of(system.action),
        episodes=tuple(episodes),
        dt=world.dt,
        parameters=world.parameters,
        integrator=world.integrator,
        velocities=world.velocities,
        clock=world.clock,
        noise=noise,
        held_out=held_out,
    )


def _differentiated(positions: FloatArray, world: World) -> FloatArray:
    """(K + 1, C) velocities as users make them of positions."""
    if world.smoothing == "savgol":
        return np.asarray(savgol_filter(positions, 7, 2, deriv=1, delta=world.dt, axis=0))
    return np.asarray(np.gradient(positions, world.dt, axis=0))


def _shortened(truth: Run, kept: FloatArray) -> Run:
    """The run as far as every episode that was kept lasted."""
    count = int(kept[kept > 0].min())
    rows = kept > 0
    n = truth.per_sample
    return Run(
        truth.fine[: (count - 1) * n + 1, rows],
        truth.h,
        truth.commands[: count - 1, rows],
        truth.clean[:count, rows],
        truth.measured[:count, rows],
        truth.hidden[:count, rows],
        truth.clock[rows],
        truth.wall[rows],
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
