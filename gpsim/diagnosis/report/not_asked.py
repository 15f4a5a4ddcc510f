"""What a recording cannot be asked: which families were left out, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Because = Literal[
    "no command",
    "constant command",
    "constant",
    "held",
    "not needed",
    "estimated",
    "known",
    "asked",
    "does nothing",
    "nothing touches",
]


@dataclass(frozen=True, kw_only=True)
class NotAsked:
    """Something that the recording does not show, or that the user has settled, and what is left out for it.

    because: a command that was not recorded and is taken as 0, or that never changes; a state that never changes, is
    held still, was not measured and is not needed, or was not measured and is estimated; a parameter that the user
    knows; a family that the user did not ask for; an effect that is required and does nothing; or a geom that nothing
    touches. channel: of which; value: where it stands, None where nothing does; families: those that are left out,
    empty where none are.
    """

    because: Because
    channel: str
    value: float | None = None
    unit: str = ""
    families: tuple[str, ...] = ()
