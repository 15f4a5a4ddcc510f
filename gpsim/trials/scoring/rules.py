"""What counts as right: one diagnosis against its answer. Pure functions of the two: no files, no fits.

Claims are sets of (family, place). A claim is right when it is the truth or one of the world's listed equivalents. On
plain worlds and robots of few effects every effect counts, slight ones, too; on rough worlds the headline.
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
    failed,
    families_of,
    headline_of,
    identity,
    listed,
    opened,
    parameter_errors,
    said_share,
    spurious_of,
    words_of,
)
from gpsim.trials.scoring.gates import failed_gates, gate_figures
from gpsim.trials.worlds import SYSTEMS

LEAST_SEEN = 0.05  # a true share below which one step cannot show in which rate the effect is
LEADING_RATE = 0.5  # a rate with at least this share of the largest true share is a right one to point at
NAMED_FROM, PARTIAL_FROM = 0.9, 0.5  # of the mismatch, that the main effects explain
EITHER = 0.03  # this near to a threshold both verdicts are right


def score(answer: Answer, report: Json | None, rivals: Sequence[Rival]) -> dict[str, Any]:
    """Everything that can be said of one diagnosis; a missing report is a failed diagnosis, wrong in all."""
    if answer.content["stratum"] == "rough":
        return score_rough(answer, report, rivals)
    if "robot" in answer.content:
        return score_robot(answer, report, rivals)
    effects, truth = answer.content["effects"], frozenset(answer.claims)
    inside = not any(e["outside"] for e in effects)
    equal = {frozenset(r.claims) for r in rivals if r.equivalent} - {truth}
    named = words_of(effects)
    words = {frozenset(named)} if named and len(effects) == 1 else set()
    right_claims = (equal | {truth}) if inside else equal | words
    out = opened(answer, equal, visible=bool(answer.content["visible"]))
    out["truth"] = out["truth"] or [[e["family"], e["on"]] for e in effects]
    if report is None:
        return out | failed() | failed_gates(effects)
    verdict, leader = str(report["verdict"]), claims_of(report["effects"])
    out |= _said(report, truth, right_claims)
    out["verdict_right"] = verdict in _verdicts(out["stratum"], equal | words)
    out["right"] = _right(out["stratum"], report, truth, right_claims)
    if out["stratum"] == "none":
        out["false_alarm"] = _alarm(report)
    if not inside:
        out |= _outside(report, frozenset().union(*equal, *words))
        out["right"] = bool(out["said_so"] or (verdict == "named" and out["leading_right"]))
    if inside and truth:
        out |= _location(answer, report, leader, right_claims)
        out["parameters"] = parameter_errors(effects, report["effects"]) if leader == truth else []
    out["fit"] = held_out_fit(answer, report)
    return out


def score_robot(answer: Answer, report: Json | None, rivals: Sequence[Rival]) -> dict[str, Any]:
    """The rules of plain worlds, without location and one-step fit.

    No effect has a gate, so none may be claimed; what a diagnosis says of rates that nobody measured is not scored.
    """
    effects, truth = answer.content["effects"], frozenset(answer.claims)
    equal = {frozenset(r.claims) for r in rivals if r.equivalent} - {truth}
    out = {"robot": answer.content["robot"], **opened(answer, equal)}
    if report is None:
        return out | failed(parameters=[])
    verdict, leader = str(report["verdict"]), claims_of(report["effects"])
    out |= _said(report, truth, {truth, *equal})
    out["gated"] = any(e["region"] or e["since"] is not None for e in report["effects"])
    out["parameters"] = parameter_errors(effects, report["effects"]) if leader == truth else []
    if out["stratum"] == "none":
        quiet = verdict == "none"
        return out | {"verdict_right": quiet, "right": quiet, "false_alarm": _alarm(report)}
    out["verdict_right"] = verdict == "named" or (verdict == "ambiguous" and bool(equal))
    right = verdict in ("named", "ambiguous") and _right(out["stratum"], report, truth, {truth, *equal})
    out["right"] = bool(right and not out["gated"])
    return out


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
    explained = float(answer.content["rough"]["explained"])
    verdicts = rough_verdicts(explained, bool(equal))
    out = opened(answer, equal, explained=explained, verdicts=sorted(verdicts), main=len(truth))
    if report is None:
        return out | failed(found=0.0, spurious=0, asserted=0, parameters=[])
    headline, verdict, right_claims = headline_of(report["effects"]), str(report["verdict"]), {truth, *equal}
    said = claims_of(headline)
    allowed = frozenset().union(*right_claims) | claims_of_nuisances(answer)
    spurious = [e for e in headline if identity(e) not in allowed]
    found = max(len(said & claims) / len(claims) for claims in right_claims)
    return out | {
        "verdict": verdict,
        "said": listed(said),
        "said_explained": said_share(report),
        "found": found,
        **spurious_of(spurious),
        "asserted": sum(map(asserted, spurious)),
        "verdict_right": verdict in verdicts,
        "leading_right": found == 1.0,
        "families_right": {f for f, _ in said} >= {f for f, _ in truth},
        "parameters": parameter_errors(answer.content["effects"], headline),
        "right": bool(verdict in verdicts and found == 1.0 and not spurious),
    }


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


def held_out_fit(answer: Answer, report: Json) -> dict[str, dict[str, float]]:
    """Rate -> each model's held-out one-step error over the true model's own on the same episodes."""
    held = [int(name) for name in report["fit"]["held_out"] if str(name).isdigit()]
    rows = np.isin(answer.episode, held)
    own = answer.own[rows if rows.any() else slice(None)]
    rates, kinds = SYSTEMS[answer.world.system].rates, ("before", "tuned", "gp", "after", "after_gp")
    out = {}
    for rate, errors in report["fit"]["one_step"].items():
        best = max(float(np.sqrt(np.mean(own[:, rates.index(rate)] ** 2))), 1e-12)
        out[rate] = {kind: float(errors[kind]) / best for kind in kinds if errors.get(kind) is not None}
    return out


def _said(report: Json, truth: Claim, right_claims: set[Claim]) -> dict[str, Any]:
    """What the leader and the others claim, and what of it is right."""
    leader, families = claims_of(report["effects"]), {families_of(c) for c in right_claims}
    return {
        "verdict": str(report["verdict"]),
        "said": listed(leader),
        "alternatives": sorted(listed(claims_of(a["effects"])) for a in report["alternatives"]),
        "leading_right": leader in right_claims and bool(leader),
        "families_right": families_of(leader) in families and bool(leader),
        "found": len(leader & truth),
    }


def _alarm(report: Json) -> bool:
    return report["verdict"] in ("named", "ambiguous", "partial") or bool(report["effects"])


def _right(stratum: str, report: Json, truth: Claim, right_claims: set[Claim]) -> bool:
    """`ambiguous` is right only if the truth is in the set and every member is the truth or a listed equivalent."""
    verdict, leader = report["verdict"], claims_of(report["effects"])
    if stratum == "none":
        return bool(verdict == "none")
    if verdict == "named":
        return leader in right_claims
    if verdict == "ambiguous":
        members = {leader, *(claims_of(a["effects"]) for a in report["alternatives"])}
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
    world, readings = answer.world, np.concatenate(answer.clean)
    edges = zip(readings.min(axis=0).tolist(), readings.max(axis=0).tolist(), strict=True)
    visited = dict(zip(SYSTEMS[world.system].names, edges, strict=True))
    duration, effects = float(world.clock_offsets[-1] + world.steps * world.dt), answer.content["effects"]
    right = leader in right_claims
    out: dict[str, Any] = {
        "rate_right": _rate_right(answer.content["one_step"], report["location"]["channels"]),
        "place_right": right or {on for _, on in leader} == {on for _, on in answer.claims},
        **gate_figures(effects, report["effects"], visited, duration, stands_in=right),
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
