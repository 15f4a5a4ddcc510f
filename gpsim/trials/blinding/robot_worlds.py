"""Concealing robots, with the model that is believed: few effects, whole ones, afloat, an arm as a machine."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from gpsim.channels import FloatArray
from gpsim.recordings import Recording
from gpsim.trials.blinding.concealment import FAR, SHORTEST, Concealed, first_made, log_facts, long_enough
from gpsim.trials.blinding.logs import logged
from gpsim.trials.robots import (
    SHOWS,
    afloat_rank,
    draw_afloat,
    draw_arm,
    draw_robot,
    draw_whole,
    files_of,
    kept_afloat,
    motion_of,
    recorded,
    run,
    run_afloat,
    run_whole,
    shares_of,
    shown,
    shown_afloat,
    sound,
    whole_rank,
)
from gpsim.trials.worlds import Rough, Run, World

FEWEST, ATTEMPTS = 2000, 24
ROBOTS_SHORTEST = 59  # transitions: what an operator would keep of an episode that went wrong
ARMS_FEWEST = 4  # effects of an arm that show


class _Kept(NamedTuple):
    """A robot's run, the samples (E,) of every episode that were kept, and the recordings as read and without noise."""

    truth: Run
    samples: FloatArray
    recording: Recording
    clean: Recording


def _kept(
    world: World, truth: Run, fewest: int, shortest: int, ends: FloatArray | None = None
) -> _Kept | None:
    """None where too little survives; ends: (E,) samples before each episode went wrong, by default those of an arm."""
    samples = long_enough(sound(world, truth) if ends is None else ends, shortest, fewest)
    if samples is None:
        return None
    recording, clean = (recorded(world, read, truth, samples) for read in (truth.measured, truth.clean))
    return _Kept(truth, samples, recording, clean)


def conceal_robot(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed; anew where too little survives or an effect does not show."""
    made = _few if whole_rank(number) is None else _whole
    if afloat_rank(number) is not None:
        made = _afloat
    nothing = f"no world could be run in {ATTEMPTS} attempts"
    return first_made(lambda attempt: made(seed, number, attempt), ATTEMPTS, (seed, number), nothing)


def _few(seed: int, number: int, attempt: int) -> Concealed | None:
    world = draw_robot(seed, number, attempt)
    kept = _kept(world, run(world, world.effects), FEWEST, ROBOTS_SHORTEST)
    if kept is None:
        return None
    seen = shown(world, kept.truth, kept.samples)
    if min(seen, default=SHOWS) < SHOWS:
        return None
    effects = [{"rollout": round(min(size, FAR), 3), "visible": True} for size in seen]
    return _robots(world, kept, kept.recording, effects, {"robot": kept.recording.model})


def _whole(seed: int, number: int, attempt: int) -> Concealed | None:
    world = draw_whole(seed, number, attempt)
    kept = _kept(world, run_whole(world), FEWEST, ROBOTS_SHORTEST)
    if kept is None:
        return None
    log = logged(world, world.rough or Rough(), kept.recording)
    shares = shares_of(world, motion_of(world, kept.truth, kept.samples))
    effects = [{"share": None if s is None else round(s, 6), "visible": True} for s in shares]
    facts = log_facts(world, {name: count for name, count in log.counts.items() if count})
    return _robots(world, kept, log.recording, effects, {"whole": {"model": log.recording.model, **facts}})


def _afloat(seed: int, number: int, attempt: int) -> Concealed | None:
    world = draw_afloat(seed, number, attempt)
    truth = run_afloat(world)
    ends = kept_afloat(truth)
    kept = _kept(world, truth, FEWEST, ROBOTS_SHORTEST, ends)
    if kept is None:
        return None
    seen = shown_afloat(world, truth, kept.samples)
    if min(seen, default=SHOWS) < SHOWS:
        return None
    effects = [{"rollout": round(min(size, FAR), 3), "visible": True} for size in seen]
    falls = int(np.sum(ends < world.steps + 1))
    return _robots(
        world, kept, kept.recording, effects, {"afloat": {"model": kept.recording.model, "falls": falls}}
    )


def conceal_arm(seed: int, number: int, attempt: int, fewest: int) -> Concealed | None:
    """An arm as a machine; None where too little survives, or fewer effects show than have to."""
    world = draw_arm(seed, number, attempt)
    kept = _kept(world, run(world, world.effects), fewest, SHORTEST)
    if kept is None:
        return None
    seen = shown(world, kept.truth, kept.samples)
    if sum(beyond >= SHOWS for beyond in seen) < ARMS_FEWEST:
        return None
    # Nothing but its own effects is missing.
    facts = {"explained": 1.0, "channels": [], "left": {}, **log_facts(world, {})}
    effects = [{"share": None, "beyond": min(beyond, FAR)} for beyond in seen]
    return _robots(world, kept, kept.recording, effects, {"machine": facts})


def _robots(
    world: World, kept: _Kept, recording: Recording, effects: list[dict[str, Any]], beside: dict[str, Any]
) -> Concealed:
    return Concealed(world, (recording,), kept.clean, beside, effects, files=files_of(world.system))
