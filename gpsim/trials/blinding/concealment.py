"""Concealing a world: the recording that a user would have of it, and the answer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings import Recording
from gpsim.trials.blinding.even_recordings import even_recording
from gpsim.trials.blinding.rough_worlds import RoughTruth, conceal_rough
from gpsim.trials.drawing import draw, rank_of
from gpsim.trials.truth import OneStep, Visibility, one_step, run, visibilities
from gpsim.trials.worlds import SYSTEMS, Run, World, effect_json, sound, world_json

SCHEMA = "gpsim.answer/1"
FEWEST, ATTEMPTS = 2000, 6
UNFILTERED = range(2026, 2029)  # published seeds: their true model did not know what differentiating does
SHORTEST = 40  # transitions: what an operator would keep of an episode that went wrong


@dataclass(frozen=True)
class Concealed:
    """A world that was run. clean: the recording as perfect sensors would have made it; one_step: of the true model.

    rough: what is true of a rough world besides, which has no visibilities.
    """

    world: World
    recording: Recording
    clean: Recording
    visible: list[Visibility]
    one_step: OneStep
    rough: RoughTruth | None = None


def conceal(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed. A world in which too little survives is drawn anew."""
    if rank_of(number) is not None:
        found = conceal_rough(seed, number)
        if found is None:
            raise UsageError(f"seed {seed}, trial {number}: no rough world could be made; take another seed")
        return Concealed(found.world, found.recording, found.clean, [], found.one_step, found.truth)
    for attempt in range(ATTEMPTS):
        world = draw(seed, number, attempt)
        truth = run(world, world.effects)
        n = truth.per_sample
        kept = sound(world, truth.fine[::n])
        kept = np.where(kept > SHORTEST, kept, 0)
        if np.maximum(kept - 1, 0).sum() >= FEWEST:
            recording = even_recording(world, truth.measured, truth, kept)
            clean = even_recording(world, truth.clean, truth, kept)
            known = clean
            if seed in UNFILTERED:
                bare = replace(world, velocities=world.velocities and "measured", wrapped=False)
                known = even_recording(bare, truth.clean, truth, kept)
            visible = visibilities(world, _shortened(truth, kept))
            return Concealed(world, recording, clean, visible, one_step(world, truth, recording, known, kept))
    raise UsageError(
        f"seed {seed}, trial {number}: no world could be run in {ATTEMPTS} attempts; take another seed"
    )


def answer_of(concealed: Concealed, truth_digest: str) -> dict[str, Any]:
    """What answer.json says."""
    world = concealed.world
    rough = concealed.rough
    effects = (
        [
            effect_json(effect)
            | {"share": seen.share, "rollout": min(seen.rollout, 1e6), "visible": seen.visible}
            for effect, seen in zip(world.effects, concealed.visible, strict=True)
        ]
        if rough is None
        else [effect_json(effect) for effect in world.effects]
    )
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
        **({} if rough is None else {"rough": rough.content(world)}),
    }


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
