"""What of a simulator a recording shows: commands that never change, states held still, not measured, or not needed.

A free swing with the motor off, a cart that is clamped and a robot of which only the yaw is known are recordings like
others. What cannot be asked of them is left out, and said. A state that nobody measured is guessed from what was: a fit
of start states needs no more to begin with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import Channels, FloatArray, difference
from gpsim.diagnosis.data import THIRD_DIFFERENCE, integral, typical
from gpsim.effects import closed
from gpsim.errors import NoDiagnosis, UsageError
from gpsim.recordings import Episode, Recording
from gpsim.residuals import check_match
from gpsim.simulators import SIMULATORS, Simulator, reduced

LOOKED_AT = 20  # recorded states at which what is needed is looked for
PROBES = (1.0, -0.3)  # by how much an absent state is moved: at two places, of which one may be special
TURN = 24  # headings of a whole turn that are tried
AHEAD = 5  # steps over which they are judged: one alone may be all noise
REACHES = (1, 2, 3, 5, 8, 12)  # samples to either side, over which the slope of a noisy position may be taken


@dataclass(frozen=True)
class ObservedModel:
    """A simulator as a recording shows it.

    simulator: without the states that are `dropped` (nobody measured them, and no rate that was measured needs them)
    or `held` (at these values); hidden: states that are estimated; still: actions that never change, at their values;
    commanded: False where the recording holds no action, which is then 0; constant: other states that never change.
    """

    simulator: Simulator
    hidden: tuple[str, ...]
    dropped: tuple[str, ...]
    held: Mapping[str, float]
    still: Mapping[str, float]
    commanded: bool
    constant: tuple[str, ...]

    @property
    def unmeasured(self) -> tuple[str, ...]:
        """Rates that do not follow from the states that are left."""
        rates, measures = self.simulator.rate.names, getattr(self.simulator, "measures", None)
        return tuple(name for name in rates if measures is not None and not measures(name))

    def completed(self, recording: Recording) -> Recording:
        """The recording with the simulator's states in their order, hidden ones guessed, commands of 0 where none."""
        if not self.commanded:
            recording = _uncommanded(recording, self.simulator.action)
        if recording.state.names == self.simulator.state.names:
            return recording
        recorded = {channel.name: channel for channel in recording.state}
        channels = Channels(tuple(recorded.get(channel.name, channel) for channel in self.simulator.state))
        episodes = []
        for e in recording.episodes:
            states = [guess(name, e, recording, self.simulator) for name in channels.names]
            weights = e.weights
            if weights is not None:  # those of states that nobody measured are whole
                known = dict(zip(recorded, weights.T, strict=True))
                whole = [known.get(name, np.ones(len(e.t))) for name in channels.names]
                weights = np.stack(whole, axis=1)
            episodes.append(replace(e, states=np.stack(states, axis=1), weights=weights))
        noise = {n: v for n, v in recording.noise.items() if n in (*channels.names, *recording.action.names)}
        return replace(recording, state=channels, episodes=tuple(episodes), noise=noise)


def look(recording: Recording, simulator: Simulator) -> ObservedModel:
    """What the recording shows of the simulator; raises UsageError where the two do not go together."""
    commanded = bool(len(recording.action)) or not len(simulator.action)
    shown = recording if commanded else _uncommanded(recording, simulator.action)
    absent = [n for n in simulator.state.names if n not in recording.state.names]
    some = len(absent) < len(simulator.state)
    dropped = _not_needed(shown, simulator, absent) if some else []
    guesses = (simulator.guesses_speeds or SIMULATORS.get(simulator.name) is not None) and some
    hidden = [n for n in absent if n not in dropped and (n in simulator.start or guesses)]
    check_match(shown, simulator, hidden=(*hidden, *dropped))
    constant = _constant(shown)
    still = all(name in constant for name in recording.state.names)  # a recording that is refused later
    held = [] if still else _held(simulator, recording.state.names, constant)
    fixed = {n: 0.0 if n in simulator.velocities else constant.get(n, 0.0) for n in (*dropped, *held)}
    of_held = [c.name for c in simulator.coordinates if c.name in held]
    return ObservedModel(
        reduced(simulator, fixed, of_held),
        tuple(n for n in hidden if n not in fixed),
        tuple(dropped),
        {n: fixed[n] for n in held},
        {n: constant[n] for n in shown.action.names if n in constant},
        commanded,
        tuple(n for n in recording.state.names if n in constant and n not in held),
    )


def check_moves(recording: Recording, simulator: Simulator, sight: ObservedModel) -> None:
    """Something must move, and a velocity must where its position does: what never changes may be a dead sensor."""
    names = recording.state.names
    first, last = recording.episodes[0].name, recording.episodes[-1].name
    if all(name in sight.held or name in sight.constant for name in names):
        channel = ", ".join(names)
        raise NoDiagnosis(
            f"nothing moves: {channel} never change{'s' if len(names) == 1 else ''} from episode {first} to episode "
            f"{last}; check the sensors, or record data in which something moves"
        )
    for coordinate in simulator.coordinates:
        pair = (coordinate.name, coordinate.velocity)
        dead = [name for name in pair if name in sight.constant]
        if len(dead) == 1 and all(name in names for name in pair):
            other = next(name for name in pair if name not in dead)
            value = _constant(recording)[dead[0]]
            raise UsageError(
                f"channel {dead[0]} is constant ({value:g}) from episode {first} to episode {last} while {other} "
                f"moves; check the sensor, or remove {dead[0]}: it is then estimated"
            )


def _uncommanded(recording: Recording, action: Channels) -> Recording:
    episodes = tuple(
        replace(episode, actions=np.zeros((len(episode), len(action)))) for episode in recording.episodes
    )
    return replace(recording, action=action, episodes=episodes)


def _constant(recording: Recording) -> dict[str, float]:
    """Every channel that never changes, with its value."""
    states = np.concatenate([episode.states for episode in recording.episodes])
    actions = np.concatenate([episode.actions for episode in recording.episodes])
    out: dict[str, float] = {}
    for channels, values in ((recording.state, states), (recording.action, actions)):
        if len(values):
            still = np.ptp(values, axis=0) == 0.0
            out |= {n: float(v) + 0.0 for n, v, s in zip(channels.names, values[0], still, strict=True) if s}
    return out


def _held(simulator: Simulator, recorded: Sequence[str], constant: Mapping[str, float]) -> list[str]:
    """States of coordinates that stand still, in position and, where that was measured, velocity."""
    return [
        name
        for c in simulator.coordinates
        if c.name in constant and (c.velocity in constant or c.velocity not in recorded)
        for name in (c.name, c.velocity)
    ]


def _not_needed(recording: Recording, simulator: Simulator, absent: Sequence[str]) -> list[str]:
    """Those of the absent states on which nothing depends that the others do: the most that can be left out together.

    By trial: each is moved, at recorded states and commands that do something, and the others' derivatives looked at.
    What is absent is at its start, or 0.1. The position of a velocity that was measured stays: what rubs or springs
    there acts on a coordinate.
    """
    rows, names, parameters = recording.transitions(), simulator.state.names, simulator.defaults()
    some = np.unique(np.linspace(0, max(len(rows) - 1, 0), LOOKED_AT).astype(int))[: len(rows)]
    recorded = dict(zip(recording.state.names, rows.states[some].T, strict=True))
    columns = [recorded.get(n, np.full(len(some), simulator.start.get(n, 0.1))) for n in names]
    state, action = np.stack(columns, axis=1), np.full((len(some), len(simulator.action)), 0.1)

    def slopes(name: str, by: float) -> FloatArray:
        moved = state.copy()
        moved[:, names.index(name)] += by
        with np.errstate(all="ignore"):
            return simulator.derivative(moved, simulator.rates(moved, action, parameters))

    def changed(name: str, kept: Sequence[int]) -> bool:
        still = slopes(name, 0.0)[:, kept]
        return any(not np.array_equal(slopes(name, by)[:, kept], still, equal_nan=True) for by in PROBES)

    moving = {c.name for c in simulator.coordinates if c.velocity in recording.state.names}
    out = [name for name in absent if name not in moving]
    while out:
        kept = [i for i, name in enumerate(names) if name not in out]
        needed = [name for name in out if changed(name, kept)]
        if not needed:
            break
        out = [name for name in out if name not in needed]
    return out


def guess(name: str, episode: Episode, recording: Recording, simulator: Simulator) -> FloatArray:
    """(K + 1,): a channel as recorded, or what goes with the others.

    The simulator's own guess where it has one; a velocity from its position, a position from its velocity; an angle
    that wraps, as a heading, the one with which the next steps fit best; else 0.
    """
    names = recording.state.names
    if name in names:
        return episode.states[:, names.index(name)]
    if name in simulator.start:
        return np.full(len(episode.t), simulator.start[name])
    columns = dict(zip(names, episode.states.T, strict=True))
    if (followed := simulator.followed(name, columns, lambda path: speed_of(path, episode.t))) is not None:
        return followed
    for coordinate in simulator.coordinates:
        if name == coordinate.velocity and coordinate.name in names and len(episode) > 0:
            position = episode.states[:, names.index(coordinate.name)]
            angle = simulator.state.units[coordinate.name] == "rad"
            path = np.unwrap(position) if angle else position
            if closed(simulator) is None:
                return np.gradient(path, episode.t)
            return speed_of(path, episode.t, recording.noise.get(coordinate.name))
        if name == coordinate.name and coordinate.velocity in names:
            speed = episode.states[:, names.index(coordinate.velocity)]
            return integral(episode.t, speed)
    if simulator.state.wraps[simulator.state.index(name)] and len(episode) > 0:
        return _heading(name, episode, recording, simulator)
    return np.zeros(len(episode.t))


def speed_of(path: FloatArray, t: FloatArray, noise: float | None = None) -> FloatArray:
    """(K,) velocity along a position (K,): the slope of a line through neighbours, as many as err least.

    Few of them pass noise on, many round bends off. What the bends make of it shows beside the fewest, less what noise
    explains of that. noise: standard deviation of the position; None: as its third differences say.
    """
    if len(path) <= 2 * REACHES[-1]:
        return np.gradient(path, t)
    if noise is None:
        noise = typical(np.diff(path, 3)) / THIRD_DIFFERENCE
    step = float(np.median(np.diff(t)))
    slopes, reach = [_slopes(path, t, r) for r in REACHES], np.array(REACHES)
    passed_on = (noise / step) ** 2 * 3.0 / (reach * (reach + 1) * (2 * reach + 1))
    changed = np.mean((np.stack(slopes) - slopes[0]) ** 2, axis=1)
    bent = np.maximum(changed - np.maximum(passed_on[0] - passed_on, 0.0), 0.0)
    return slopes[int(np.argmin(passed_on + bent))]


def _slopes(path: FloatArray, t: FloatArray, reach: int) -> FloatArray:
    """(K,) the slope of a line through so many samples to either side, fewer near the ends."""
    out, count = np.gradient(path, t), len(path)
    for near in range(1, reach + 1):  # the widest that fits is written last
        width = 2 * near + 1
        rows = np.arange(count - width + 1)[:, None] + np.arange(width)
        at, along = t[rows], path[rows]
        at = at - at.mean(axis=1, keepdims=True)
        out[near : count - near] = (at * along).sum(axis=1) / (at**2).sum(axis=1)
    return np.asarray(out)


def _heading(name: str, episode: Episode, recording: Recording, simulator: Simulator) -> FloatArray:
    """(K + 1,): of a turn's angles the one from which the simulator best reaches the next samples."""
    measured = [n for n in simulator.state.names if n in recording.state.names]
    into = [simulator.state.index(n) for n in measured]
    states = np.zeros((len(episode.t), len(simulator.state)))
    states[:, into] = episode.states[:, [recording.state.index(n) for n in measured]]
    parameters, column = simulator.defaults(recording.parameters), simulator.state.index(name)
    steps, scale = np.diff(episode.t), np.maximum(np.std(states[:, into], axis=0), np.finfo(float).tiny)
    angles = np.linspace(-np.pi, np.pi, TURN, endpoint=False)
    costs = np.zeros((TURN, len(steps)))
    for i, angle in enumerate(angles):
        at = states[:-1].copy()
        at[:, column] = angle
        for ahead in range(AHEAD):
            count = len(steps) - ahead
            if count <= 0:
                break
            at = simulator.step(
                at[:count], episode.actions[ahead:], parameters, steps[ahead:], simulator.integrator
            )
            missed = difference(at, states[ahead + 1 :], simulator.state)[:, into] / scale
            costs[i, :count] += (missed**2).sum(axis=1)
    best = angles[np.argmin(costs, axis=0)]
    return np.concatenate([best, best[-1:]])
