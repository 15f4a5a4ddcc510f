"""Concealing a rough world: its log, and of the truth what decides the right verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.recordings import Recording
from gpsim.trials.blinding.even_recordings import even_recording
from gpsim.trials.blinding.rough_logs import logged
from gpsim.trials.drawing import draw_rough, within
from gpsim.trials.truth import MainShare, OneStep, Shares, one_step, run
from gpsim.trials.worlds import World, sound

ATTEMPTS = 60
SHORTEST = 40  # transitions: what an operator would keep of an episode that went wrong
FEWEST = 1500  # transitions before rows are lost
IMPORTANT, NEEDED = 0.08, 0.03  # of a main effect among nuisances; a little less than where it was drawn


@dataclass(frozen=True)
class RoughTruth:
    """explained: the share of the mismatch that the main effects explain; main, nuisances: each one's own.

    channels: those in which the mismatch stands out of the noise; left: channel -> how much the main effects leave of
    it, root mean square over rollouts of a second; counts: rows of the log that have a defect.
    """

    explained: float
    main: tuple[MainShare, ...]
    nuisances: tuple[float, ...]
    channels: tuple[str, ...]
    left: Mapping[str, float]
    counts: Mapping[str, int]

    def content(self, world: World) -> dict[str, Any]:
        """What answer.json says of it."""
        return {
            "explained": self.explained,
            "main": [vars(share) for share in self.main],
            "nuisances": list(self.nuisances),
            "channels": list(self.channels),
            "left": dict(self.left),
            "defects": list(world.rough.defects if world.rough else ()),
            "rows": dict(self.counts),
        }


@dataclass(frozen=True)
class RoughConcealed:
    """A rough world that was run; clean: on an even clock, every row there, without noise."""

    world: World
    recording: Recording
    clean: Recording
    one_step: OneStep
    truth: RoughTruth


def conceal_rough(seed: int, number: int) -> RoughConcealed | None:
    """Draw and run trial `number` of a seed until its effects are what they have to be; None: they never were."""
    for attempt in range(ATTEMPTS):
        world = draw_rough(seed, number, attempt)
        found = None if world is None else _concealed(world)
        if found is not None:
            return found
    return None


def as_measured(world: World) -> World:
    """The same with velocities measured and angles as they are: what a log is made of."""
    return replace(world, velocities=world.velocities and "measured", wrapped=False)


def _concealed(world: World) -> RoughConcealed | None:
    truth = run(world, world.effects)
    kept = np.asarray(sound(world, truth.sampled))
    kept = np.where(kept > SHORTEST, kept, 0)
    if world.rough is None or np.maximum(kept - 1, 0).sum() < FEWEST:
        return None
    found = Shares(world, truth, kept)
    main = tuple(found.main())
    nuisances = tuple(found.of(e) for e in world.effects if e.outside)
    if not found.counts.any() or not all(map(within, nuisances)):
        return None
    if not all(m.importance >= IMPORTANT and m.needed >= NEEDED for m in main):
        return None
    bare = as_measured(world)
    even = even_recording(bare, truth.measured, truth, kept)
    clean = even_recording(bare, truth.clean, truth, kept)
    log = logged(world, world.rough, even)
    known = {n: sd for n, sd in even.noise.items() if n in found.seen}
    recording = replace(log.recording, velocities=world.velocities, noise=known)
    channels = tuple(name for name, counts in zip(found.seen, found.counts, strict=True) if counts)
    return RoughConcealed(
        world,
        recording,
        clean,
        one_step(bare, truth, even, clean, kept),
        RoughTruth(
            found.explained(world.main), main, nuisances, channels, found.left(world.main), log.counts
        ),
    )
