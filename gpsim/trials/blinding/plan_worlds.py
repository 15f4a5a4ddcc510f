"""Worlds for plans: the slow first recording, what a person states of the machine, and the machine as it is played."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.recordings import Recording
from gpsim.trials.blinding.concealment import answer_json
from gpsim.trials.blinding.logs import even_recording
from gpsim.trials.drawing import box_of, draw_plan, slow_waves
from gpsim.trials.truth import OneStep, run
from gpsim.trials.worlds import SYSTEMS, World, effect_json

LIMITS = "limits.json"  # beside the recording: what a plan has to keep to
FINE = 2e-3  # s, of the truth
MINUTES = 22.0 / 60.0  # two pieces of the default length


@dataclass(frozen=True)
class PlanConcealed:
    """A world that was recorded once. clean: as perfect sensors would have read it."""

    world: World
    recording: Recording
    clean: Recording
    one_step: OneStep | None = None

    @property
    def limits(self) -> dict[str, Any]:
        """What stands beside the recording."""
        return {"minutes": MINUTES, "box": box_of(self.world)}


@dataclass(frozen=True)
class Played:
    """Commands that were written down: (K, E, A)."""

    commands: FloatArray

    def command(self, k: int, measured: FloatArray) -> FloatArray:
        """(E, A)."""
        return np.asarray(self.commands[k])


def conceal_plan(seed: int, number: int) -> PlanConcealed:
    """Draw trial `number` of a seed, and record it."""
    world = draw_plan(seed, number)
    truth = run(world, world.effects, FINE, Played(slow_waves(world)[:, None]))
    recording, clean = (even_recording(world, r, truth, _whole(world)) for r in (truth.measured, truth.clean))
    return PlanConcealed(world, recording, clean)


def plan_answer(concealed: PlanConcealed, truth_digest: str) -> dict[str, Any]:
    """What answer.json says."""
    world = concealed.world
    effects = [effect_json(e) for e in world.effects]
    transitions = concealed.recording.transition_count
    return answer_json(world, effects, transitions, truth_digest, {"plan": concealed.limits})


def played(world: World, commands: FloatArray, box: Mapping[str, Any]) -> tuple[Recording, IntArray]:
    """The machine under commands (K, E, A), each from rest: an episode each; and (E,) steps until it left the box."""
    later = replace(world, steps=len(commands), episodes=commands.shape[1], session=1)
    truth = run(later, world.effects, FINE, Played(commands))
    low, high = np.array([box[name] for name in SYSTEMS[world.system].names]).T
    outside = ((truth.sampled < low) | (truth.sampled > high)).any(axis=2)
    left = np.where(outside.any(axis=0), np.argmax(outside, axis=0), len(commands))
    return even_recording(later, truth.measured, truth, _whole(later)), np.asarray(left)


def _whole(world: World) -> FloatArray:
    return np.full(world.episodes, world.steps + 1.0)
