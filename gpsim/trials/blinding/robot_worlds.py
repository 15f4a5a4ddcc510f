"""Concealing robots, with the model that is believed: of one or two effects, whole ones, or an arm as a machine."""

from __future__ import annotations

from typing import Any, NamedTuple

from gpsim.channels import FloatArray
from gpsim.recordings import Recording
from gpsim.trials.blinding.concealment import FAR, SHORTEST, Concealed, first_made, log_facts, long_enough
from gpsim.trials.blinding.logs import logged
from gpsim.trials.robots import (
    SHOWS,
    draw_arm,
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


def _kept(world: World, truth: Run, fewest: int, shortest: int) -> _Kept | None:
    """None where too little survives."""
    samples = long_enough(sound(world, truth), shortest, fewest)
    if samples is None:
        return None
    recording, clean = (recorded(world, read, truth, samples) for read in (truth.measured, truth.clean))
    return _Kept(truth, samples, recording, clean)


def conceal_robot(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed; anew where too little survives or an effect does not show."""
    made = _few if whole_rank(number) is None else _whole
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
