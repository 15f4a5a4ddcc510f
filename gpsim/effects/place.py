"""Where an effect may act, and how large its parameters are: bounds, starts of a fit, and what machines usually have.

A plausible range is broad: what lies within it is as good as any other size. Beyond it a size is possible and
implausible, so that an explanation that needs it gives way to a plausible one that does as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

Of = Literal[
    "1",
    "size",
    "speed",
    "size / speed",
    "size / speed^2",
    "size / reach",
    "size / reach^3",
    "1 / reach",
    "step",
]
"""In what a range is counted: plain, or by how large things are where the effect acts (see `Place`)."""


LEAST = 1e-6  # of the usual range's lower end: a size of 0 is no further out
EXACT = 1e-3  # of the range that was read: how far an end may lie from where readings stand


@dataclass(frozen=True)
class EffectParameter:
    """One parameter of an effect at a place: unit, bounds, values to start a fit from, its typical size.

    none: the value at which the effect does nothing (where there is one). step: of finite differences, where the
    law jumps and only a coarse difference sees a slope. falls: whether the effect is weaker the larger it is: a limit.
    place: whether it says where the effect acts, and not how much it does. plausible: the sizes that machines have, in
    its unit, None where nobody says so (see `Plausible`). paired: whether its starts go with those of the
    parameter before it, one by one, and not with each of them. exact: the 90 % interval that the recording itself
    gives, None where a fit does; its bounds are then none of a search. believed: the value that another look at the
    recording gave, and its deviation, which a fit begins with and weighs.
    """

    name: str
    unit: str
    low: float
    high: float
    starts: tuple[float, ...]
    scale: float
    none: float = 0.0
    step: float | None = None
    falls: bool = False
    place: bool = False
    plausible: tuple[float, float] | None = None
    paired: bool = False
    exact: tuple[float, float] | None = None
    believed: tuple[float, float] | None = None


def longest_delay(dt: float) -> float:
    """[s] at a recording's step [s]: 12 steps, on fast clocks up to 0.4 s (windows remember 80 steps)."""
    return max(12 * dt, min(0.4, 60 * dt))


@dataclass(frozen=True)
class Place:
    """Where an effect may act: the name it acts on, and how large things typically are there.

    unit: of a force on the coordinate, of the action, channel or parameter; length: of a coordinate's position. span:
    the typical size of that quantity in the recording (for a coordinate: of the force). middle: of a coordinate's
    positions; reach: their range, or of time [s] (for actions). visited: from where to where a coordinate or a channel
    went; edges: where something begins to push a coordinate back towards either end of that, None where nothing does,
    nan where nobody looked; stands: whether a channel's readings stand at either end; trails: whether a channel trails
    the position or the speed that it goes with; silent: the least reading of a channel that has zeros and nothing
    between, and how far apart such readings are; ripples: (period, phase) of what a scan over a coordinate's positions
    found; read: whether a channel was measured; feeds: whether another rises with it. speed: the typical speed of a
    coordinate, or of the one that an action drives. dt: the recording's step [s].
    loaded: a normal force is known. bounds: of a parameter, as shares of what is believed, or of a difference from it
    where that is what counts (`additive`). inertia: what an action has to move, command over acceleration. centre: of
    a body, in its frame. damping, friction: what the simulator itself has of a coordinate's, which may be less in
    truth.
    """

    on: str
    unit: str
    span: float = 1.0
    middle: float = 0.0
    reach: float = 1.0
    speed: float = 1.0
    dt: float = 0.02
    loaded: bool = False
    bounds: tuple[float, float] = (0.0, np.inf)
    length: str = ""
    additive: bool = False
    inertia: float = 1.0
    centre: tuple[float, ...] = ()
    damping: float = 0.0
    friction: float = 0.0
    visited: tuple[float, float] | None = None
    edges: tuple[float | None, float | None] = (np.nan, np.nan)
    stands: tuple[bool, bool] = (True, True)
    trails: bool = True
    silent: tuple[float, float] | tuple[()] = ()
    ripples: tuple[tuple[float, float], ...] = ()
    read: bool = True
    feeds: bool = False

    @property
    def longest_delay(self) -> float:
        """What a delay may be at most [s]."""
        return longest_delay(self.dt)

    @property
    def position_unit(self) -> str:
        """The unit of a coordinate's position; where nobody said, what usually goes with the unit of its force."""
        return self.length or ("m" if self.unit == "N" else "rad")

    def reading_end(self, name: str, *, highest: bool) -> EffectParameter:
        """Where a channel's readings stand at an end: the recording itself says it, to a thousandth of their range."""
        low, high = self.visited or (self.middle - self.reach, self.middle + self.reach)
        end, near = high if highest else low, EXACT * max(high - low, 1e-9)
        ends = end - near, end + near
        return EffectParameter(name, self.unit, *ends, (end,), near, place=True, exact=ends)

    @property
    def rest_position(self) -> EffectParameter:
        """Where a spring rests, looked for within reach."""
        reach = 5 * self.reach
        return EffectParameter(
            "rest_position",
            self.position_unit,
            self.middle - reach,
            self.middle + reach,
            (self.middle,),
            0.3 * self.reach,
            place=True,
        )


UNITS: Mapping[Of, Callable[[Place], float]] = {
    "1": lambda place: 1.0,
    "size": lambda place: place.span,
    "speed": lambda place: place.speed,
    "size / speed": lambda place: place.span / place.speed,
    "size / speed^2": lambda place: place.span / place.speed**2,
    "size / reach": lambda place: place.span / place.reach,
    "size / reach^3": lambda place: place.span / place.reach**3,
    "1 / reach": lambda place: 1.0 / max(place.reach, 1e-9),
    "step": lambda place: place.dt,
}


@dataclass(frozen=True)
class Plausible:
    """The range of a parameter's size.

    low, high: in units of what `of` says; low is 0 where a size counts from the value that does nothing, and more where
    its ratio counts, as of a mass. least: what the upper end is at least, in the parameter's unit. source: who says so.
    """

    low: float
    high: float
    of: Of
    source: str
    least: float = 0.0

    def at(self, place: Place) -> tuple[float, float]:
        """The range at a place, in the parameter's unit."""
        unit = UNITS[self.of](place)
        return self.low * unit, max(self.high * unit, self.least)


def times_beyond(parameter: EffectParameter, value: float) -> float:
    """By which factor a size lies outside of the usual ones; 1 within them, and where nobody says what is usual."""
    if parameter.plausible is None:
        return 1.0
    low, high = parameter.plausible
    size = value if low > 0.0 else abs(value - parameter.none)  # a ratio below 0 turns things round
    if size > high:
        return size / high
    return low / max(size, LEAST * low) if size < low else 1.0
