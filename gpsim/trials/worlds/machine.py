"""A whole machine, as plain data: its class, and the recordings that were made of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Values = Mapping[str, float]


@dataclass(frozen=True)
class Session:
    """One recording of a machine.

    changes: name of an effect -> its values in this recording, where they are not the machine's own. zeros: channel ->
    what its sensor adds, where that changes nothing of the motion; clock: s that its clock shows at its start.
    """

    excitation: str
    posture: str
    episodes: int
    steps: int
    clock: float = 0.0
    zeros: Values = field(default_factory=dict)
    changes: Mapping[str, Values] = field(default_factory=dict)


@dataclass(frozen=True)
class Machine:
    """What kind of machine a world is. positions_only: no velocity is in its recordings; sessions: the recordings."""

    kind: str
    positions_only: bool
    sessions: tuple[Session, ...]


def machine_json(machine: Machine) -> dict[str, Any]:
    """Plain data."""
    plain = [
        {k: _plain(v) if isinstance(v, Mapping) else v for k, v in vars(s).items()} for s in machine.sessions
    ]
    return {"kind": machine.kind, "positions_only": machine.positions_only, "sessions": plain}


def machine_from_json(data: Mapping[str, Any]) -> Machine:
    """The inverse of `machine_json`."""
    return Machine(data["kind"], data["positions_only"], tuple(Session(**s) for s in data["sessions"]))


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    return {k: dict(v) if isinstance(v, Mapping) else float(v) for k, v in values.items()}
