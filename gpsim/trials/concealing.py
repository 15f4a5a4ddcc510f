"""Concealing a world: the recordings that a user would have of it, and the answer.

A number says of which kind a world is (`KINDS`); it is drawn and run anew until enough survives and counts. Robots come
with the model that is believed, machines perhaps with several recordings; worlds for plans are played twice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from gpsim.channels import BoolArray, Channels, FloatArray, IntArray, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import Episode, HeldOut, Recording
from gpsim.trials import robots
from gpsim.trials.drawing import box_of, draw, draw_plan, slow_waves
from gpsim.trials.driving import played as by_commands
from gpsim.trials.driving import sound
from gpsim.trials.machines import ARM, counts, draw_machine, kind_of
from gpsim.trials.out_of_catalogue import true_curve
from gpsim.trials.rough import draw_rough, within
from gpsim.trials.shares import Shares, visibilities
from gpsim.trials.truth import OneStep, one_step, run
from gpsim.trials.worlds import SYSTEMS, Rough, Run, World, effect_json, numbered, world_json

Json = Mapping[str, Any]
SCHEMA = "gpsim.answer/1"
UNFILTERED = range(2026, 2029)  # published seeds: their true model did not know what differentiating does
SHORTEST, ROBOTS_SHORTEST = 40, 59  # transitions: what an operator would keep of an episode that went wrong
FEWEST, ROUGH_FEWEST, MACHINES_FEWEST = (
    2000,
    1500,
    1200,
)  # transitions of each recording, before rows are lost
IMPORTANT, NEEDED = 0.08, 0.03  # of a main effect among nuisances; a little less than where it was drawn
ARMS_FEWEST = 4  # effects of an arm that show
FAR = 1e6  # standard deviations of the noise
FINE = 2e-3  # s, of the truth of a world for plans
MINUTES = 22.0 / 60.0  # two pieces of the default length
MOST_LATE = 0.4  # of a sample, that a stamp is off
SPIKES = 0.01  # share of the stamps that are as late as that
BURST, LONGEST_BURST = 2.0, 8  # rows that are lost together, on average and at most
SWAP = 4  # rows of a swap, at most
WINDOW, ORDER = 7, 2  # of the filter that differentiates


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


def conceal(seed: int, number: int) -> Concealed:
    """Draw and run trial `number` of a seed, anew until enough survives and counts; raises UsageError."""
    kind, _ = numbered(number)
    made, attempts = KINDS[kind]
    for attempt in range(attempts):
        if (found := made(seed, number, attempt)) is not None:
            return found
    nothing = NOTHING.get(kind, f"no world could be run in {attempts} attempts")
    raise UsageError(f"seed {seed}, trial {number}: {nothing}; take another seed")


def long_enough(kept: FloatArray, shortest: int, fewest: int) -> FloatArray | None:
    """Samples (E,) of every episode, 0 of one that is too short to keep; None where too little is left of all."""
    kept = np.where(np.asarray(kept) > shortest, kept, 0)
    return None if np.maximum(kept - 1, 0).sum() < fewest else kept


class _Ran(NamedTuple):
    """One recording as it went. kept: (E,) samples of every episode; even: as read, clean: without noise."""

    world: World
    truth: Run
    kept: FloatArray
    even: Recording
    clean: Recording


def _ran(world: World, fewest: int, as_logged: bool = True) -> _Ran | None:
    """None where too little survives. as_logged: velocities measured and angles as they are, what a log is made of."""
    truth = run(world, world.effects)
    kept = long_enough(sound(world, truth.sampled), SHORTEST, fewest)
    if kept is None:
        return None
    bare = _as_measured(world) if as_logged else world
    even, clean = (even_recording(bare, read, truth, kept) for read in (truth.measured, truth.clean))
    return _Ran(world, truth, kept, even, clean)


def _as_measured(world: World) -> World:
    return replace(world, velocities=world.velocities and "measured", wrapped=False)


def _plain(seed: int, number: int, attempt: int) -> Concealed | None:
    ran = _ran(draw(seed, number, attempt), FEWEST, as_logged=False)
    if ran is None:
        return None
    world, truth, kept, recording, clean = ran
    known = clean
    if seed in UNFILTERED:
        known = even_recording(_as_measured(world), truth.clean, truth, kept)
    # As far as every episode that was kept lasted.
    count, rows = int(kept[kept > 0].min()), kept > 0
    cut = {name: getattr(truth, name)[:count, rows] for name in ("clean", "measured", "hidden", "free")}
    cut |= {
        "commands": truth.commands[: count - 1, rows],
        "clock": truth.clock[rows],
        "wall": truth.wall[rows],
    }
    fine = truth.fine[: (count - 1) * truth.per_sample + 1, rows]
    seen = visibilities(world, replace(truth, fine=fine, **cut))
    steps, curve = one_step(world, truth, recording, known, kept), true_curve(world, truth)
    return Concealed(
        world,
        (recording,),
        clean,
        _errors(world, steps) | ({} if curve is None else {"curve": curve}),
        [{"share": v.share, "rollout": min(v.rollout, FAR), "visible": v.visible} for v in seen],
        steps,
        all(v.visible for v in seen),
    )


def _rough(seed: int, number: int, attempt: int) -> Concealed | None:
    world = draw_rough(seed, number, attempt)
    ran = None if world is None else _ran(world, ROUGH_FEWEST)
    if world is None or ran is None or world.rough is None:
        return None
    found = Shares(world, ran.truth, ran.kept)
    main, nuisances = found.main(), [found.of(e) for e in world.effects if e.out_of_catalogue]
    if not found.counts.any() or not all(map(within, nuisances)):
        return None
    if not all(m.importance >= IMPORTANT and m.needed >= NEEDED for m in main):
        return None
    log = logged(world, world.rough, ran.even)
    steps = one_step(_as_measured(world), ran.truth, ran.even, ran.clean, ran.kept)
    decides = {
        "explained": found.explained(world.main),
        "main": [vars(share) for share in main],
        "nuisances": nuisances,
        **_facts(world, log.counts, found),
    }
    known = {n: sd for n, sd in ran.even.noise.items() if n in found.seen}
    recording = replace(log.recording, velocities=world.velocities, noise=known)
    return Concealed(world, (recording,), ran.clean, _errors(world, steps), one_step=steps, rough=decides)


def _facts(world: World, rows: Mapping[str, int], shares: Shares | None = None) -> dict[str, Any]:
    """What decides: the channels that stand out of the noise, and what the main effects leave of the mismatch there.

    left: root mean square over rollouts of a second; of an arm nothing but its own effects is missing. And what is
    wrong with the log, and how many of its rows have which defect.
    """
    seen = [] if shares is None else list(zip(shares.seen, shares.counts, strict=True))
    left = {} if shares is None else shares.left(world.main)
    return {"channels": [name for name, counts in seen if counts], "left": left, **_log_facts(world, rows)}


def _log_facts(world: World, rows: Mapping[str, int]) -> dict[str, Any]:
    return {"defects": list(world.rough.defects if world.rough else ()), "rows": dict(rows)}


def _errors(world: World, steps: OneStep) -> dict[str, Any]:
    """Rate -> root mean square error of one step of the base simulator and of the true model."""
    base, own = (np.sqrt([np.mean(rates**2) for rates in each.T]).tolist() for each in steps[:2])
    rates = SYSTEMS[world.system].rates
    return {"one_step": {r: {"base": b, "own": o} for r, b, o in zip(rates, base, own, strict=True)}}


def _machine(seed: int, number: int, attempt: int) -> Concealed | None:
    if kind_of(number) == ARM:
        return _arm(seed, number, attempt)
    world = draw_machine(seed, number, attempt)
    if world is None or world.machine is None:
        return None
    ran: list[_Ran] = []
    for session in range(len(world.machine.sessions)):
        if (one := _ran(world.recorded_as(session), MACHINES_FEWEST)) is None:
            return None
        ran.append(one)
    first = ran[0]
    shares = Shares(first.world, first.truth, first.kept)
    made = [shares.of(e) for e in first.world.effects]
    nuisances = [share for e, share in zip(first.world.effects, made, strict=True) if e.out_of_catalogue]
    if not counts(shares, first.world.effects) or not all(map(within, nuisances)):
        return None
    logs = [logged(r.world, r.world.rough or Rough(), r.even) for r in ran]
    beyond = [min(shares.beyond(e), FAR) for e in first.world.effects]
    explained = shares.explained(first.world.main)
    facts = {"explained": explained, **_facts(first.world, logs[0].counts, shares)}
    return Concealed(
        world,
        tuple(_as_kept(r, log.recording) for r, log in zip(ran, logs, strict=True)),
        first.clean,
        {"machine": facts},
        [{"share": share, "beyond": far} for share, far in zip(made, beyond, strict=True)],
        one_step(_as_measured(first.world), first.truth, first.even, first.clean, first.kept),
    )


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


def _plan(seed: int, number: int, attempt: int) -> Concealed:
    """Recorded under slow waves."""
    world = draw_plan(seed, number)
    truth = run(world, world.effects, FINE, by_commands(slow_waves(world)[:, None]))
    recording, clean = (even_recording(world, r, truth, _whole(world)) for r in (truth.measured, truth.clean))
    limits = {"minutes": MINUTES, "box": box_of(world)}
    return Concealed(world, (recording,), clean, {"plan": limits}, limits=limits)


def played(world: World, commands: FloatArray, box: Mapping[str, Any]) -> tuple[Recording, IntArray]:
    """The machine under commands (K, E, A), each from rest: an episode each; and (E,) steps until it left the box."""
    later = replace(world, steps=len(commands), episodes=commands.shape[1], session=1)
    truth = run(later, world.effects, FINE, by_commands(commands))
    low, high = np.array([box[name] for name in SYSTEMS[world.system].names]).T
    outside = ((truth.sampled < low) | (truth.sampled > high)).any(axis=2)
    left = np.where(outside.any(axis=0), np.argmax(outside, axis=0), len(commands))
    return even_recording(later, truth.measured, truth, _whole(later)), np.asarray(left)


def _whole(world: World) -> FloatArray:
    return np.full(world.episodes, world.steps + 1.0)


def _robot(seed: int, number: int, attempt: int) -> Concealed | None:
    """One or two effects, or what floats or stands; each effect shows."""
    if numbered(number)[0] == "afloat":
        world = robots.draw_afloat(seed, number, attempt)
        truth = robots.run_afloat(world)
        ends, shown = robots.kept_afloat(truth), robots.shown_afloat
    else:
        world = robots.draw_robot(seed, number, attempt)
        truth = robots.run(world, world.effects)
        ends, shown = robots.sound(world, truth), robots.shown
    kept = long_enough(ends, ROBOTS_SHORTEST, FEWEST)
    if kept is None or min(seen := shown(world, truth, kept), default=robots.SHOWS) < robots.SHOWS:
        return None
    effects = [{"rollout": round(min(size, FAR), 3), "visible": True} for size in seen]
    model, falls = robots.robot_of(world.system).file, int(np.sum(ends < world.steps + 1))
    beside = {"afloat": {"model": model, "falls": falls}} if world.stratum == "afloat" else {"robot": model}
    return _of_robot(world, truth, kept, effects, beside)


def _whole_robot(seed: int, number: int, attempt: int) -> Concealed | None:
    world = robots.draw_whole(seed, number, attempt)
    truth = robots.run_whole(world)
    kept = long_enough(robots.sound(world, truth), ROBOTS_SHORTEST, FEWEST)
    if kept is None:
        return None
    log = logged(world, world.rough or Rough(), robots.recorded(world, truth.measured, truth, kept))
    shares = robots.shares_of(world, robots.motion_of(world, truth, kept))
    effects = [{"share": None if s is None else round(s, 6), "visible": True} for s in shares]
    facts = _log_facts(world, {name: count for name, count in log.counts.items() if count})
    beside = {"whole": {"model": log.recording.model, **facts}}
    found = _of_robot(world, truth, kept, effects, beside)
    return replace(found, recordings=(log.recording,))


def _arm(seed: int, number: int, attempt: int) -> Concealed | None:
    """An arm as a machine, of which enough effects show."""
    world = robots.draw_arm(seed, number, attempt)
    truth = robots.run(world, world.effects)
    kept = long_enough(robots.sound(world, truth), SHORTEST, MACHINES_FEWEST)
    if kept is None:
        return None
    seen = robots.shown(world, truth, kept)
    if sum(beyond >= robots.SHOWS for beyond in seen) < ARMS_FEWEST:
        return None
    facts = {"explained": 1.0, **_facts(world, {})}
    effects = [{"share": None, "beyond": min(beyond, FAR)} for beyond in seen]
    return _of_robot(world, truth, kept, effects, {"machine": facts})


def _of_robot(
    world: World, truth: Run, kept: FloatArray, effects: list[dict[str, Any]], beside: Json
) -> Concealed:
    recording, clean = (robots.recorded(world, read, truth, kept) for read in (truth.measured, truth.clean))
    return Concealed(world, (recording,), clean, beside, effects, files=robots.files_of(world.system))


KINDS: Mapping[str, tuple[Callable[[int, int, int], Concealed | None], int]] = {
    **dict.fromkeys(("plain", "words", "curves"), (_plain, 6)),
    "rough": (_rough, 60),
    **dict.fromkeys(("robots", "afloat"), (_robot, 24)),
    "machines": (_machine, 80),
    "whole": (_whole_robot, 24),
    "plans": (_plan, 1),
}
"""Kind of worlds -> how one is made by an attempt, and after how many attempts there is none."""
NOTHING = {"rough": "no rough world could be made", "machines": "no machine could be made"}
"""What is said then, where it is not how many attempts there were."""


def even_recording(world: World, readings: FloatArray, truth: Run, kept: FloatArray) -> Recording:
    """The readings (K + 1, E, S) as a user would have them."""
    system = SYSTEMS[world.system]
    state = Channels.of(system.state, ("yaw",) if system.vehicle else ())
    episodes: list[Episode] = []
    for e in np.flatnonzero(kept):
        count = int(kept[e])
        states = readings[:count, e].copy()
        if world.velocities == "differentiated":
            states[:, 1::2] = _differentiated(states[:, 0::2], world.dt, world)
        if system.vehicle and world.wrapped:
            states[:, 2] = wrap_angle(states[:, 2])
        t = world.clock_offsets[e] + world.dt * np.arange(count)
        episodes.append(Episode(str(len(episodes)), np.round(t, 9), states, truth.commands[: count - 1, e]))
    unread = system.names[1::2] if world.velocities == "differentiated" else ()
    noise = {n: sd for n, sd in world.noise.items() if world.noise_known and n not in unread}
    return Recording(
        system=world.system,
        state=state,
        action=Channels.of(system.action),
        episodes=tuple(episodes),
        dt=world.dt,
        parameters=world.parameters,
        integrator=world.integrator,
        velocities=world.velocities,
        clock=world.clock,
        noise=noise,
        held_out=None if world.held_out is None else HeldOut(episodes_from=round(0.8 * len(episodes))),
    )


class Logged(NamedTuple):
    """The recording; and how many rows of it have each defect."""

    recording: Recording
    counts: Mapping[str, int]


def logged(world: World, rough: Rough, even: Recording) -> Logged:
    """The log of a recording that is `even`, with measured velocities and without a defect."""
    rng, names = world.generator(5), even.state.names
    counts = dict.fromkeys(("dropped", "repeated", "swapped"), 0)
    episodes = []
    for i, episode in enumerate(even.episodes):
        states = episode.states.copy()
        for j, name in enumerate(names):  # to the nearest of an encoder's steps
            if step := rough.quantum.get(name, 0.0):
                states[:, j] = step * np.round(states[:, j] / step)
        stale = _scattered(len(states), rough.repeated, 1.0, 1, rng)
        for k in np.flatnonzero(stale):
            states[k] = states[k - 1]
        swapped = _scattered(len(states), rough.swapped, 0.5 * SWAP, SWAP, rng)
        for j, name in enumerate(names):
            states[swapped, j] += rough.leap.get(name, 0.0)
        lost = _scattered(len(states), rough.dropped, BURST, LONGEST_BURST, rng)
        there = np.flatnonzero(~lost)
        t = _stamps(episode.t, world, rough, rng)[there]
        states = states[there]
        if world.velocities == "differentiated":
            states[:, 1::2] = _differentiated(states[:, 0::2], t, world)
        if "yaw" in names and world.wrapped:
            states[:, 2] = wrap_angle(states[:, 2])
        counts["repeated"] += int(stale[there].sum())
        counts["swapped"] += int(swapped[there].sum())
        counts["dropped"] += int(lost.sum())
        episodes.append(Episode(str(i), np.round(t, 9), states, episode.actions[there[:-1]]))
    return Logged(replace(even, episodes=tuple(episodes)), counts)


def _scattered(rows: int, share: float, mean: float, longest: int, rng: np.random.Generator) -> BoolArray:
    """(rows,) a share of them, in bursts; never the first row or the last."""
    hit = np.zeros(rows, dtype=bool)
    starts: IntArray = np.flatnonzero(rng.random(rows) < share / mean)
    for k in starts:
        hit[k : k + min(int(rng.geometric(1.0 / mean)), longest)] = True
    hit[[0, -1]] = False
    return hit


def _stamps(t: FloatArray, world: World, rough: Rough, rng: np.random.Generator) -> FloatArray:
    """(K + 1,) what the recording's clock said at the true moments t."""
    late = np.clip(rng.normal(size=len(t)) * rough.jitter, -MOST_LATE * world.dt, MOST_LATE * world.dt)
    if rough.jitter:
        late[rng.random(len(t)) < SPIKES] = MOST_LATE * world.dt
    return np.asarray((1.0 + rough.drift) * t + late)


def _differentiated(positions: FloatArray, t: FloatArray | float, world: World) -> FloatArray:
    """(K + 1, C) velocities as users make them of positions: over stamps or steps, or by a filter that trusts dt."""
    if world.smoothing == "savgol" and len(positions) > WINDOW:
        return np.asarray(savgol_filter(positions, WINDOW, ORDER, deriv=1, delta=world.dt, axis=0))
    return np.asarray(np.gradient(positions, t, axis=0))
