"""Log facts: what is peculiar to a log and no physics, found in the recording alone, whatever the simulator.

Missing rows and an uneven clock are counted, windows know of them. A channel's grid is noise of a known size. Samples
that repeat an old value or leap away and come back say nothing of the motion: no likelihood, no step and no rollout
rests on them; where a state is needed there it is read between its neighbours. Whether a topic is late is not told
here: from one recording a late channel cannot be told from a late sensor, which is an effect of the catalogue
(`sensor_delay`); nor are clocks that drift apart, which an importer has put on one clock already.

Angles that are not what they are said to be, degrees under the name of radians, or counted from the other side, are
asked for first: no physics is missing then, and no search for it ends well. How fast a position moves is held against
what its velocity says, and the rates against what the base simulator says with the angles converted.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gpsim.channels import BoolArray, Channel, Channels, FloatArray, wrap_angle
from gpsim.diagnosis.data import held_with, outliers, quantum, repeats, whole_packets
from gpsim.diagnosis.settings import LogFactSettings
from gpsim.effects import closed
from gpsim.errors import UsageError
from gpsim.findings import LogFact
from gpsim.recordings import Episode, Recording, Transitions, evenly, gaps, pieces
from gpsim.simulators import Coordinate, Parameters, Simulator

CLOCK_JITTER = 0.01  # of the clock's step, by which steps must scatter to be uneven
QUANTISED = 1.0 / np.sqrt(12.0)  # standard deviation of what rounding to a grid of 1 leaves over

FEWEST = 10  # readings of one value: fewer are chance
AS_MANY = 5  # times as many as have the next value: at a turning point of a coarse signal they are 2.4 times as many
HOLLOW = 5  # times the usual step between small readings that the least of them is away from 0
SMALL = 20  # readings that tell this usual step

FEWEST_ROWS = 20  # transitions with fewer nothing is asked
MOST_ROWS = 2000  # transitions that the base is compared at, at most
MOST_SCATTER = 0.1
"""Of the ratio of a position's speed and its velocity: a unit is a matter of 57.3, noise of less."""
HARDLY_FORESEEN = 0.6
"""Of a rate, that the base leaves at least as the angle is said to be (a missing effect may do that, and none of them
is mended by another unit)."""
WELL_FORESEEN = 0.25  # of the same rate, that it leaves at most with the angle read otherwise

DEGREES = math.degrees(1.0)  # of a radian: the factor between the two units
REMEDY = "multiply by pi/180, or import the log with NAME=deg*COLUMN"
SURE = "if it is correct, set diagnose.log_facts.angles=false"


@dataclass(frozen=True)
class LogLook:
    """What a log is like.

    facts: in the order of the channels, those of the whole log last; left_out: of each episode (K + 1, S) the samples
    on which nothing may rest; quantised: channel -> its grid's step, in its unit.
    """

    facts: tuple[LogFact, ...]
    left_out: tuple[BoolArray, ...]
    quantised: dict[str, float]


@dataclass(frozen=True)
class _Stretch:
    """Samples without a gap between them: `first` of an episode (its number) on; states with angles running on."""

    episode: int
    first: int
    t: FloatArray
    states: FloatArray
    actions: FloatArray

    @property
    def rows(self) -> slice:
        """Where in its episode."""
        return slice(self.first, self.first + len(self.t))


def look_at(recording: Recording, settings: LogFactSettings) -> LogLook:
    """Everything that is peculiar to a recording, channel by channel."""
    stretches = list(_stretches(recording))
    actions = [s.actions for s in stretches]
    grids = [quantum([s.states[:, i] for s in stretches], actions) for i in range(len(recording.state))]
    stale, wild = _samples(recording, stretches, grids, settings)
    facts: list[LogFact] = []
    for i, channel in enumerate(recording.state):
        repeated, leaps = (sum(int(f[:, i].sum()) for f in flags) for flags in (stale, wild))
        facts += [LogFact("repeated", channel.name, repeated)] if repeated else []
        facts += [LogFact("outliers", channel.name, leaps)] if leaps else []
        facts += [LogFact("quantised", channel.name, value=grids[i], unit=channel.unit)] if grids[i] else []
    left_out = [np.zeros(e.states.shape, dtype=np.bool_) for e in recording.episodes]
    for s, old, out in zip(stretches, stale, wild, strict=True):
        left_out[s.episode][s.rows] = old | out
    quantised = {name: step for name, step in zip(recording.state.names, grids, strict=True) if step}
    return LogLook((*facts, *_of_the_clock(recording)), tuple(left_out), quantised)


def _samples(
    recording: Recording,
    stretches: Sequence[_Stretch],
    grids: Sequence[float | None],
    settings: LogFactSettings,
) -> tuple[list[BoolArray], list[BoolArray]]:
    """(K, S) of each stretch, which samples are stale, and which are outliers."""
    stale, wild = ([np.zeros(s.states.shape, dtype=np.bool_) for s in stretches] for _ in range(2))
    actions = [s.actions for s in stretches]
    for i, channel in enumerate(recording.state):
        series, step = [s.states[:, i] for s in stretches], grids[i] or 0.0
        found = outliers(series, actions, step, _angle(channel), settings)
        for s, y, flags, out, old in zip(stretches, series, found, wild, stale, strict=True):
            out[:, i], old[:, i] = flags, repeats(s.t, y, step, settings)
    hidden = hiding(recording)
    for s, old, out in zip(stretches, stale, wild, strict=True):
        together = old.any(axis=1) | whole_packets(s.t, s.states, settings)
        for i in range(len(grids)):
            old[:, i] |= held_with(together, s.states[:, i], grids[i] or 0.0)
        out &= ~old  # in a steady motion what stands still leaps away, too
        # What a sensor does at its range's end, or in its zone, is no packet's fault.
        old &= ~hidden[s.episode][s.rows]
        out &= ~hidden[s.episode][s.rows]
    return stale, wild


def mended(recording: Recording, left_out: tuple[BoolArray, ...]) -> Recording:
    """The recording whose left-out samples count for nothing and lie between their neighbours."""
    if not any(flags.any() for flags in left_out):
        return recording
    pairs = zip(recording.episodes, left_out, strict=True)
    return replace(recording, episodes=tuple(_mended(e, flags, recording.state) for e, flags in pairs))


def _mended(episode: Episode, left_out: BoolArray, channels: Channels) -> Episode:
    states = np.array(episode.states)
    for i, channel in enumerate(channels):
        kept = ~left_out[:, i]
        if kept.all() or not kept.any():
            continue
        y = np.unwrap(states[kept, i]) if _angle(channel) else states[kept, i]
        between = np.interp(episode.t[~kept], episode.t[kept], y)
        states[~kept, i] = wrap_angle(between) if channel.wraps else between
    given = np.ones(left_out.shape) if episode.weights is None else episode.weights
    return replace(episode, states=states, weights=np.where(left_out, 0.0, given))


def _stretches(recording: Recording) -> Iterator[_Stretch]:
    for index, episode in enumerate(recording.episodes):
        ends = np.flatnonzero(gaps(episode.t, recording.dt)).tolist()
        for first, last in pieces(ends, len(episode)):
            states = np.array(episode.states[first : last + 1])
            for i, channel in enumerate(recording.state):
                if _angle(channel):
                    states[:, i] = np.unwrap(states[:, i])
            yield _Stretch(index, first, episode.t[first : last + 1], states, episode.actions[first:last])


def _angle(channel: Channel) -> bool:
    """Whether a channel may wrap, as windows take it."""
    return channel.wraps or channel.unit == "rad"


def _of_the_clock(recording: Recording) -> list[LogFact]:
    """Rows that are missing, and an uneven clock."""
    facts, dt, times = [], recording.dt, [e.t for e in recording.episodes]
    lost = sum(int((np.rint(np.diff(t)[gaps(t, dt)] / dt) - 1).sum()) for t in times)
    if lost:
        longest = max(float(np.diff(t).max(initial=0.0)) for t in times)
        facts.append(LogFact("missing", count=lost, value=longest, unit="s"))
    steps = np.concatenate([np.diff(t)[~gaps(t, dt)] for t in times])
    scatter = float(steps.std()) if len(steps) else 0.0
    if scatter > CLOCK_JITTER * dt:
        facts.append(LogFact("jitter", value=scatter, unit="s"))
    return facts


def contacts(simulator: Simulator, recording: Recording) -> tuple[LogFact, ...]:
    """In how many samples something touches, if it does in any."""
    found = simulator.touching(np.concatenate([e.states for e in recording.episodes]))
    count = 0 if found is None else int(found.sum())
    return (LogFact("touching", count=count),) if count else ()


def stands(readings: FloatArray) -> tuple[bool, bool]:
    """Whether many readings (N,) have the lowest, and the highest, value of all."""
    counts = np.unique(readings, return_counts=True)[1]
    if len(counts) < 3:
        return False, False
    many = counts[[0, -1]] >= np.maximum(FEWEST, AS_MANY * counts[[1, -2]])
    return bool(many[0]), bool(many[1])


def unread(readings: FloatArray) -> tuple[float, float] | tuple[()]:
    """The least size of readings (N,) that are not 0, and the mean distance of small ones; nothing where few are 0."""
    sizes = np.unique(np.abs(readings))
    if len(sizes) < 3 or sizes[0] > 0.0 or (readings == 0.0).sum() < FEWEST:
        return ()
    apart = np.diff(sizes[1 : SMALL + 2])
    return (float(sizes[1]), float(apart.mean())) if sizes[1] > HOLLOW * np.median(apart) else ()


def telling(recording: Recording) -> list[BoolArray]:
    """(K + 1,) of each episode, which samples tell where the state is: no reading at its range's end, or in its zone.

    A sensor that says 0 below some size, or no more than its range, hides where a rollout would begin.
    """
    return [np.asarray(~hidden.any(axis=1)) for hidden in hiding(recording)]


def hiding(recording: Recording) -> list[BoolArray]:
    """(K + 1, S) of each episode, which readings are those that a sensor gives for many true values."""
    columns = np.concatenate([e.states for e in recording.episodes]).T
    ends = [stands(readings) for readings in columns]
    low = np.array([y.min() if lowest else -np.inf for y, (lowest, _) in zip(columns, ends, strict=True)])
    high = np.array([y.max() if highest else np.inf for y, (_, highest) in zip(columns, ends, strict=True)])
    silent = np.array([bool(unread(readings)) for readings in columns])
    states = [e.states for e in recording.episodes]
    return [(x <= low) | (x >= high) | (silent & (x == 0.0)) for x in states]


def check_angles(
    recording: Recording,
    simulator: Simulator,
    parameters: Parameters,
    settings: LogFactSettings,
    hidden: Collection[str] = (),
) -> None:
    """Raise UsageError where an angle surely is none in radians, or is counted from 180 degrees away.

    hidden: states that nobody measured, at a guess in the recording: rates are not compared then.
    """
    rows = recording.transitions()
    if not settings.angles or len(rows) < FEWEST_ROWS:
        return
    for coordinate in simulator.coordinates:
        if not {coordinate.name, coordinate.velocity} & set(hidden):
            _check_speed(recording, rows, coordinate)
    if closed(simulator) is None and not hidden:
        some = rows.take(evenly(len(rows), MOST_ROWS))
        _check_rates(some, simulator, parameters)


def _check_speed(recording: Recording, rows: Transitions, coordinate: Coordinate) -> None:
    """A position that moves 57.3 times as fast as its velocity says, or as slowly."""
    names, pair = recording.state.names, (coordinate.name, coordinate.velocity)
    if recording.velocities == "differentiated" or not set(pair) <= set(names):
        return
    position, velocity = (names.index(name) for name in pair)
    if tuple(recording.state)[position].unit != "rad":
        return
    speed = 0.5 * (rows.states[:, velocity] + rows.next_states[:, velocity])
    fast = np.abs(speed) > np.median(np.abs(speed))
    if not fast.any():
        return
    moved = (rows.next_states[:, position] - rows.states[:, position]) / rows.dt
    ratios = moved[fast] / speed[fast]
    ratio = float(np.median(ratios))
    if float(np.median(np.abs(ratios - ratio))) > MOST_SCATTER * abs(ratio):
        return
    for wrong, factor in ((pair[0], DEGREES), (pair[1], 1.0 / DEGREES)):
        if abs(ratio / factor - 1.0) < MOST_SCATTER:
            raise UsageError(
                f"{pair[0]} moves {ratio:.3g} times as fast as {pair[1]} implies: {wrong} is in degrees, but the "
                f"simulator uses radians; {REMEDY}; {SURE}"
            )


def _check_rates(rows: Transitions, simulator: Simulator, parameters: Parameters) -> None:
    """Rates that the base explains hardly as the angles are said to be, and well as they might be."""
    usual = _unexplained(rows, simulator, parameters, 1.0, 0.0)
    if usual.max(initial=0.0) < HARDLY_FORESEEN:
        return
    for said, scale, shift, remedy in _readings(simulator.state, simulator.coordinates):
        left = _unexplained(rows, simulator, parameters, scale, shift)
        better = (usual >= HARDLY_FORESEEN) & (left <= WELL_FORESEEN)
        if better.any() and not (left > usual + WELL_FORESEEN).any():
            worst = int(np.argmax(np.where(better, usual - left, -np.inf)))
            read, as_it_is = (f"{100.0 * (1.0 - float(part[worst])):.0f} %" for part in (left, usual))
            raise UsageError(
                f"{said}: with that, the simulator explains {read} of {simulator.rate.names[worst]}, without it "
                f"{as_it_is}; {remedy}; {SURE}"
            )


def _readings(
    state: Channels, coordinates: Sequence[Coordinate]
) -> Iterator[tuple[str, FloatArray | float, FloatArray | float, str]]:
    """What is said of angles that may be others, the factors (S,) and what is added (S,) then, and the remedy.

    All angles at once, and each of several by itself: in degrees, and from the other side.
    """
    angles = [channel.name for channel in state if channel.unit == "rad"]
    speeds = {c.name: c.velocity for c in coordinates}
    for some in ([angles] if angles else []) + ([[name] for name in angles] if len(angles) > 1 else []):
        both = [*some, *(speeds[name] for name in some if name in speeds)]
        said = f"{' and '.join(both)} {'seem' if len(both) > 1 else 'seems'} to be in degrees"
        yield said, np.where(np.isin(state.names, both), 1.0 / DEGREES, 1.0), 0.0, REMEDY
    for name in angles:
        said = f"{name} seems to have an offset of 180 degrees"
        shift = np.where(np.isin(state.names, [name]), math.pi, 0.0)
        yield said, 1.0, shift, f"add or subtract pi, so that {name} is 0 where that of the model is"


def _unexplained(
    rows: Transitions,
    simulator: Simulator,
    parameters: Parameters,
    scale: FloatArray | float,
    shift: FloatArray | float,
) -> FloatArray:
    """(R,) by rate, which part of the measured one the base leaves: 0 all explained, 1 nothing."""
    states, following = rows.states * scale + shift, rows.next_states * scale + shift
    with np.errstate(all="ignore"):
        measured = simulator.measured_rates(states, following, rows.dt)
        missed = measured - simulator.rates(states, rows.actions, parameters)
    usual = np.median(np.abs(measured - np.median(measured, axis=0)), axis=0)
    left = np.median(np.abs(missed), axis=0) / np.maximum(usual, 1e-12)
    return np.asarray(np.where(np.isfinite(left), np.minimum(left, 1.0), 1.0))
