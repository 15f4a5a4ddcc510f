"""What the effects of a diagnosis or of an answer claim: families and places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Json = Mapping[str, Any]
Identity = tuple[str, str]
Claim = frozenset[Identity]


def identity(effect: Json) -> Identity:
    """Family and place of an effect; several places are joined."""
    on = effect["on"]
    return str(effect["family"]), on if isinstance(on, str) else ",".join(map(str, on))


def claims_of(effects: Sequence[Json]) -> Claim:
    """What a list of effects claims."""
    return frozenset(identity(e) for e in effects)
