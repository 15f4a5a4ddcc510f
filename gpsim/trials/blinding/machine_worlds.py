"""Concealing whole machines, of which there may be several recordings, and worlds for plans, which are played twice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from gpsim.channels import Channels, FloatArray, IntArray
from gpsim.recordings import Episode, Recording
from gpsim.trials.blinding.concealment import (
    FAR,
    Concealed,
    as_measured,
    first_made,
    kept_of,
    log_facts,
    share_facts,
)
from gpsim.trials.blinding.logs import even_recording, logged
from gpsim.trials.blinding.robot_worlds import conceal_arm
from gpsim.trials.drawing import (
    ARM,
    box_of,
    counts,
    draw_machine,
    draw_plan,
    kind_of,
    slow_waves,
    within,
)
from gpsim.trials.truth import Shares, one_step, run
from gpsim.trials.worlds import SYSTEMS, Rough, Run, World

ATTEMPTS = 80
FEWEST = 1200  # transitions of each recording
FINE = 2e-3  # s, of the truth of a world for plans
MINUTES = 22.0 / 60.0  # two pieces of the default length


def conceal_machine(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed, anew until its effects are what they have to be."""

    def made(attempt: int) -> Concealed | None:
        if kind_of(number) == ARM:
            return conceal_arm(seed, number, attempt, FEWEST)
        world = draw_machine(seed, number, attempt)
        return None if world is None else _concealed(world)

    return first_made(made, ATTEMPTS, (seed, number), "no machine could be made")


class _Ran(NamedTuple):
    """One recording of a machine as it went. kept: (E,) samples of every episode."""

    world: World
    truth: Run
    kept: FloatArray
    even: Recording
    clean: Recording


def _concealed(world: World) -> Concealed | None:
    assert world.machine is not None
    ran: list[_Ran] = []
    for session in range(len(world.machine.sessions)):
        if (one := _run(world.recorded_as(session))) is None:
            return None
        ran.append(one)
    first = ran[0]
    shares = Shares(first.world, first.truth, first.kept)
    made = [shares.of(e) for e in first.world.effects]
    nuisances = [share for e, share in zip(first.world.effects, made, strict=True) if e.outside]
    if not counts(shares, first.world.effects) or not all(map(within, nuisances)):
        return None
    logs = [logged(r.world, r.world.rough or Rough(), r.even) for r in ran]
    explained = shares.explained(first.world.main)
    beyond = [min(shares.beyond(e), FAR) for e in first.world.effects]
    facts = {"explained": explained, **share_facts(first.world, shares), **log_facts(world, logs[0].counts)}
    return Concealed(
        world,
        tuple(_as_kept(r, log.recording) for r, log in zip(ran, logs, strict=True)),
        first.clean,
        {"machine": facts},
        [{"share": share, "beyond": far} for share, far in zip(made, beyond, strict=True)],
        one_step(as_measured(first.world), first.truth, first.even, first.clean, first.kept),
    )


def _run(world: World) -> _Ran | None:
    """None where too little survives."""
    truth = run(world, world.effects)
    kept = kept_of(world, truth, FEWEST)
    if kept is None:
        return None
    bare = as_measured(world)
    even, clean = (even_recording(bare, read, truth, kept) for read in (truth.measured, truth.clean))
    return _Ran(world, truth, kept, even, clean)


def _as_kept(ran: _Ran, recording: Recording) -> Recording:
    """With the clock and the zeros of its session, and without velocities where there are none."""
    world = ran.world
    assert world.machine is not None
    own, names = world.machine.sessions[world.session], list(SYSTEMS[world.system].names)
    bare, unread = world.machine.positions_only, names[1::2] if world.velocities == "differentiated" else []
    columns = [i for i in range(len(names)) if not (bare and i % 2)]
    zeros = np.array([own.zeros.get(name, 0.0) for name in names])
    episodes = tuple(
        Episode(e.name, np.round(e.t + own.clock, 9), (e.states + zeros)[:, columns], e.actions)
        for e in recording.episodes
    )
    noise = {n: sd for n, sd in ran.even.noise.items() if n not in unread}
    state = Channels.of({n: SYSTEMS[world.system].state[n] for n in names[0::2]}) if bare else recording.state
    velocities = None if bare else world.velocities
    return replace(recording, state=state, episodes=episodes, velocities=velocities, noise=noise)


@dataclass(frozen=True)
class Played:
    """Commands that were written down: (K, E, A)."""

    commands: FloatArray

    def command(self, k: int, measured: FloatArray) -> FloatArray:
        """(E, A)."""
        return np.asarray(self.commands[k])


def conceal_plan(seed: int, number: int) -> Concealed:
    """Draw trial `number` of a seed, and record it under slow waves."""
    world = draw_plan(seed, number)
    truth = run(world, world.effects, FINE, Played(slow_waves(world)[:, None]))
    recording, clean = (even_recording(world, r, truth, _whole(world)) for r in (truth.measured, truth.clean))
    limits = {"minutes": MINUTES, "box": box_of(world)}
    return Concealed(world, (recording,), clean, {"plan": limits}, limits=limits)


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
