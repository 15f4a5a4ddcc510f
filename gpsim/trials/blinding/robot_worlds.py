"""Concealing a robot's world: its recording and the model that is believed, and the answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.recordings import Recording
from gpsim.trials.blinding.concealment import SCHEMA
from gpsim.trials.robots import SHOWS, Files, draw_robot, files_of, recorded, run, shown, sound
from gpsim.trials.worlds import World, effect_json, world_json

FEWEST, ATTEMPTS = 2000, 24
SHORTEST = 60  # samples: what an operator would keep of an episode that went wrong


@dataclass(frozen=True)
class RobotConcealed:
    """A robot's world that was run. clean: as perfect sensors would have recorded it; shown: of every effect, in noise.

    files: the model as it is believed, published beside the recording.
    """

    world: World
    recording: Recording
    clean: Recording
    shown: list[float]
    files: Files


def conceal_robot(seed: int, number: int) -> RobotConcealed:
    """Draw and run trial `number` of a seed; anew where too little survives or an effect does not show."""
    for attempt in range(ATTEMPTS):
        world = draw_robot(seed, number, attempt)
        truth, free = run(world, world.effects)
        kept = sound(world, truth.sampled, free)
        kept = np.where(kept >= SHORTEST, kept, 0)
        if np.maximum(kept - 1, 0).sum() < FEWEST:
            continue
        seen = shown(world, truth, kept)
        if min(seen, default=SHOWS) >= SHOWS:
            recording, clean = (recorded(world, r, truth, kept) for r in (truth.measured, truth.clean))
            return RobotConcealed(world, recording, clean, seen, files_of(world.system))
    raise UsageError(
        f"seed {seed}, trial {number}: no world could be run in {ATTEMPTS} attempts; take another seed"
    )


def robot_answer(concealed: RobotConcealed, truth_digest: str) -> dict[str, Any]:
    """What answer.json says."""
    world = concealed.world
    return {
        "schema": SCHEMA,
        "seed": world.seed,
        "trial": world.number,
        "nonce": world.generator(4).bytes(16).hex(),
        "stratum": world.stratum,
        "long": False,
        "effects": [
            effect_json(effect) | {"rollout": round(min(seen, 1e6), 3), "visible": True}
            for effect, seen in zip(world.effects, concealed.shown, strict=True)
        ],
        "visible": True,
        "transitions": concealed.recording.transition_count,
        "robot": concealed.recording.model,
        "world": world_json(world),
        "truth_sha256": truth_digest,
    }
