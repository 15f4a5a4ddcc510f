"""What a diagnosis of a whole robot is worth besides its names: held-out rollouts, and what its bodies weigh together.

Inertial parameters of neighbouring bodies do the same to the joints in many motions (base parameters: Gautier 1991). So
bodies that were changed are judged by the torques that they ask for along the true motion, too: in place of the true
changes others are right that ask for the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.mjcf import in_its_columns, open_simulator
from gpsim.recordings import read_recording
from gpsim.trials.blinding import PUBLIC, Answer
from gpsim.trials.rivals.held_out_rollouts import rollouts_over_truth
from gpsim.trials.rivals.kept import as_true, in_short, kept_or_made
from gpsim.trials.robots import body_torques, joint_torques, motion_of, run_whole, sound
from gpsim.trials.worlds import TrueEffect, World

VERSION = 1  # of the rules: raise it whenever something else may come of them
Json = Mapping[str, Any]


@dataclass(frozen=True)
class WholeListing:
    """rollouts: channel -> error over the refitted truth's; bodies_off: the torque that the changed bodies ask for.

    That is off by so much of what the true changes ask for, root mean square over the joints, each in its own torque.
    """

    rollouts: Mapping[str, float]
    bodies_off: float


def whole_listing(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> WholeListing:
    """The listing of a revealed diagnosis, from OUT/equivalents or made now and kept there."""
    said = [] if report is None else list(report["effects"])
    follows_from = {
        "whole_version": VERSION,
        "answer_sha256": outcome["answer_sha256"],
        "recording": outcome["recording"],
        "said": list(map(in_short, said)),
    }

    def make() -> dict[str, Any]:
        world, effects = answer.world, list(map(as_true, said))
        held = [] if report is None else [str(n) for n in report["fit"]["held_out"]]
        return {
            "rollouts": {} if report is None else _rollouts(out / PUBLIC / name, world, held, effects),
            "bodies_off": bodies_off(world, effects),
        }

    kept = kept_or_made(out, name, follows_from, make)
    rollouts = {k: float("inf") if v is None else float(v) for k, v in kept["rollouts"].items()}
    return WholeListing(rollouts, float(kept["bodies_off"]))


def _rollouts(
    public: Path, world: World, held: Sequence[str], said: Sequence[TrueEffect]
) -> Mapping[str, float]:
    published = read_recording(public)
    simulator = open_simulator(str(public / str(published.model)))
    recording = in_its_columns(published, simulator)
    return rollouts_over_truth(recording, simulator, held, world.effects, said)


def bodies_off(world: World, said: Sequence[TrueEffect]) -> float:
    """How far the torques are off that the bodies ask for: 0 where nothing is missing, 1 where nothing was said."""
    truth = run_whole(world)
    motion = motion_of(world, truth, np.asarray(sound(world, truth)))
    scale = np.maximum(joint_torques(world, motion), 1e-12)
    wanted, found = (body_torques(world.system, effects, motion) / scale for effects in (world.effects, said))
    return float(np.sqrt(((found - wanted) ** 2).sum() / max(float((wanted**2).sum()), 1e-300)))
