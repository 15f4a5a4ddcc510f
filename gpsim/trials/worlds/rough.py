"""How the sensors, clocks and topics of a real log differ from perfect ones, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Rough:
    """What is wrong with a recording besides noise; zero or absent where it is right.

    quantum: channel -> step of its encoder. jitter: standard deviation [s] of the stamps; drift: seconds that the
    recording's clock gains in a second. dropped, repeated, swapped: share of the rows that are missing, that say what
    the row before said, in which markers are swapped; leap: channel -> how far a swapped marker is away. late:
    channel -> s by which its topic lags behind the others.
    """

    quantum: Mapping[str, float] = field(default_factory=dict)
    jitter: float = 0.0
    drift: float = 0.0
    dropped: float = 0.0
    repeated: float = 0.0
    swapped: float = 0.0
    leap: Mapping[str, float] = field(default_factory=dict)
    late: Mapping[str, float] = field(default_factory=dict)

    @property
    def defects(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        found = {
            "quantised": self.quantum,
            "jitter": self.jitter,
            "drift": self.drift,
            "dropped": self.dropped,
            "repeated": self.repeated,
            "swapped": self.swapped,
            "late": self.late,
        }
        return tuple(name for name, there in found.items() if there)


def rough_json(rough: Rough) -> dict[str, Any]:
    """Plain data."""
    return {k: dict(v) if isinstance(v, Mapping) else v for k, v in vars(rough).items()}
