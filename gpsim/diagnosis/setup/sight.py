"""What of a simulator a recording shows: commands that never change, states held still, not measured, or not needed.

A free swing with the motor off, a cart that is clamped and a robot of which only the yaw is known are recordings like
others. What cannot be asked of them is left out, and said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gpsim.channels import Channels, FloatArray
from gpsim.diagnosis.setup.guesses import guess
from gpsim.errors import NoDiagnosis, UsageError
from gpsim.recordings import Episode, Recording
from gpsim.residuals import check_match
from gpsim.simulators import SIMULATORS, Coordinate, Simulator, reduced


@dataclass(frozen=True)
class Sight:
    """A simulator as a recording shows it.

    simulator: without the states that are `dropped` (nobody measured them, and no rate that was measured needs them)
    or `held` (at these values); hidden: states that are estimated; still: actions that never change, at their values;
    commanded: False where the recording holds no action, which is then 0; constant: other states that never change.
    """

    simulator: Simulator
    hidden: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)
    still: Mapping[str, float] = field(default_factory=dict)
    commanded: bool = True
    constant: tuple[str, ...] = ()

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
        episodes = tuple(
            replace(
                episode,
                states=np.stack(
                    [guess(name, episode, recording, self.simulator) for name in channels.names], axis=1
                ),
                weights=_weights(episode, recording.state.names, channels.names),
            )
            for episode in recording.episodes
        )
        noise = {n: v for n, v in recording.noise.items() if n in (*channels.names, *recording.action.names)}
        return replace(recording, state=channels, episodes=episodes, noise=noise)


def _weights(episode: Episode, recorded: Sequence[str], names: Sequence[str]) -> FloatArray | None:
    """(K + 1, S) what the samples of the states `names` weigh; those of states that nobody measured are whole."""
    if episode.weights is None:
        return None
    known = dict(zip(recorded, episode.weights.T, strict=True))
    return np.stack([known.get(name, np.ones(len(episode.t))) for name in names], axis=1)


def look(recording: Recording, simulator: Simulator) -> Sight:
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
    speeds = {c.velocity for c in simulator.coordinates}
    fixed = {n: 0.0 if n in speeds else constant.get(n, 0.0) for n in (*dropped, *held)}
    of_held = [c.name for c in simulator.coordinates if c.name in held]
    return Sight(
        reduced(simulator, fixed, of_held),
        tuple(n for n in hidden if n not in fixed),
        tuple(dropped),
        {n: fixed[n] for n in held},
        {n: constant[n] for n in shown.action.names if n in constant},
        commanded,
        tuple(n for n in recording.state.names if n in constant and n not in held),
    )


def check_moves(recording: Recording, simulator: Simulator, sight: Sight) -> None:
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
                f"moves: check the sensor, or leave {dead[0]} out of the recording and its state: it is estimated then"
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

    def stands(c: Coordinate) -> bool:
        position = c.name in constant
        return position and (c.velocity in constant or c.velocity not in recorded)

    return [n for c in simulator.coordinates if stands(c) for n in (c.name, c.velocity)]


def _not_needed(recording: Recording, simulator: Simulator, absent: Sequence[str]) -> list[str]:
    """Those of the absent states on which nothing depends that the others do: the most that can be left out together.

    By trial: each is moved, at recorded states and commands, and the others' derivatives looked at. The position of a
    velocity that was measured stays: what rubs or springs there acts on a coordinate.
    """
    moving = {c.name for c in simulator.coordinates if c.velocity in recording.state.names}
    out = [name for name in absent if name not in moving]
    while out:
        kept = [i for i, name in enumerate(simulator.state.names) if name not in out]
        needed = [name for name in out if _moves(recording, simulator, name, kept)]
        if not needed:
            return out
        out = [name for name in out if name not in needed]
    return out


def _moves(recording: Recording, simulator: Simulator, name: str, kept: Sequence[int]) -> bool:
    """Whether a state that nobody measured changes the derivatives of the states `kept`."""
    base, action = _places(recording, simulator)
    parameters = simulator.defaults()

    def slopes(state: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            return simulator.derivative(state, simulator.rates(state, action, parameters))[:, kept]

    column, there = simulator.state.index(name), slopes(base)
    for by in PROBES:
        moved = base.copy()
        moved[:, column] += by
        if not np.array_equal(slopes(moved), there, equal_nan=True):
            return True
    return False


PROBES = (1.0, -0.3)
"""By how much an absent state is moved: at two places, of which one may be special."""


def _places(recording: Recording, simulator: Simulator) -> tuple[FloatArray, FloatArray]:
    """Some recorded states, what is absent at its guess or 0.1, and commands that do something."""
    rows = recording.transitions()
    some = np.unique(np.linspace(0, max(len(rows) - 1, 0), LOOKED_AT).astype(int))[: len(rows)]
    state = np.full((len(some), len(simulator.state)), 0.1)
    for i, name in enumerate(simulator.state.names):
        if name in recording.state.names:
            state[:, i] = rows.states[some, recording.state.index(name)]
        else:
            state[:, i] = simulator.start.get(name, 0.1)
    return state, np.full((len(some), len(simulator.action)), 0.1)


LOOKED_AT = 20  # recorded states at which what is needed is looked for
