"""Concealing a robot's world, with one or two effects or as a whole robot: its recording, its model, the answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from gpsim.channels import FloatArray
from gpsim.errors import UsageError
from gpsim.recordings import Recording
from gpsim.trials.blinding.concealment import answer_json, long_enough
from gpsim.trials.blinding.logs import logged
from gpsim.trials.robots import (
    SHOWS,
    Files,
    draw_robot,
    draw_whole,
    files_of,
    motion_of,
    recorded,
    run,
    run_whole,
    shares_of,
    shown,
    sound,
    whole_rank,
)
from gpsim.trials.worlds import Rough, Run, TrueEffect, World, effect_json

FEWEST, ATTEMPTS = 2000, 24
SHORTEST = 59  # transitions: what an operator would keep of an episode that went wrong
MOST = 1e6  # standard deviations of the noise, which is far off


@dataclass(frozen=True)
class RobotConcealed:
    """A robot's world that was run. clean: as perfect sensors would have recorded it, on an even clock and every row.

    shown: of every effect, in noise; of a whole robot its share of the joint's torque, None of commands. files: the
    model as it is believed, published beside the recording. rows: of the log with a defect.
    """

    world: World
    recording: Recording
    clean: Recording
    shown: Sequence[float | None]
    files: Files
    rows: dict[str, int]


class Kept(NamedTuple):
    """A robot's run, the samples (E,) of every episode that were kept, and the recordings as read and without noise."""

    truth: Run
    samples: FloatArray
    recording: Recording
    clean: Recording


Ran = tuple[Run, FloatArray]


def kept_run(
    world: World, fewest: int, driven: Callable[[World], Ran], shortest: int = SHORTEST
) -> Kept | None:
    """None where too little survives; driven: what runs a world, and says how long nothing touched."""
    truth, free = driven(world)
    samples = long_enough(sound(world, truth.sampled, free), shortest, fewest)
    if samples is None:
        return None
    recording, clean = (recorded(world, read, truth, samples) for read in (truth.measured, truth.clean))
    return Kept(truth, samples, recording, clean)


def with_effects(world: World) -> Ran:
    """Run a world of few effects."""
    return run(world, world.effects)


def conceal_robot(seed: int, number: int) -> RobotConcealed:
    """Draw and run trial `number` of a seed; anew where too little survives or an effect does not show."""
    made = _concealed if whole_rank(number) is None else _whole
    for attempt in range(ATTEMPTS):
        found = made(seed, number, attempt)
        if found is not None:
            return found
    raise UsageError(
        f"seed {seed}, trial {number}: no world could be run in {ATTEMPTS} attempts; take another seed"
    )


def _concealed(seed: int, number: int, attempt: int) -> RobotConcealed | None:
    world = draw_robot(seed, number, attempt)
    kept = kept_run(world, FEWEST, with_effects)
    if kept is None:
        return None
    seen = shown(world, kept.truth, kept.samples)
    if min(seen, default=SHOWS) < SHOWS:
        return None
    return RobotConcealed(world, kept.recording, kept.clean, seen, files_of(world.system), {})


def _whole(seed: int, number: int, attempt: int) -> RobotConcealed | None:
    world = draw_whole(seed, number, attempt)
    kept = kept_run(world, FEWEST, run_whole)
    if kept is None:
        return None
    log = logged(world, world.rough or Rough(), kept.recording)
    rows = {name: count for name, count in log.counts.items() if count}
    shares = shares_of(world, motion_of(world, kept.truth, kept.samples))
    return RobotConcealed(world, log.recording, kept.clean, shares, files_of(world.system), rows)


def robot_answer(concealed: RobotConcealed, truth_digest: str) -> dict[str, Any]:
    """What answer.json says."""
    world, model = concealed.world, concealed.recording.model
    effects = [_of_effect(world, e, s) for e, s in zip(world.effects, concealed.shown, strict=True)]
    beside: dict[str, Any] = {"robot": model}
    if world.stratum == "whole":
        defects = list(world.rough.defects if world.rough else ())
        beside = {"whole": {"model": model, "defects": defects, "rows": concealed.rows}}
    return answer_json(world, effects, concealed.recording.transition_count, truth_digest, beside)


def _of_effect(world: World, effect: TrueEffect, size: float | None) -> dict[str, Any]:
    if world.stratum == "whole":
        return effect_json(effect) | {"share": None if size is None else round(size, 6), "visible": True}
    return effect_json(effect) | {"rollout": round(min(size or 0.0, MOST), 3), "visible": True}
