"""Channels: every column of every array in gpsim is a named scalar with a unit."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gpsim.errors import UsageError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Channel:
    """One named scalar with a unit; `wraps` marks an angle that is only known modulo 2 pi."""

    name: str
    unit: str
    wraps: bool = False


@dataclass(frozen=True)
class Channels:
    """An ordered set of channels: the columns of an array."""

    items: tuple[Channel, ...]

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.items):
            raise UsageError(f"channel names must be unique, got {', '.join(self.names)}")

    @classmethod
    def of(cls, units: Mapping[str, str], wraps: Iterable[str] = ()) -> Channels:
        """Build channels from a mapping of name to unit; `wraps` names the angles."""
        angles = set(wraps)
        return cls(tuple(Channel(name, unit, name in angles) for name, unit in units.items()))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The channels' names in column order."""
        return tuple(channel.name for channel in self.items)

    @property
    def units(self) -> dict[str, str]:
        """Name to unit, in column order."""
        return {channel.name: channel.unit for channel in self.items}

    @cached_property
    def wraps(self) -> BoolArray:
        """Boolean (C,), not writable: which columns are angles modulo 2 pi."""
        wraps = np.array([channel.wraps for channel in self.items], dtype=np.bool_)
        wraps.setflags(write=False)
        return wraps

    def index(self, name: str) -> int:
        """Column of the channel `name`; raises UsageError with the alternatives."""
        if name not in self.names:
            raise UsageError(f"no channel '{name}'; there are: {', '.join(self.names)}")
        return self.names.index(name)

    def same_as(self, other: Channels) -> bool:
        """Whether the columns are the same, by name and unit and in this order; an angle may wrap in one only."""
        return list(self.units.items()) == list(other.units.items())

    def listed(self) -> str:
        """For messages: (x [m], theta [rad])."""
        return "(" + ", ".join(f"{channel.name} [{channel.unit}]" for channel in self.items) + ")"

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Channel]:
        return iter(self.items)

    def __add__(self, other: Channels) -> Channels:
        return Channels(self.items + other.items)


def columns_beside(names: Sequence[str], others: Collection[str], prefix: str) -> list[str]:
    """What a table calls `names` beside its `others` columns: a name that is taken gets `prefix.` before it.

    As often as it takes to be unlike all others; the same names always get the same columns.
    """
    columns: list[str] = []
    for name in names:
        column = name
        while column in others or column in columns or (column != name and column in names):
            column = f"{prefix}.{column}"
        columns.append(column)
    return columns


def wrap_angle(angle: FloatArray) -> FloatArray:
    """Map angles [rad] to [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi, dtype=np.float64)


def difference(after: FloatArray, before: FloatArray, channels: Channels) -> FloatArray:
    """After - before, (..., C), the short way round for channels that wrap."""
    delta = np.asarray(after - before, dtype=np.float64)
    if channels.wraps.any():
        angles = delta[..., channels.wraps]
        beyond = ~((angles >= -np.pi) & (angles < np.pi))
        if beyond.any():  # a division with remainder costs ten times as much as to see that it is not needed
            angles[beyond] = wrap_angle(angles[beyond])
            delta[..., channels.wraps] = angles
    return delta
