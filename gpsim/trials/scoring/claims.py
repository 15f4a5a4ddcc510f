"""What the effects of a diagnosis or of an answer claim: families and places, and which of them it stands by."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

Json = Mapping[str, Any]
Identity = tuple[str, str]
Claim = frozenset[Identity]
WRONG_ODDS = 10.0  # a wrong name asserted with odds above this counts as such


def identity(effect: Json) -> Identity:
    """Family and place of an effect; several places are joined."""
    on = effect["on"]
    return str(effect["family"]), on if isinstance(on, str) else ",".join(map(str, on))


def claims_of(effects: Sequence[Json]) -> Claim:
    """What a list of effects claims."""
    return frozenset(identity(e) for e in effects)


def headline_of(effects: Sequence[Json]) -> list[Json]:
    """The effects whose role is headline; all of a diagnosis that knows no roles (gpsim.diagnosis/1)."""
    return [e for e in effects if e.get("role", "headline") == "headline"]


def approximate(effect: Json) -> bool:
    """Whether a diagnosis says that its law does not hold."""
    return bool(effect.get("form") == "approximate")


def asserted(effect: Json) -> bool:
    """Whether an effect is said to hold, with odds above ten.

    The odds are its own, against the best that was found without it: what `ambiguous` answers have in common is
    asserted, too.
    """
    return not approximate(effect) and _odds_in_nats(effect) > math.log(WRONG_ODDS)


def _odds_in_nats(effect: Json) -> float:
    """Of an effect against the best without it; where nothing else was tried, of the whole answer."""
    nats = (effect.get("odds") or {}).get("nats")
    if nats is not None:
        return float(nats)
    probability = float(effect["probability"] or 0.0)
    return math.log(max(probability, 1e-300) / max(1.0 - probability, 1e-12))
