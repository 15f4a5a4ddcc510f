"""How large things typically are in a recording, and so where and how strongly an effect may act.

What the base simulator misses of the forces says what stands along the way. A force that repeats is found by a scan
over positions: what smooth functions of position, speed and command leave by least squares is held against sines of the
position, one wave number after another (Lomb 1976, "Least-squares frequency analysis of unequally spaced data",
Astrophysics and Space Science 39). What pushes back at the ends bends at an edge: a straight line of the position and
the depth behind the edge are held against what is missed, one edge after another.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gpsim.channels import BoolArray, FloatArray, difference
from gpsim.diagnosis.data import integral
from gpsim.diagnosis.setup.log_facts import stands, unread
from gpsim.effects import Effect, Place, passed_on
from gpsim.recordings import Recording, Transitions, evenly
from gpsim.simulators import ModelPlace, Simulator

ROWS_OF_SIZES = 4000  # transitions that sizes are taken from, at most
TYPICAL_QUANTILE = 0.95  # quantile of a channel's sizes that is its typical one
UNFORCED = 1e-6  # of the measured rates: a base simulator whose own are smaller tells no size of forces
FEWEST_WITHOUT_CONTACT = 100
"""Transitions without contact that must be left where accelerations leave out those that touch."""
TINY = 1e-150  # guards divisions, whatever the units: no size is 0, nor its square
SLIGHTLY = (
    0.01  # of a level, by which it is moved to see what drains: no further, where rates may not be finite
)
REACH = 2.0  # standard deviations of a position, to either side, in which a law's places are looked for
REFLECTED = 0.3
"""Of the inertia that would turn a joint's forces into its accelerations, that a rotor behind gears may well be: at a
wrist it is a thousand times what it moves (a made log of an arm of seven joints), and friction takes the rest."""

FEWEST = 10  # stretches by which a channel is seen to trail another
SURELY = 4.0  # standard errors that it must trail by: all channels of a robot are asked
BRIEF = 0.02  # of the time between two readings: by less nobody trails
STRIDES = (1, 4, 16)  # samples apart are readings that are compared

FOUND = 3  # periods that are told, the strongest first
SHORTEST = 80.0  # periods in the way that was visited, of the last wave number
REPEATS = 2.5
"""Periods in the way between the outer hundredths of positions, of the first wave number: what was not seen to repeat
is no ripple, but any curve (beside a cubic spring it followed smooth laws of no family within the noise, three times of
8 worlds of seed 2060, with 1.7 to 2.3 periods)."""
WAVES = 400  # wave numbers that are tried
APART = 0.6  # periods in the way by which two that are told differ at least
A_SAMPLE = 3.0  # samples that a period takes at a usual speed, at least: what is faster is only its mean
WHOLE = 0.9  # of a turn, that a body reaches which turns on and on
CHANCE = 0.05  # with which noise alone makes one that is told; that costs time alone, as it is fitted and has to pay
ROWS, FEWEST_ROWS = 2000, 50  # transitions that are looked at, at most and at least
TURN = 2.0 * np.pi  # rad, a whole turn
EDGES = 60  # positions, between the middle and an end, at which an edge is tried
OUTER, FEWEST_BEYOND = 0.08, 8
"""Of the rows, at most, that are beyond an edge, and rows at least (of stops 1.6 to 6.8 % are; of smooth forces of
position that no family has, in seven of the nine places where an edge stood out, 9.5 % and more)."""
LEAST = 0.01
"""Of what a straight line leaves, that an edge takes off (by hand, the twelve worlds of seed 2061 with stops: 1.2 to
75 %; seventeen of seed 2060 without: less than 0.6 %, but 3 % in one, of Stribeck friction in a region)."""


def apart(simulator: Simulator, fewest: int, *states: FloatArray) -> BoolArray:
    """(N,): in which rows nothing touches in any of these states (N, S); all rows, where that leaves too few.

    Where something touches, accelerations say more of the ground than of what was left out: a few micrometres of depth
    change them by hundreds of m/s^2.
    """
    touches = [found for at in states if (found := simulator.touching(at)) is not None]
    every = np.ones(len(states[0]), dtype=np.bool_)
    free = ~np.any(touches, axis=0) if touches else every
    return free if int(free.sum()) >= fewest else every


class Sizes:
    """The places of effects, with how large things typically are there in a recording."""

    def __init__(
        self,
        recording: Recording,
        simulator: Simulator,
        parameters: Mapping[str, float],
        hidden: Collection[str] = (),
    ) -> None:
        """hidden: channels that nobody measured."""
        rows = recording.transitions()
        rows = rows.take(evenly(len(rows), ROWS_OF_SIZES))
        rows = rows.take(apart(simulator, FEWEST_WITHOUT_CONTACT, rows.states, rows.next_states))
        self._simulator, self._dt, self._parameters = simulator, recording.dt, parameters
        self._resists: dict[str, float] = {}
        self._joints = self._of_joints(rows)
        clock = [t for e in recording.episodes for t in (float(e.t[0]), float(e.t[-1]))]
        self._actions = self._of_actions(rows, max(clock) - min(0.0, min(clock)))
        self._channels = self._of_channels(rows, _trailing(recording, simulator), hidden)

    def place(self, effect: Effect, on: str) -> Place:
        """The place `on` of an effect's site."""
        if effect.site == "force" and on in self._joints:
            return self._joints[on]
        if effect.site == "actuator":
            return self._actions[on]
        if effect.site in ("sensor", "rate") and on in self._channels:
            return self._channels[on]
        if effect.site == "parameter" and on in self._simulator.parameters:
            return self._of_parameter(on)
        if (there := self._simulator.model_places.get(effect.family, {}).get(on)) is not None:
            if there.afloat:
                return self._of_axis(on, there)
            if there.along:
                return self._of_drive(on, there)
            size = there.size
            if effect.family == "armature":
                size = max(size, REFLECTED * self._resists[on])
            less = (-there.least, np.inf)
            return Place(
                on, there.unit, size, reach=there.reach, dt=self._dt, bounds=less, centre=there.centre
            )
        return Place(on, "1", dt=self._dt)

    def _of_axis(self, on: str, there: ModelPlace) -> Place:
        """Of a body that floats: how it is moved, and is thought to be, in whatever direction."""
        columns = [self._simulator.rate.index(name) for name in there.afloat]
        moved = [float(np.sqrt(np.mean((r[:, columns] ** 2).sum(axis=1)))) for r in self._rates]
        length = "m" if there.unit == "N" else "rad"
        span, speed = there.size * max(*moved, TINY), self._simulator.speed(on, self._states)
        typical = _typical(np.abs(speed), TYPICAL_QUANTILE)
        return Place(on, there.unit, length=length, span=span, speed=typical, dt=self._dt)

    def _of_drive(self, on: str, there: ModelPlace) -> Place:
        """Of a drive that turns with several coordinates: as much as moves the one that takes most."""
        names, turns = zip(*there.along, strict=True)
        joints = [self._joints[name] for name in names]
        speeds = {c.name: c.velocity for c in self._simulator.coordinates}
        columns = [self._simulator.state.index(speeds[name]) for name in names]
        speed = _typical(np.abs(self._states[:, columns] @ turns), TYPICAL_QUANTILE)
        of_rotor = max(there.size, *(REFLECTED * self._resists[name] for name in names))
        span = max(joint.span for joint in joints) if there.unit == joints[0].unit else of_rotor
        return Place(on, there.unit, length=joints[0].length, span=span, speed=speed, dt=self._dt)

    def _of_joints(self, rows: Transitions) -> dict[str, Place]:
        simulator, parameters = self._simulator, self._parameters
        rates = simulator.rates(rows.states, rows.actions, parameters)
        measured = simulator.measured_rates(rows.states, rows.next_states, rows.dt)
        self._states, self._rates = rows.states, (rates, measured)
        loaded = set(simulator.normal_force(rows.states, rates, parameters))
        means, deviations = rows.states.mean(axis=0), rows.states.std(axis=0)
        out: dict[str, Place] = {}
        for i, coordinate in enumerate(simulator.coordinates):
            unit = np.zeros((len(rows), len(simulator.coordinates)))
            unit[:, i] = 1.0
            column = simulator.rate.index(coordinate.rate)
            own, seen = rates[:, column], measured[:, column]
            mobility = simulator.rates(rows.states, rows.actions, parameters, unit)[:, column] - own
            usual = float(np.sqrt(np.mean(own**2)))
            if usual < UNFORCED * (moves := _typical(np.abs(seen), 0.5)):
                usual = moves  # nobody pushes: what it does is all that tells how large forces are
            easily = max(float(np.median(np.abs(mobility))), TINY)
            force = max(usual / easily, TINY)
            self._resists[coordinate.name] = force / max(float(np.sqrt(np.mean(seen**2))), TINY)
            missed = (seen - own) / np.where(np.abs(mobility) > 0, mobility, np.inf)
            at, speed = (simulator.state.index(n) for n in (coordinate.name, coordinate.velocity))
            q, v = rows.states[:, at], rows.states[:, speed]
            out[coordinate.name] = Place(
                coordinate.name,
                coordinate.force_unit,
                length=simulator.state.units[coordinate.name],
                span=force,
                middle=float(means[at]),
                reach=REACH * max(float(deviations[at]), TINY),
                speed=_typical(np.abs(v), TYPICAL_QUANTILE),
                dt=self._dt,
                inertia=1.0 / easily,
                loaded=coordinate.name in loaded,
                damping=coordinate.damping,
                friction=coordinate.friction,
                visited=(float(q.min()), float(q.max())),
                edges=pushed_back(q, missed),
                ripples=ripples(q, v, missed, rows.actions, self._dt, simulator.state.wraps[at]),
            )
        return out

    def _of_actions(self, rows: Transitions, lasting: float) -> dict[str, Place]:
        """lasting: how long the clock ran [s]."""
        units, coupled, out = self._simulator.action.units, self._simulator.coupled(), {}
        for on, commands in zip(self._simulator.action.names, rows.actions.T, strict=True):
            drives, strength = coupled.get(on, ("", 1.0))
            joint, span = self._joints.get(drives), _typical(np.abs(commands), TYPICAL_QUANTILE)
            place = Place(on, units[on], span=span, reach=lasting, dt=self._dt)
            if joint is not None:
                inertia = joint.inertia / abs(strength)
                place = replace(place, length=joint.length, speed=joint.speed, inertia=inertia)
            out[on] = place
        return out

    def _of_channels(self, rows: Transitions, late: set[str], hidden: Collection[str]) -> dict[str, Place]:
        """late: the channels that trail the position or the speed that they go with."""
        state = self._simulator.state
        return {
            on: Place(
                on,
                state.units[on],
                span=max(abs(self._simulator.start.get(on, 1.0)) if on in hidden else float(deviation), TINY),
                dt=self._dt,
                visited=(float(read.min()), float(read.max())),
                stands=stands(read),
                trails=on in late,
                silent=unread(read),
                read=on not in hidden,
                feeds=on in self._simulator.levels and self._feeds(rows, on),
            )
            for on, read, deviation in zip(state.names, rows.states.T, rows.states.std(axis=0), strict=True)
        }

    def _feeds(self, rows: Transitions, on: str) -> bool:
        """Whether what drains from a level goes somewhere."""
        level = np.abs(rows.states[:, self._simulator.state.index(on)])
        step = SLIGHTLY * np.maximum(level, level.mean() + TINY)
        said = passed_on(self._simulator, rows.states, rows.actions, self._parameters, on, step)
        return bool((said > 0.0).any())

    def _of_parameter(self, on: str) -> Place:
        """With its bounds as shares of what is believed of it, which is always between them, or differences from it."""
        declared, believed = self._simulator.parameters[on], self._parameters[on]
        if declared.additive:
            ends = declared.low - believed, declared.high - believed
            return Place(on, declared.unit, span=declared.additive, dt=self._dt, bounds=ends, additive=True)
        if believed == 0.0:
            return Place(on, "1", dt=self._dt, bounds=(0.0, np.inf))
        low, high = sorted((declared.low / believed, declared.high / believed))
        return Place(on, "1", dt=self._dt, bounds=(min(low, 1.0), max(high, 1.0)))


def _typical(sizes: FloatArray, quantile: float) -> float:
    """Of values (N,) >= 0: their quantile, the largest where nearly all are 0 (a command that is seldom given)."""
    usual = float(np.quantile(sizes, quantile))
    return max(usual if usual > TINY else float(sizes.max()), TINY)


def _trailing(recording: Recording, simulator: Simulator) -> set[str]:
    """The channels that surely trail the position or the speed that they go with, where both were measured."""
    out: set[str] = set()
    if recording.velocities == "differentiated":
        return out
    pieces = []
    for e in recording.episodes:
        moved = difference(e.states[1:], e.states[:-1], simulator.state)
        pieces.append((np.cumsum(np.insert(moved, 0, 0.0, axis=0), axis=0), e.states, e.t))
    for coordinate in simulator.coordinates:
        at, speed = (simulator.state.index(n) for n in (coordinate.name, coordinate.velocity))
        if which := trails([(way[:, at], states[:, speed], t) for way, states, t in pieces]):
            out.add(coordinate.velocity if which > 0 else coordinate.name)
    return out


def trails(pieces: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> int:
    """Whether a coordinate's speed surely trails its position (1), or the position the speed (-1); else 0.

    pieces: (travelled (K,), speed (K,), t (K,) s) of each episode. A speed that is read T late, or filtered with a time
    constant T, is behind by T times the acceleration; one that is off or scaled is not. Noise of either channel favours
    no sign. It hides less of what happens over several samples.
    """
    # Way, way by the speed that was read, speed and time [s].
    courses = [np.stack([way, integral(t, speed), speed, t], axis=1) for way, speed, t in pieces]
    for stride in STRIDES:
        stretches = np.concatenate([np.diff(course[::stride], axis=0) for course in courses])
        way, told, change, lasting = stretches[stretches[:, 3] > 0.0].T
        causes = np.stack([change / lasting, told / lasting, np.ones_like(told)], axis=1)
        if len(way) < FEWEST or np.linalg.matrix_rank(causes) < causes.shape[1]:
            continue
        behind, inverse = (way - told) / lasting, np.linalg.inv(causes.T @ causes)
        found = inverse @ causes.T @ behind
        error = np.sqrt(inverse[0, 0] * float(np.mean((behind - causes @ found) ** 2)))
        if abs(found[0]) > max(SURELY * error, BRIEF * float(np.median(lasting))):
            return int(np.sign(found[0]))
    return 0


def ripples(
    q: FloatArray, speed: FloatArray, force: FloatArray, actions: FloatArray, dt: float, wraps: bool
) -> tuple[tuple[float, float], ...]:
    """(period, phase) of the strongest ripples of a force (N,) along q (N,), which may be an angle that wraps.

    actions: (N, A). Nothing where too little moves, or where noise would make as strong a one.
    """
    pick = np.linspace(0, len(q) - 1, min(len(q), ROWS)).astype(int)
    q, speed, force, actions = q[pick], speed[pick], force[pick], actions[pick]
    way = TURN if wraps else float(np.ptp(q))
    usual = float(np.median(np.abs(speed)))
    if len(q) < FEWEST_ROWS or way <= 0.0 or usual <= 0.0:
        return ()
    x, v = (a / max(float(np.std(a)), 1e-300) for a in (q - q.mean(), speed))
    smooth = [np.ones_like(x), x, x**2, x**3, v, v * np.abs(v), np.sign(v), np.sin(q), np.cos(q), *actions.T]
    left = _unlike(np.stack(smooth, axis=1), force)
    low, high = np.quantile(q, [0.01, 0.99])
    seen = max(float(high - low) / way, 1.0 / SHORTEST)
    least = 1.0 if wraps and seen > WHOLE else REPEATS / seen  # one of a body that turns on and on
    most = min(SHORTEST, way / (A_SAMPLE * usual * dt))
    if most < least:
        return ()
    counts = np.arange(np.ceil(least), most + 1.0) if wraps else np.linspace(least, most, WAVES)
    found: list[tuple[float, float, float]] = []
    for count in counts:
        angle = TURN * count * q / way
        columns = np.stack([np.sin(angle), np.cos(angle)], axis=1)
        size, *_ = np.linalg.lstsq(columns, left, rcond=None)
        found.append((float((columns @ size) @ left), count, float(np.arctan2(size[1], size[0]))))
    of_noise = 2.0 * np.log(len(counts) / CHANCE) * float(np.mean(left**2))  # the largest of so many
    if max(found)[0] < of_noise:
        return ()
    chosen: list[tuple[float, float]] = []
    for _, count, phase in sorted(found, reverse=True):
        if len(chosen) < FOUND and all(abs(count - way / period) >= APART for period, _ in chosen):
            chosen.append((way / count, phase))
    return tuple(chosen)


def pushed_back(q: FloatArray, force: FloatArray) -> tuple[float | None, float | None]:
    """Where, towards the lower and the upper end of the way q (N,), a missed force (N,) begins to point inward.

    None where it does not.
    """
    below, above = _edge(-q, -force), _edge(q, force)
    return None if below is None else -below, above


def _edge(q: FloatArray, force: FloatArray) -> float | None:
    """The position beyond which a force falls off a straight line of positions; None where chance makes as much.

    Nor where that is no end: what bends long before is a law of the position.
    """
    line = np.stack([np.ones_like(q), q - q.mean()], axis=1)
    best, edge = max(LEAST, 2.0 * float(np.log(EDGES / CHANCE)) / len(q)), float("inf")
    left = _unlike(line, force)
    for at in np.linspace(float(np.median(q)), float(q.max()), EDGES + 1)[:-1]:
        beyond = np.maximum(q - at, 0.0)
        if np.count_nonzero(beyond) < FEWEST_BEYOND:
            break
        depth = _unlike(line, beyond)
        along = float(depth @ left)
        share = along**2 / max(float((depth @ depth) * (left @ left)), 1e-300)
        if along < 0.0 and share > best:
            best, edge = share, float(at)
    return edge if 0 < np.count_nonzero(q > edge) <= OUTER * len(q) else None


def _unlike(line: FloatArray, values: FloatArray) -> FloatArray:
    """(N,) what no combination of the columns (N, C) makes of values."""
    return np.asarray(values - line @ np.linalg.lstsq(line, values, rcond=None)[0])
