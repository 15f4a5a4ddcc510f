"""Concealing a world: the recordings that a user would have of it, and the answer. Here: plain and rough worlds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings import Recording
from gpsim.trials.blinding.logs import even_recording, logged
from gpsim.trials.drawing import draw, draw_rough, rank_of, within
from gpsim.trials.outside import true_curve
from gpsim.trials.truth import OneStep, Shares, one_step, run, visibilities
from gpsim.trials.worlds import SYSTEMS, Run, World, effect_json, sound, world_json

Json = Mapping[str, Any]
SCHEMA = "gpsim.answer/1"
FEWEST, ATTEMPTS = 2000, 6
UNFILTERED = range(2026, 2029)  # published seeds: their true model did not know what differentiating does
ROUGH_ATTEMPTS = 60
SHORTEST = 40  # transitions: what an operator would keep of an episode that went wrong
ROUGH_FEWEST = 1500  # transitions before rows are lost
IMPORTANT, NEEDED = 0.08, 0.03  # of a main effect among nuisances; a little less than where it was drawn
FAR = 1e6  # standard deviations of the noise


@dataclass(frozen=True)
class Concealed:
    """A world that was run. recordings: as they were logged, of a machine perhaps several.

    clean: the first as perfect sensors would have made it, on an even clock and with every row; one_step: of the true
    model, None where nobody compares residual rates. beside: what the answer says of worlds of its kind; effects: of
    each effect besides what it is, nothing by default; rough: what decides on a rough world. files: the model that is
    believed, published beside the recordings; limits: what a plan has to keep to, published, too.
    """

    world: World
    recordings: tuple[Recording, ...]
    clean: Recording
    beside: Json
    effects: Sequence[dict[str, Any]] = ()
    one_step: OneStep | None = None
    visible: bool = True
    rough: Json | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    limits: Json | None = None

    @property
    def recording(self) -> Recording:
        """The first."""
        return self.recordings[0]

    def answer(self, truth_digest: str) -> dict[str, Any]:
        """What answer.json says."""
        world, facts = self.world, self.effects or [{}] * len(self.world.effects)
        said = {
            "schema": SCHEMA,
            "seed": world.seed,
            "trial": world.number,
            # Nobody can find the answer by hashing guesses of it.
            "nonce": world.generator(4).bytes(16).hex(),
            "stratum": world.stratum,
            "long": world.long,
            "effects": [effect_json(e) | more for e, more in zip(world.effects, facts, strict=True)],
            "visible": self.visible,
            "transitions": sum(r.transition_count for r in self.recordings),
            **self.beside,
            "world": world_json(world),
            "truth_sha256": truth_digest,
        }
        return said if self.rough is None else said | {"rough": self.rough}


def first_made(
    made: Callable[[int], Concealed | None], attempts: int, world: tuple[int, int], nothing: str
) -> Concealed:
    """What the first attempt made that made something; world: its seed and its number; nothing: what else is said."""
    for attempt in range(attempts):
        if (found := made(attempt)) is not None:
            return found
    raise UsageError(f"seed {world[0]}, trial {world[1]}: {nothing}; take another seed")


def long_enough(kept: FloatArray, shortest: int, fewest: int) -> FloatArray | None:
    """Samples (E,) of every episode, 0 of one that is too short to keep; None where too little is left of all."""
    kept = np.where(np.asarray(kept) > shortest, kept, 0)
    return None if np.maximum(kept - 1, 0).sum() < fewest else kept


def kept_of(world: World, truth: Run, fewest: int) -> FloatArray | None:
    """Samples (E,) of every episode that an operator would keep; None where too little survives."""
    return long_enough(sound(world, truth.sampled), SHORTEST, fewest)


def as_measured(world: World) -> World:
    """The same with velocities measured and angles as they are: what a log is made of."""
    return replace(world, velocities=world.velocities and "measured", wrapped=False)


def share_facts(world: World, shares: Shares) -> dict[str, Any]:
    """What decides: the channels that stand out of the noise, and what the main effects leave of the mismatch there.

    left: root mean square over rollouts of a second.
    """
    channels = [name for name, counts in zip(shares.seen, shares.counts, strict=True) if counts]
    return {"channels": channels, "left": shares.left(world.main)}


def log_facts(world: World, rows: Mapping[str, int]) -> dict[str, Any]:
    """What is wrong with a log, and how many of its rows have which defect."""
    return {"defects": list(world.rough.defects if world.rough else ()), "rows": dict(rows)}


def conceal(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed, plain or rough, anew until enough survives and counts."""
    if rank_of(number) is not None:
        nothing = "no rough world could be made"
        return first_made(
            lambda n: _rough(draw_rough(seed, number, n)), ROUGH_ATTEMPTS, (seed, number), nothing
        )
    nothing = f"no world could be run in {ATTEMPTS} attempts"
    return first_made(lambda n: _plain(draw(seed, number, n)), ATTEMPTS, (seed, number), nothing)


def _plain(world: World) -> Concealed | None:
    truth = run(world, world.effects)
    kept = kept_of(world, truth, FEWEST)
    if kept is None:
        return None
    recording, clean = (even_recording(world, r, truth, kept) for r in (truth.measured, truth.clean))
    known = clean
    if world.seed in UNFILTERED:
        known = even_recording(as_measured(world), truth.clean, truth, kept)
    seen = visibilities(world, _shortened(truth, kept))
    steps = one_step(world, truth, recording, known, kept)
    curve = true_curve(world, truth)
    return Concealed(
        world,
        (recording,),
        clean,
        {"one_step": _errors(world, steps)} | ({} if curve is None else {"curve": curve}),
        [{"share": v.share, "rollout": min(v.rollout, FAR), "visible": v.visible} for v in seen],
        steps,
        all(v.visible for v in seen),
    )


def _rough(world: World | None) -> Concealed | None:
    if world is None or world.rough is None:
        return None
    truth = run(world, world.effects)
    kept = kept_of(world, truth, ROUGH_FEWEST)
    if kept is None:
        return None
    found = Shares(world, truth, kept)
    main, nuisances = found.main(), [found.of(e) for e in world.effects if e.outside]
    if not found.counts.any() or not all(map(within, nuisances)):
        return None
    if not all(m.importance >= IMPORTANT and m.needed >= NEEDED for m in main):
        return None
    bare = as_measured(world)
    even, clean = (even_recording(bare, r, truth, kept) for r in (truth.measured, truth.clean))
    log = logged(world, world.rough, even)
    known = {n: sd for n, sd in even.noise.items() if n in found.seen}
    steps = one_step(bare, truth, even, clean, kept)
    decides = {
        "explained": found.explained(world.main),
        "main": [vars(share) for share in main],
        "nuisances": nuisances,
        **share_facts(world, found),
        **log_facts(world, log.counts),
    }
    recording = replace(log.recording, velocities=world.velocities, noise=known)
    beside = {"one_step": _errors(world, steps)}
    return Concealed(world, (recording,), clean, beside, one_step=steps, rough=decides)


def _errors(world: World, steps: OneStep) -> dict[str, dict[str, float]]:
    """Rate -> error of one step of the base simulator and of the true model."""
    return {
        rate: {"base": _rms(steps.base[:, i]), "own": _rms(steps.own[:, i])}
        for i, rate in enumerate(SYSTEMS[world.system].rates)
    }


def _shortened(truth: Run, kept: FloatArray) -> Run:
    """The run as far as every episode that was kept lasted."""
    count, rows = int(kept[kept > 0].min()), kept > 0
    samples = {name: getattr(truth, name)[:count, rows] for name in ("clean", "measured", "hidden", "free")}
    return replace(
        truth,
        fine=truth.fine[: (count - 1) * truth.per_sample + 1, rows],
        commands=truth.commands[: count - 1, rows],
        clock=truth.clock[rows],
        wall=truth.wall[rows],
        **samples,
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
