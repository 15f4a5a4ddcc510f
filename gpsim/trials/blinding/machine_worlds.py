"""Concealing a whole machine: one to three recordings of it, and of the truth what decides what counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.errors import UsageError
from gpsim.recordings import Episode, Recording
from gpsim.trials.blinding.concealment import SHORTEST, answer_json, as_measured, long_enough
from gpsim.trials.blinding.logs import even_recording, logged
from gpsim.trials.blinding.robot_worlds import kept_run, with_effects
from gpsim.trials.drawing import ARM, counts, draw_machine, kind_of, within
from gpsim.trials.robots import SHOWS, Files, draw_arm, files_of, shown
from gpsim.trials.truth import OneStep, Shares, one_step, run
from gpsim.trials.worlds import SYSTEMS, Rough, Run, World, effect_json, sound

ATTEMPTS = 80
FEWEST = 1200  # transitions of each recording
ARMS_FEWEST = 4  # effects of an arm that show


@dataclass(frozen=True)
class MachineTruth:
    """What decides what counts.

    explained: the share of the mismatch that the machine's own effects explain; shares: what each of all effects makes
    of it, None of an arm's; beyond: how far each moves the readings, in noise; channels: those that stand out of the
    noise; left: channel -> what the own effects leave, root mean square over rollouts of a second; rows: with a defect.
    """

    explained: float
    shares: tuple[float | None, ...]
    beyond: tuple[float, ...]
    channels: tuple[str, ...]
    left: Mapping[str, float]
    rows: Mapping[str, int]


@dataclass(frozen=True)
class MachineConcealed:
    """A machine that was run. recordings: as they were logged; clean: on an even clock, without noise.

    truth, one_step: of the first recording. Of an arm there are no residual rates; files: the model that is believed.
    """

    world: World
    recordings: tuple[Recording, ...]
    cleans: tuple[Recording, ...]
    one_step: OneStep | None
    truth: MachineTruth
    files: Files = field(default_factory=dict)

    @property
    def clean(self) -> Recording:
        """Of the first recording."""
        return self.cleans[0]


def conceal_machine(seed: int, number: int) -> MachineConcealed:
    """Draw and run trial `number` of a seed, anew until its effects are what they have to be."""
    for attempt in range(ATTEMPTS):
        if kind_of(number) == ARM:
            found = _concealed_arm(draw_arm(seed, number, attempt))
        else:
            world = draw_machine(seed, number, attempt)
            found = None if world is None else _concealed(world)
        if found is not None:
            return found
    raise UsageError(f"seed {seed}, trial {number}: no machine could be made; take another seed")


def machine_answer(concealed: MachineConcealed, truth_digest: str) -> dict[str, Any]:
    """What answer.json says."""
    world, truth = concealed.world, concealed.truth
    effects = [
        effect_json(e) | {"share": share, "beyond": min(beyond, 1e6)}
        for e, share, beyond in zip(world.effects, truth.shares, truth.beyond, strict=True)
    ]
    machine = {
        "explained": truth.explained,
        "channels": list(truth.channels),
        "left": dict(truth.left),
        "defects": list(world.rough.defects if world.rough else ()),
        "rows": dict(truth.rows),
    }
    transitions = sum(r.transition_count for r in concealed.recordings)
    return answer_json(world, effects, transitions, truth_digest, {"machine": machine})


class _Ran(NamedTuple):
    """One recording of a machine as it went. kept: (E,) samples of every episode."""

    world: World
    truth: Run
    kept: FloatArray
    even: Recording
    clean: Recording


def _concealed(world: World) -> MachineConcealed | None:
    assert world.machine is not None
    ran: list[_Ran] = []
    for session in range(len(world.machine.sessions)):
        one = _run(world.recorded_as(session))
        if one is None:
            return None
        ran.append(one)
    first = ran[0]
    found = _truth(first.world, Shares(first.world, first.truth, first.kept))
    if found is None:
        return None
    logs = [logged(r.world, r.world.rough or Rough(), r.even) for r in ran]
    recordings = [
        _as_kept(r.world, replace(log.recording, noise=_known(r.world, r.even)))
        for r, log in zip(ran, logs, strict=True)
    ]
    steps = one_step(as_measured(first.world), first.truth, first.even, first.clean, first.kept)
    cleans = tuple(r.clean for r in ran)
    return MachineConcealed(
        world, tuple(recordings), cleans, steps, replace(found, rows=dict(logs[0].counts))
    )


def _run(world: World) -> _Ran | None:
    """None where too little survives."""
    truth = run(world, world.effects)
    kept = long_enough(sound(world, truth.sampled), SHORTEST, FEWEST)
    if kept is None:
        return None
    bare = as_measured(world)
    even, clean = (even_recording(bare, read, truth, kept) for read in (truth.measured, truth.clean))
    return _Ran(world, truth, kept, even, clean)


def _concealed_arm(world: World) -> MachineConcealed | None:
    """None where too little survives, or fewer effects show than have to."""
    kept = kept_run(world, FEWEST, with_effects, SHORTEST)
    if kept is None:
        return None
    seen = shown(world, kept.truth, kept.samples)
    if sum(beyond >= SHOWS for beyond in seen) < ARMS_FEWEST:
        return None
    # Nothing but its own effects is missing.
    facts = MachineTruth(1.0, (None,) * len(seen), tuple(seen), (), {}, {})
    return MachineConcealed(world, (kept.recording,), (kept.clean,), None, facts, files_of(world.system))


def _truth(world: World, shares: Shares) -> MachineTruth | None:
    """None where its effects are not what they have to be."""
    if not counts(shares, world.effects):
        return None
    made = [shares.of(e) for e in world.effects]
    nuisances = [share for e, share in zip(world.effects, made, strict=True) if e.outside]
    if not all(map(within, nuisances)):
        return None
    return MachineTruth(
        shares.explained(world.main),
        tuple(made),
        tuple(shares.beyond(e) for e in world.effects),
        tuple(name for name, counted in zip(shares.seen, shares.counts, strict=True) if counted),
        shares.left(world.main),
        {},
    )


def _known(world: World, even: Recording) -> dict[str, float]:
    """The noise that is stated, of channels that are read."""
    unread = SYSTEMS[world.system].names[1::2] if world.velocities == "differentiated" else ()
    return {n: sd for n, sd in even.noise.items() if n not in unread}


def _as_kept(world: World, recording: Recording) -> Recording:
    """With the clock and the zeros of its session, and without velocities where there are none."""
    assert world.machine is not None
    own, names = world.machine.sessions[world.session], list(SYSTEMS[world.system].names)
    bare = world.machine.positions_only
    columns = [i for i in range(len(names)) if not (bare and i % 2)]
    zeros = np.array([own.zeros.get(name, 0.0) for name in names])
    episodes = tuple(
        Episode(e.name, np.round(e.t + own.clock, 9), (e.states + zeros)[:, columns], e.actions)
        for e in recording.episodes
    )
    if not bare:
        return replace(recording, episodes=episodes, velocities=world.velocities)
    state = Channels.of({name: SYSTEMS[world.system].state[name] for name in names[0::2]})
    return replace(recording, state=state, episodes=episodes, velocities=None)
