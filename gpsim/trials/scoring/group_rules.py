"""What counts as right on a robot's world: the rules of plain worlds, without location and one-step fit.

No effect of it has a gate, so none may be claimed; what a diagnosis says of rates that nobody measured is not scored.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import Rival
from gpsim.trials.scoring.claims import (
    Claim,
    Json,
    asserted,
    claims_of,
    headline_of,
    identity,
    parameter_errors,
    words_of,
)


def score_robot(answer: Answer, report: Json | None, rivals: Sequence[Rival]) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of a robot's world; a missing report is wrong in all."""
    truth, stratum = frozenset(answer.claims), str(answer.content["stratum"])
    equal = {frozenset(r.claims) for r in rivals if r.equivalent} - {truth}
    out: dict[str, Any] = {
        "robot": answer.content["robot"],
        "stratum": stratum,
        "visible": True,
        "identifiable": not equal,
        "equivalents": sorted(sorted(map(list, claims)) for claims in equal),
        "truth": sorted(map(list, truth)),
    }
    if report is None:
        wrong = dict.fromkeys(("right", "verdict_right", "leading_right", "families_right"), False)
        return out | {"verdict": "failed", "said": [], "parameters": []} | wrong
    verdict, leader = str(report["verdict"]), claims_of(report["effects"])
    others = [claims_of(a["effects"]) for a in report["alternatives"]]
    right_claims: set[Claim] = {truth, *equal}
    gated = any(e["region"] or e["since"] is not None for e in report["effects"])
    families = {tuple(sorted(f for f, _ in claims)) for claims in right_claims}
    out |= {
        "verdict": verdict,
        "said": sorted(map(list, leader)),
        "alternatives": sorted(sorted(map(list, o)) for o in others),
        "leading_right": leader in right_claims and bool(leader),
        "families_right": tuple(sorted(f for f, _ in leader)) in families and bool(leader),
        "found": len(leader & truth),
        "gated": gated,
        "parameters": parameter_errors(answer.content["effects"], report["effects"])
        if leader == truth
        else [],
    }
    if stratum == "none":
        quiet = verdict == "none"
        return out | {
            "verdict_right": quiet,
            "right": quiet,
            "false_alarm": verdict in ("named", "ambiguous", "partial") or bool(leader),
        }
    out["verdict_right"] = verdict == "named" or (verdict == "ambiguous" and bool(equal))
    members = {leader, *others}
    named = verdict == "named" and leader in right_claims
    either = verdict == "ambiguous" and truth in members and members <= right_claims
    out["right"] = bool((named or either) and not gated)
    return out


NAMED_FROM, PARTIAL_FROM = 0.9, 0.5  # of the mismatch, that the main effects explain
EITHER = 0.03  # this near to a threshold both verdicts are right


def rough_verdicts(explained: float, equivalents: bool) -> set[str]:
    """The verdicts that a true share calls for: two of them near a threshold."""
    found: set[str] = set()
    if explained >= NAMED_FROM - EITHER:
        found |= {"named", "ambiguous"} if equivalents else {"named"}
    if PARTIAL_FROM - EITHER <= explained < NAMED_FROM + EITHER:
        found.add("partial")
    if explained < PARTIAL_FROM + EITHER:
        found.add("unknown")
    return found


def score_rough(answer: Answer, report: Json | None, rivals: Sequence[Rival]) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of a rough world; a missing report finds nothing.

    found: share of the main effects among the headline, or of an equivalent of them all; spurious: headline effects
    that are neither, nor what a nuisance may be called; asserted: those of them that are said to hold, with odds.
    """
    truth = frozenset(answer.claims)
    equal = {frozenset(r.claims) for r in rivals if r.equivalent and r.claims} - {truth}
    right_claims = {truth, *equal}
    explained = float(answer.content["rough"]["explained"])
    out: dict[str, Any] = {
        "stratum": "rough",
        "visible": True,
        "identifiable": not equal,
        "equivalents": sorted(sorted(map(list, claims)) for claims in equal),
        "truth": sorted(map(list, truth)),
        "explained": explained,
        "verdicts": sorted(rough_verdicts(explained, bool(equal))),
        "main": len(truth),
    }
    if report is None:
        wrong = {"right": False, "verdict_right": False, "leading_right": False, "families_right": False}
        nothing = {"said": [], "found": 0.0, "spurious": 0, "asserted": 0, "parameters": []}
        return out | {"verdict": "failed"} | wrong | nothing
    headline = headline_of(report["effects"])
    said = claims_of(headline)
    allowed = frozenset().union(*right_claims) | claims_of_nuisances(answer)
    spurious = [e for e in headline if identity(e) not in allowed]
    found = max(len(said & claims) / len(claims) for claims in right_claims)
    verdict = str(report["verdict"])
    told = (report.get("explained") or {}).get("rollout") or {}
    out |= {
        "verdict": verdict,
        "said": sorted(map(list, said)),
        "said_explained": told.get("share"),
        "found": found,
        "spurious": len(spurious),
        "spurious_names": sorted(list(identity(e)) for e in spurious),
        "asserted": sum(map(asserted, spurious)),
        "verdict_right": verdict in out["verdicts"],
        "leading_right": found == 1.0,
        "families_right": {f for f, _ in said} >= {f for f, _ in truth},
        "parameters": parameter_errors(answer.content["effects"], headline),
    }
    out["right"] = bool(out["verdict_right"] and found == 1.0 and not spurious)
    return out


def claims_of_nuisances(answer: Answer) -> Claim:
    """What a nuisance may be called: it is there. That is the lag of a late topic, and a kind that has become a word.

    Where all topics of the state are late together, that is the same as a late command.
    """
    world = answer.world
    late = world.rough.late if world.rough else {}
    claims = {("sensor_delay", channel) for channel in late}
    if set(late) == set(world.noise):
        claims |= {("actuator_delay", action) for action in answer.actions}
    return frozenset(claims | words_of(answer.content["effects"]))
