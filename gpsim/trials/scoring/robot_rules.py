"""What counts as right on a robot's world: the rules of plain worlds, without location and one-step fit.

No effect of it has a gate, so none may be claimed; what a diagnosis says of rates that nobody measured is not scored.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import Rival
from gpsim.trials.scoring.claims import Claim, Json, claims_of
from gpsim.trials.scoring.parameters import parameter_errors


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
