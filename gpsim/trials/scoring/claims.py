"""What the effects of a diagnosis or of an answer claim: families and places, and which of them it stands by."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from gpsim.trials import outside

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


def words_of(effects: Sequence[Json]) -> set[Identity]:
    """What the catalogue calls those effects of an answer whose kinds have become its words."""
    kinds = [(outside.EVERY_KIND[e["family"]].family, str(e["on"])) for e in effects if e["outside"]]
    return {(family, on) for family, on in kinds if family}


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


def of_first(report: Json) -> dict[str, Any]:
    """The report with the effects that act in the first recording, as large as they are there; its held-out episodes.

    A report of one recording stays what it is.
    """
    several = report.get("recordings")
    if not several:
        return dict(report)
    name = str(several[0]["name"])
    held = [str(n) for n in report["fit"]["held_out"]]
    mine = [n.removeprefix(f"{name}/") for n in held if n.startswith(f"{name}/")]
    return {
        **report,
        "effects": _there(report["effects"], name),
        "alternatives": [{**a, "effects": _there(a["effects"], name)} for a in report["alternatives"]],
        "fit": {**report["fit"], "held_out": mine},
    }


def _there(effects: list[Json], name: str) -> list[dict[str, Any]]:
    """Those that act in the recording, with its own values where it has some."""
    return [
        {**e, "parameters": {**e["parameters"], **(e.get("own") or {}).get(name, {})}}
        for e in effects
        if e.get("recordings") is None or name in e["recordings"]
    ]


FACTORS = (
    "gain",
    "ratio",
    "scale",
    "gain_positive",
    "gain_negative",
)  # they change nothing at 1, others at 0


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
            out.append(
                {
                    "family": effect["family"],
                    "name": name,
                    "relative_error": error / max(abs(value), 1e-300),
                    "error_of_effect": error / max(abs(value - neutral), 1e-300),
                    "covered": bool(covered),
                    # Where zero is an arbitrary point, an error relative to the value says nothing.
                    "has_scale": name != "rest_position"
                    and not (effect["family"] == "payload" and name in "xyz"),
                }
            )
    return out
