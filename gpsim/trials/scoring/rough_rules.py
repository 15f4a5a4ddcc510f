"""What counts as right on a rough world: headline effects against the main effects, the verdict against their share.

Main effects are those of the catalogue; the nuisances beside them need no name. A headline effect is one whose role is
`headline`; where a diagnosis has no roles, every one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import Rival
from gpsim.trials.scoring.claims import Claim, Json, asserted, claims_of, headline_of, identity
from gpsim.trials.scoring.parameters import parameter_errors

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
    that are neither, nor the lag of a late topic; asserted: those of them that are said to hold, with odds.
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
    allowed = frozenset().union(*right_claims) | late_claims(answer)
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


def late_claims(answer: Answer) -> Claim:
    """What the lag of a late topic may be called: it is true, though no physics.

    Where all topics of the state are late together, that is the same as a late command.
    """
    world = answer.world
    late = world.rough.late if world.rough else {}
    claims = {("sensor_delay", channel) for channel in late}
    if set(late) == set(world.noise):
        claims |= {("actuator_delay", action) for action in answer.actions}
    return frozenset(claims)
