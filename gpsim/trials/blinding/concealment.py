"""Concealing a plain or rough world: the recording that a user would have of it, and the answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings import Recording
from gpsim.trials.blinding.logs import even_recording, logged
from gpsim.trials.drawing import draw, draw_rough, rank_of, within
from gpsim.trials.truth import (
    MainShare,
    OneStep,
    Shares,
    Visibility,
    one_step,
    run,
    true_curve,
    visibilities,
)
from gpsim.trials.worlds import SYSTEMS, Run, World, effect_json, sound, world_json

SCHEMA = "gpsim.answer/1"
FEWEST, ATTEMPTS = 2000, 6
UNFILTERED = range(2026, 2029)  # published seeds: their true model did not know what differentiating does
ROUGH_ATTEMPTS = 60
SHORTEST = 40  # transitions: what an operator would keep of an episode that went wrong
ROUGH_FEWEST = 1500  # transitions before rows are lost
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
class Concealed:
    """A world that was run. clean: the recording as perfect sensors would have made it; one_step: of the true model.

    rough: what is true of a rough world besides, which has no visibilities; its clean recording has an even clock and
    every row. curve: the law of a world that proves measured curves, as `truth.true_curve` has it.
    """

    world: World
    recording: Recording
    clean: Recording
    visible: list[Visibility]
    one_step: OneStep
    rough: RoughTruth | None = None
    curve: Mapping[str, Any] | None = None


def long_enough(kept: FloatArray, shortest: int, fewest: int) -> FloatArray | None:
    """Samples (E,) of every episode, 0 of one that is too short to keep; None where too little is left of all."""
    kept = np.where(np.asarray(kept) > shortest, kept, 0)
    return None if np.maximum(kept - 1, 0).sum() < fewest else kept


def answer_json(
    world: World,
    effects: Sequence[Mapping[str, Any]],
    transitions: int,
    truth_digest: str,
    beside: Mapping[str, Any],
    visible: bool = True,
) -> dict[str, Any]:
    """What answer.json says of any world; beside: what it says of its kind."""
    return {
        "schema": SCHEMA,
        "seed": world.seed,
        "trial": world.number,
        # Nobody can find the answer by hashing guesses of it.
        "nonce": world.generator(4).bytes(16).hex(),
        "stratum": world.stratum,
        "long": world.long,
        "effects": list(effects),
        "visible": visible,
        "transitions": transitions,
        **beside,
        "world": world_json(world),
        "truth_sha256": truth_digest,
    }


def conceal_rough(seed: int, number: int) -> Concealed | None:
    """Draw and run trial `number` of a seed until its effects are what they have to be; None: they never were."""
    for attempt in range(ROUGH_ATTEMPTS):
        world = draw_rough(seed, number, attempt)
        found = None if world is None else _concealed(world)
        if found is not None:
            return found
    return None


def as_measured(world: World) -> World:
    """The same with velocities measured and angles as they are: what a log is made of."""
    return replace(world, velocities=world.velocities and "measured", wrapped=False)


def _concealed(world: World) -> Concealed | None:
    truth = run(world, world.effects)
    kept = long_enough(sound(world, truth.sampled), SHORTEST, ROUGH_FEWEST)
    if world.rough is None or kept is None:
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
    return Concealed(
        world,
        recording,
        clean,
        [],
        one_step(bare, truth, even, clean, kept),
        RoughTruth(
            found.explained(world.main), main, nuisances, channels, found.left(world.main), log.counts
        ),
    )


def conceal(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed. A world in which too little survives is drawn anew."""
    if rank_of(number) is not None:
        found = conceal_rough(seed, number)
        if found is None:
            raise UsageError(f"seed {seed}, trial {number}: no rough world could be made; take another seed")
        return found
    for attempt in range(ATTEMPTS):
        world = draw(seed, number, attempt)
        truth = run(world, world.effects)
        kept = long_enough(sound(world, truth.sampled), SHORTEST, FEWEST)
        if kept is not None:
            recording = even_recording(world, truth.measured, truth, kept)
            clean = even_recording(world, truth.clean, truth, kept)
            known = clean
            if seed in UNFILTERED:
                known = even_recording(as_measured(world), truth.clean, truth, kept)
            visible = visibilities(world, _shortened(truth, kept))
            steps = one_step(world, truth, recording, known, kept)
            return Concealed(world, recording, clean, visible, steps, curve=true_curve(world, truth))
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
    steps = {
        rate: {"base": _rms(concealed.one_step.base[:, i]), "own": _rms(concealed.one_step.own[:, i])}
        for i, rate in enumerate(SYSTEMS[world.system].rates)
    }
    visible, transitions = (
        all(seen.visible for seen in concealed.visible),
        concealed.recording.transition_count,
    )
    beside = {"one_step": steps} | ({} if concealed.curve is None else {"curve": dict(concealed.curve)})
    said = answer_json(world, effects, transitions, truth_digest, beside, visible)
    return said if rough is None else said | {"rough": rough.content(world)}


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
