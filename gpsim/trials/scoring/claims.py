"""What the effects of a diagnosis or of an answer claim: families and places, and which of them it stands by."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from gpsim.trials import outside
from gpsim.trials.blinding import Answer

Json = Mapping[str, Any]
Identity = tuple[str, str]
Claim = frozenset[Identity]
WRONG_ODDS = 10.0  # a wrong name asserted with odds above this counts as such
FACTORS = (
    "gain",
    "ratio",
    "scale",
    "gain_positive",
    "gain_negative",
)  # they change nothing at 1, others at 0


def identity(effect: Json) -> Identity:
    """Family and place of an effect; several places are joined."""
    on = effect["on"]
    return str(effect["family"]), on if isinstance(on, str) else ",".join(map(str, on))


def claims_of(effects: Sequence[Json]) -> Claim:
    """What a list of effects claims."""
    return frozenset(identity(e) for e in effects)


def families_of(claims: Claim) -> tuple[str, ...]:
    """The families of claims, each as often as it is claimed."""
    return tuple(sorted(family for family, _ in claims))


def listed(claims: Claim) -> list[list[str]]:
    """Claims as JSON has them."""
    return sorted(map(list, claims))


def words_of(effects: Sequence[Json]) -> set[Identity]:
    """What the catalogue calls those effects of an answer whose kinds have become its words."""
    kinds = [(outside.EVERY_KIND[e["family"]].family, str(e["on"])) for e in effects if e["outside"]]
    return {(family, on) for family, on in kinds if family}


def headline_of(effects: Sequence[Json]) -> list[Json]:
    """The effects whose role is headline; all of a diagnosis that knows no roles (gpsim.diagnosis/1)."""
    return [e for e in effects if e.get("role", "headline") == "headline"]


def said_share(report: Json) -> float | None:
    """The share of the mismatch that a diagnosis says it explains."""
    told: float | None = ((report.get("explained") or {}).get("rollout") or {}).get("share")
    return told


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


def is_part(effect: Json, names: set[str]) -> bool:
    """Whether an effect is in a combination, which names its parameters."""
    family, on = identity(effect)
    return any(name.startswith(f"{family} on {on}: ") for name in names)


def is_combined(effect: Json, truth: Claim, combined: Sequence[set[str]]) -> bool:
    """Whether what was said is told to be inseparable of something that is there."""
    there = [{"family": f, "on": on} for f, on in truth]
    return any(is_part(effect, names) and any(is_part(e, names) for e in there) for names in combined)


def opened(answer: Answer, equal: Sequence[Claim] | set[Claim] = (), **more: Any) -> dict[str, Any]:
    """What the score of any world begins with; equal: what is as right as the truth."""
    return {
        "stratum": str(answer.content["stratum"]),
        "visible": True,
        "identifiable": not equal,
        "equivalents": sorted(map(listed, equal)),
        "truth": listed(frozenset(answer.claims)),
    } | more


def failed(**more: Any) -> dict[str, Any]:
    """What is said of a missing report: it is wrong in all."""
    wrong = dict.fromkeys(("right", "verdict_right", "leading_right", "families_right"), False)
    return {"verdict": "failed", "said": []} | wrong | more


def spurious_of(effects: Sequence[Json]) -> dict[str, Any]:
    """How many effects were told that are not there, and which."""
    return {"spurious": len(effects), "spurious_names": sorted(list(identity(e)) for e in effects)}


def parameter_errors(truth: Sequence[Json], said: Sequence[Json]) -> list[dict[str, Any]]:
    """Errors of the parameters of every true effect that was said; whether their intervals hold them.

    Errors are relative to a value and to what it changes.
    """
    found = {identity(e): e["parameters"] for e in said}
    out = []
    for effect in truth:
        for name, value in effect["parameters"].items():
            given = found.get((effect["family"], effect["on"]), {}).get(name)
            if given is None:
                continue
            covered = given["low"] is not None and given["low"] <= value <= given["high"]
            error, neutral = abs(given["value"] - value), 1.0 if name in FACTORS else 0.0
            # Where zero is an arbitrary point, an error relative to the value says nothing.
            arbitrary = name == "rest_position" or (effect["family"] == "payload" and name in "xyz")
            out.append(
                {
                    "family": effect["family"],
                    "name": name,
                    "relative_error": error / max(abs(value), 1e-300),
                    "error_of_effect": error / max(abs(value - neutral), 1e-300),
                    "covered": bool(covered),
                    "has_scale": not arbitrary,
                }
            )
    return out
