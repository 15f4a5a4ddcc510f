"""Angles that are not what they are said to be: degrees under the name of radians, or counted from the other side.

No physics is missing then, and no search for it ends well. Asked for first: how fast a position moves against what its
velocity says, and how well the base simulator explains the rates with the angles converted.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.diagnosis.settings import LogFactSettings
from gpsim.effects import closed
from gpsim.errors import UsageError
from gpsim.recordings import Recording, Transitions, evenly
from gpsim.simulators import Coordinate, Parameters, Simulator

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
SURE = "if it is right, say diagnose.log_facts.angles=false"


@dataclass(frozen=True)
class Reading:
    """What some channels may be: `said` of them, and what makes of the numbers in the log the simulator's.

    scale, shift: channel -> factor, and what is added then.
    """

    said: str
    scale: Mapping[str, float]
    shift: Mapping[str, float]
    remedy: str

    def of(self, states: FloatArray, names: Sequence[str]) -> FloatArray:
        """(N, S) the states, read in this way."""
        factors = np.array([self.scale.get(name, 1.0) for name in names])
        return np.asarray(states * factors + np.array([self.shift.get(name, 0.0) for name in names]))


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
                f"{pair[0]} moves {ratio:.3g} times as fast as {pair[1]} says: {wrong} is in degrees, while the "
                f"simulator's angles are radians; {REMEDY}; {SURE}"
            )


def _check_rates(rows: Transitions, simulator: Simulator, parameters: Parameters) -> None:
    """Rates that the base explains hardly as the angles are said to be, and well as they might be."""
    usual = _unexplained(rows, simulator, parameters, Reading("", {}, {}, ""))
    if usual.max(initial=0.0) < HARDLY_FORESEEN:
        return
    for reading in _readings(simulator):
        left = _unexplained(rows, simulator, parameters, reading)
        better = (usual >= HARDLY_FORESEEN) & (left <= WELL_FORESEEN)
        if better.any() and not (left > usual + WELL_FORESEEN).any():
            worst = int(np.argmax(np.where(better, usual - left, -np.inf)))
            raise UsageError(
                f"{reading.said}: read so, the simulator explains {_percent(left[worst])} of "
                f"{simulator.rate.names[worst]}, as it is {_percent(usual[worst])}; {reading.remedy}; {SURE}"
            )


def _readings(simulator: Simulator) -> Iterator[Reading]:
    """All angles at once, and each of several by itself: in degrees, and from the other side."""
    angles = [channel.name for channel in simulator.state if channel.unit == "rad"]
    speeds = {c.name: c.velocity for c in simulator.coordinates}
    for some in ([angles] if angles else []) + ([[name] for name in angles] if len(angles) > 1 else []):
        both = [*some, *(speeds[name] for name in some if name in speeds)]
        names, many = " and ".join(both), len(both) > 1
        scale = dict.fromkeys(both, 1.0 / DEGREES)
        yield Reading(f"{names} {'seem' if many else 'seems'} to be in degrees", scale, {}, REMEDY)
    for name in angles:
        said = f"{name} seems to be counted from 180 degrees away"
        yield Reading(
            said, {}, {name: math.pi}, f"add or take off pi, so that {name} is 0 where the model's is"
        )


def _unexplained(
    rows: Transitions, simulator: Simulator, parameters: Parameters, reading: Reading
) -> FloatArray:
    """(R,) by rate, which part of the measured one the base leaves: 0 all explained, 1 nothing."""
    names = simulator.state.names
    states, following = (reading.of(x, names) for x in (rows.states, rows.next_states))
    with np.errstate(all="ignore"):
        measured = simulator.measured_rates(states, following, rows.dt)
        missed = measured - simulator.rates(states, rows.actions, parameters)
    usual = np.median(np.abs(measured - np.median(measured, axis=0)), axis=0)
    left = np.median(np.abs(missed), axis=0) / np.maximum(usual, 1e-12)
    return np.asarray(np.where(np.isfinite(left), np.minimum(left, 1.0), 1.0))


def _percent(left: float) -> str:
    return f"{100.0 * (1.0 - left):.0f} %"
