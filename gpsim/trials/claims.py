"""What the effects of a diagnosis or of an answer claim: families and places, gates, sizes, and which it stands by."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials import out_of_catalogue
from gpsim.trials.blinding import Answer
from gpsim.trials.judged import place_of

Json = Mapping[str, Any]
Identity = tuple[str, str]
Claim = frozenset[Identity]
WRONG_ODDS = 10.0  # a wrong name asserted with odds above this counts as such
FACTORS = ("gain", "ratio", "scale", "gain_positive", "gain_negative")  # change nothing at 1, others at 0
LEAST_IOU, LARGEST_ONSET = 0.5, 0.1  # of a region; of an onset's error as a share of the recording's duration


def identity(effect: Json) -> Identity:
    """Family and place of an effect; several places are joined."""
    return str(effect["family"]), place_of(effect["on"])


def claims_of(effects: Sequence[Json]) -> Claim:
    """What a list of effects claims."""
    return frozenset(map(identity, effects))


def listed(claims: Claim) -> list[list[str]]:
    """Claims as JSON has them."""
    return sorted(map(list, claims))


def words_of(effects: Sequence[Json]) -> set[Identity]:
    """What the catalogue calls those effects of an answer whose kinds have become its words."""
    kinds = [(out_of_catalogue.EVERY_KIND[e["family"]].word, str(e["on"])) for e in effects if e["outside"]]
    return {(family, on) for family, on in kinds if family}


def headline_of(effects: Sequence[Json]) -> list[Json]:
    """The effects whose role is headline; all of a diagnosis that knows no roles (gpsim.diagnosis/1)."""
    return [e for e in effects if e.get("role", "headline") == "headline"]


def said_share(report: Json) -> float | None:
    """The share of the mismatch that a diagnosis says it explains."""
    told: float | None = ((report.get("explained") or {}).get("rollout") or {}).get("share")
    return told


def asserted(effect: Json) -> bool:
    """Whether an effect is said to hold, with odds above ten. A measured curve is no name: it says that none fits.

    The odds are its own, against the best that was found without it: what `ambiguous` answers have in common is
    asserted, too. Where nothing else was tried they are those of the whole answer.
    """
    nats: float | None = (effect.get("odds") or {}).get("nats")
    if nats is None:
        probability = float(effect["probability"] or 0.0)
        nats = math.log(max(probability, 1e-300) / max(1.0 - probability, 1e-12))
    return not effect.get("curve") and effect.get("form") != "approximate" and nats > math.log(WRONG_ODDS)


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


def told_of(
    report: Json, said: Claim, truth: Claim, verdicts: Sequence[str], spurious: Sequence[Json], every: bool
) -> dict[str, Any]:
    """What is said of any report that is judged effect by effect; every: whether all that counts was told."""
    verdict = str(report["verdict"])
    return {
        "verdicts": sorted(verdicts),
        "verdict": verdict,
        "said": listed(said),
        **spurious_of(spurious),
        "verdict_right": verdict in verdicts,
        "leading_right": every,
        "families_right": {f for f, _ in said} >= {f for f, _ in truth},
        "right": bool(verdict in verdicts and every and not spurious),
    }


def spurious_of(effects: Sequence[Json]) -> dict[str, Any]:
    """How many effects were told that are not there, and which."""
    return {"spurious": len(effects), "spurious_names": sorted(list(identity(e)) for e in effects)}


def bounds(told: Json) -> tuple[float, float]:
    """The interval of a size that was told; one that is not known is the value alone."""
    low, high = (told["value"] if told[edge] is None else told[edge] for edge in ("low", "high"))
    return low, high


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


Gate = tuple[Identity, str | None, tuple[float, ...]]
"""Of an effect an interval of a channel, or where there is no channel the moment of its onset, once."""


def gates_of(effects: Sequence[Json]) -> list[Gate]:
    """Every gate of a list of effects."""
    found: list[Gate] = []
    for e in effects:
        found += [(identity(e), channel, tuple(edges)) for channel, edges in e["region"].items()]
        found += [] if e["since"] is None else [(identity(e), None, (e["since"],))]
    return found


def gate_figures(
    truth: Sequence[Json], said: Sequence[Json], visited: Mapping[str, tuple[float, float]], duration: float, *,
    stands_in: bool,
) -> dict[str, Any]:  # fmt: skip
    """gate_right; iou and onset_error, the worst of those that there are to be found.

    Gates are compared effect by effect: that of a true effect with the claimed effect's own, or where the effect is not
    claimed and an equivalent stands in its place (`stands_in`) with any claimed gate of the same channel. visited: from
    where to where each channel went; edges of a region beyond that are anybody's guess. duration [s]: of the recording.
    """
    true, claimed, names = gates_of(truth), gates_of(said), claims_of(said)
    pairs = [
        (t, c) for t in true for c in claimed
        if t[1] == c[1] and (t[0] == c[0] or (stands_in and t[0] not in names))
    ]  # fmt: skip
    overlaps, errors = [], []
    for gate in true:
        _, channel, wanted = gate
        answers = [c[2] for t, c in pairs if t == gate]
        if channel is None:
            errors.append(min((abs(edges[0] - wanted[0]) / duration for edges in answers), default=1.0))
        else:
            inside = [[np.clip(edges, *visited[channel]) for edges in (wanted, told)] for told in answers]
            overlaps.append(max((iou(*both) for both in inside), default=0.0))
    spurious = any(c not in [paired for _, paired in pairs] for c in claimed)
    found = all(o >= LEAST_IOU for o in overlaps) and all(e <= LARGEST_ONSET for e in errors)
    worst = ({"iou": min(overlaps)} if overlaps else {}) | ({"onset_error": max(errors)} if errors else {})
    return {"gate_right": found and not spurious, **worst}


def iou(first: FloatArray, second: FloatArray) -> float:
    """Length of the intersection of two intervals over that of their union."""
    inner = min(first[1], second[1]) - max(first[0], second[0])
    outer = max(first[1], second[1]) - min(first[0], second[0])
    return float(max(inner, 0.0) / outer) if outer > 0 else 0.0
