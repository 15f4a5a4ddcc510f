"""Equivalents of a rough world's main effects: those of the same world without nuisances and without a rough log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gpsim.trials.blinding import Answer, even_recording
from gpsim.trials.rivals.equivalents import Rival, rivals
from gpsim.trials.truth import run
from gpsim.trials.worlds import World, effect_json, sound, world_json


def rough_rivals(answer: Answer) -> list[Rival]:
    """All that were fitted, the best first.

    The yardstick is the noise of the sensors, their steps and what the nuisances leave of a rollout: what changes less
    than that cannot be told.
    """
    world = main_world(answer)
    truth = run(world, world.effects)
    recording = even_recording(world, truth.clean, truth, np.asarray(sound(world, truth.sampled)))
    clean = [episode.states for episode in recording.episodes]
    content = {"world": world_json(world), "effects": [effect_json(e) for e in world.effects]}
    return rivals(Answer(content, clean, answer.own, answer.episode), recording)


def main_world(answer: Answer) -> World:
    """The world with its main effects alone, an even log, and noise that stands for all that was taken away."""
    world = answer.world
    steps = world.rough.quantum if world.rough else {}
    left = answer.content["machine" if world.machine else "rough"]["left"]
    noise = {
        n: float(np.sqrt(sd**2 + steps.get(n, 0.0) ** 2 / 12.0 + left.get(n, 0.0) ** 2))
        for n, sd in world.noise.items()
    }
    return replace(world, effects=world.main, rough=None, noise=noise)
