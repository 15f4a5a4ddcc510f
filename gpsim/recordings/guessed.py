"""What a log is compared with, and what was guessed of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gpsim.channels import Channels

VEHICLE = ("x", "y", "yaw")


@dataclass(frozen=True)
class System:
    """What a log is compared with. velocities: velocity -> the position it is of; optional: need not be recorded.

    drives: action -> the joint that it moves; model: the file of a system that a recording calls `recorded_as`.
    """

    name: str
    state: Channels
    action: Channels
    velocities: Mapping[str, str]
    optional: tuple[str, ...] = ()
    drives: Mapping[str, str] = field(default_factory=dict)
    recorded_as: str = ""
    model: str | None = None

    @property
    def is_vehicle(self) -> bool:
        """Whether its state is a pose in the plane."""
        return self.state.names == VEHICLE


@dataclass
class Guess:
    """A mapping, and how it came about.

    taken: channel -> source as it is typed; missing: channels for which nothing sure was found, with what might be
    theirs; unclear: channels whose source is likely, with the others; typed: every channel is told by the type of a
    message; switch: a source that may say when the motors were on, and the words that cut the log by it; fit: how well
    the names fit, summed.
    """

    system: System
    raw: dict[str, Any]
    taken: dict[str, str] = field(default_factory=dict)
    missing: dict[str, list[str]] = field(default_factory=dict)
    unclear: dict[str, list[str]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    typed: bool = True
    switch: tuple[str, str] | None = None
    fit: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether nothing is left to ask."""
        return not self.missing and not self.unclear
