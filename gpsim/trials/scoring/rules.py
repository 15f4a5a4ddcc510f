"""What counts as right: one diagnosis against its answer. Pure functions of the two: no files, no fits.

Claims are sets of (family, place). A claim is right when it is the truth or one of the world's listed equivalents. On
plain worlds every effect counts, slight ones, too; `rough_rules` has what counts on rough ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import Rival
from gpsim.trials.scoring.claims import (
    Claim,
    Json,
    approximate,
    asserted,
    claims_of,
    headline_of,
    identity,
    parameter_errors,
    words_of,
)
from gpsim.trials.scoring.gates import failed_gates, gate_figures
from gpsim.trials.scoring.group_rules import score_robot, score_rough
from gpsim.trials.worlds import SYSTEMS

LEAST_SEEN = 0.05  # a true share below which one step cannot show in which rate the effect is
LEADING_RATE = 0.5  # a rate with at least this share of the largest true share is a right one to point at


def score(answer: Answer, report: Json | None, rivals: Sequence[Rival]) -> dict[str, Any]:
    """Everything that can be said of one diagnosis; a missing report is a failed diagnosis, wrong in all."""
    if answer.content["stratum"] == "rough":
        return score_rough(answer, report, rivals)
    if "robot" in answer.content:
        return score_robot(answer, report, rivals)
    truth = frozenset(answer.claims)
    inside = not any(e["outside"] for e in answer.content["effects"])
    equal = {frozenset(r.claims) for r in rivals if r.equivalent} - {truth}
    named = words_of(answer.content["effects"])
    words = {frozenset(named)} if named and len(answer.content["effects"]) == 1 else set()
    right_claims = (equal | {truth}) if inside else equal | words
    out: dict[str, Any] = {
        "stratum": answer.content["stratum"],
        "visible": bool(answer.content["visible"]),
        "identifiable": not equal,
        "equivalents": sorted(sorted(map(list, claims)) for claims in equal),
        "truth": sorted(map(list, truth)) or [[e["family"], e["on"]] for e in answer.content["effects"]],
    }
    if report is None:
        wrong = dict.fromkeys(("right", "verdict_right", "leading_right", "families_right"), False)
        return out | {"verdict": "failed", "said": []} | wrong | failed_gates(answer.content["effects"])
    verdict, leader = str(report["verdict"]), claims_of(report["effects"])
    others = [claims_of(a["effects"]) for a in report["alternatives"]]
    out |= {
        "verdict": verdict,
        "said": sorted(map(list, leader)),
        "alternatives": sorted(sorted(map(list, o)) for o in others),
        "leading_right": leader in right_claims and bool(leader),
        "families_right": _families(leader) in {_families(c) for c in right_claims} and bool(leader),
        "found": len(leader & truth),
        "verdict_right": verdict in _verdicts(str(out["stratum"]), equal | words),
        "right": _right(str(out["stratum"]), verdict, leader, others, truth, right_claims),
    }
    if out["stratum"] == "none":
        out["false_alarm"] = verdict in ("named", "ambiguous", "partial") or bool(leader)
    if not inside:
        out |= _outside(report, frozenset().union(*equal, *words))
        out["right"] = bool(out["said_so"] or (verdict == "named" and out["leading_right"]))
    if inside and truth:
        out |= _location(answer, report, leader, right_claims)
        out["parameters"] = (
            parameter_errors(answer.content["effects"], report["effects"]) if leader == truth else []
        )
    out["fit"] = held_out_fit(answer, report)
    return out


def held_out_fit(answer: Answer, report: Json) -> dict[str, dict[str, float]]:
    """Rate -> each model's held-out one-step error over the true model's own on the same episodes."""
    held = [int(name) for name in report["fit"]["held_out"] if str(name).isdigit()]
    rows = np.isin(answer.episode, held)
    own = answer.own[rows if rows.any() else slice(None)]
    rates = SYSTEMS[answer.world.system].rates
    out = {}
    for rate, errors in report["fit"]["one_step"].items():
        best = max(float(np.sqrt(np.mean(own[:, rates.index(rate)] ** 2))), 1e-12)
        kinds = ("before", "tuned", "gp", "after", "after_gp")
        out[rate] = {kind: float(errors[kind]) / best for kind in kinds if errors.get(kind) is not None}
    return out


def _visited(answer: Answer) -> dict[str, tuple[float, float]]:
    """From where to where each channel went."""
    readings = np.concatenate(answer.clean)
    edges = zip(readings.min(axis=0).tolist(), readings.max(axis=0).tolist(), strict=True)
    return dict(zip(SYSTEMS[answer.world.system].names, edges, strict=True))


def _families(claims: Claim) -> tuple[str, ...]:
    return tuple(sorted(family for family, _ in claims))


def _right(
    stratum: str, verdict: str, leader: Claim, others: Sequence[Claim], truth: Claim, right_claims: set[Claim]
) -> bool:
    """`ambiguous` is right only if the truth is in the set and every member is the truth or a listed equivalent."""
    if stratum == "none":
        return verdict == "none"
    if verdict == "named":
        return bool(leader in right_claims)
    if verdict == "ambiguous":
        members = {leader, *others}
        return truth in members and members <= right_claims
    return verdict == "none" and frozenset() in right_claims


def _verdicts(stratum: str, equal: set[Claim]) -> set[str]:
    """The verdicts that a world calls for; with listed equivalents there is more than one."""
    if stratum == "none":
        return {"none"}
    if stratum == "unknown":
        return {"unknown", "partial"} | ({"named"} if equal else set())
    return {"named"} | ({"ambiguous"} if equal else set()) | ({"none"} if frozenset() in equal else set())


def _outside(report: Json, equivalent: Claim) -> dict[str, Any]:
    """Of a world outside the catalogue: whether it was said so, and whether a wrong name was asserted.

    Said so: `unknown`, `partial`, or every headline effect's law only approximates. A wrong name, whatever the verdict:
    a headline effect that is in no listed equivalent.
    """
    headline = headline_of(report["effects"])
    nearest = bool(headline) and all(map(approximate, headline))
    wrong = any(asserted(e) for e in headline if identity(e) not in equivalent)
    return {"said_so": report["verdict"] in ("unknown", "partial") or nearest, "named_wrong": wrong}


def _location(answer: Answer, report: Json, leader: Claim, right_claims: set[Claim]) -> dict[str, Any]:
    """Whether the rate, the place and the gates are right."""
    truth, world = frozenset(answer.claims), answer.world
    duration = float(world.clock_offsets[-1] + world.steps * world.dt)
    out: dict[str, Any] = {
        "rate_right": _rate_right(answer.content["one_step"], report["location"]["channels"]),
        "place_right": leader in right_claims or {on for _, on in leader} == {on for _, on in truth},
        **gate_figures(
            answer.content["effects"],
            report["effects"],
            _visited(answer),
            duration,
            stands_in=leader in right_claims,
        ),
    }
    out["location_right"] = bool(out["rate_right"] and out["place_right"] and out["gate_right"])
    return out


def _rate_right(one_step: Json, said: Mapping[str, float]) -> bool:
    """Whether the rate with the largest share in the diagnosis is one of the leading ones in truth."""
    shares = {r: max(0.0, 1.0 - (e["own"] / max(e["base"], 1e-300)) ** 2) for r, e in one_step.items()}
    if not said or max(said.values()) <= 0:
        return bool(max(shares.values()) < LEAST_SEEN)
    if max(shares.values()) < LEAST_SEEN:
        return True
    pointed = max(said, key=lambda rate: said[rate])
    return bool(shares.get(pointed, 0.0) >= LEADING_RATE * max(shares.values()))
