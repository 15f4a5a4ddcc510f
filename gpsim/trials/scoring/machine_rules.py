"""What counts as right on a whole machine: effects that count are told, nothing else is; sizes, rollouts, the verdict.

Everything that a diagnosis says counts, headline and slight. An effect of the machine counts where it could be seen
(see `rivals.machine_rivals`) and is needed for 1 % of the mismatch, or stands out of the noise by itself; others may be
told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import MachineListing, Seen
from gpsim.trials.scoring.claims import Json, claims_of, headline_of, identity, parameter_errors
from gpsim.trials.scoring.group_rules import claims_of_nuisances, rough_verdicts

MACHINES = "machines"
SEEN, NEEDED, STANDS_OUT = 3.0, 0.01, 1.0  # nats, share of the mismatch, standard deviations of the noise
SIZED = 0.15  # of what an effect changes, by which its size may be off


def score_machine(answer: Answer, report: Json | None, listing: MachineListing | None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of a machine; a missing report tells nothing.

    effects_told: every effect of the machine, whether it counts and whether it was told, by its own name or by one that
    stands for it; spurious: what was told and is none of them, nor what a nuisance may be called.
    """
    own = [e for e in answer.content["effects"] if not e["outside"]]
    truth, machine = frozenset(answer.claims), answer.content["world"]["machine"]
    explained = float(answer.content["machine"]["explained"])
    seen = listing.seen if listing else tuple(_unjudged(e) for e in own)
    out: dict[str, Any] = {
        "stratum": MACHINES,
        "kind": machine["kind"],
        "recordings": len(machine["sessions"]),
        "visible": True,
        "identifiable": True,
        "equivalents": [],
        "truth": sorted(map(list, truth)),
        "explained": explained,
        "verdicts": sorted(rough_verdicts(explained, False)),
        "counting": sum(map(_counts, seen)),
    }
    if report is None or listing is None:
        untold = [_of_effect(e, s, False) for e, s in zip(own, seen, strict=True)]
        wrong = dict.fromkeys(("right", "verdict_right", "leading_right", "families_right"), False)
        nothing = {
            "said": [],
            "told": 0,
            "spurious": 0,
            "parameters": [],
            "rollouts": None,
            "black_box": None,
        }
        return out | {"verdict": "failed", "effects_told": untold} | wrong | nothing
    said, whole = claims_of(report["effects"]), _whole(listing, report, truth)
    meant = said | set(listing.stands.values())
    told = [_of_effect(e, s, whole or identity(e) in meant) for e, s in zip(own, seen, strict=True)]
    allowed = truth | set(listing.stands) | claims_of_nuisances(answer)
    spurious = [] if whole else [e for e in report["effects"] if identity(e) not in allowed]
    counting = [t for t in told if t["counts"]]
    equivalents = whole or bool(listing.stands) or any(listing.equivalent[1:])
    verdicts, verdict = rough_verdicts(explained, equivalents), str(report["verdict"])
    share = (report.get("explained") or {}).get("rollout") or {}
    out |= {
        "identifiable": not equivalents,
        "equivalents": [sorted(map(list, (truth - set(listing.stands.values())) | set(listing.stands)))]
        if listing.stands
        else [],
        "verdicts": sorted(verdicts),
        "verdict": verdict,
        "said": sorted(map(list, said)),
        "said_explained": share.get("share"),
        "effects_told": told,
        "told": sum(t["told"] for t in counting),
        "spurious": len(spurious),
        "spurious_names": sorted(list(identity(e)) for e in spurious),
        "spurious_headline": len(headline_of(spurious)),
        "verdict_right": verdict in verdicts,
        "leading_right": all(t["told"] for t in counting),
        "families_right": {f for f, _ in said} >= {t["family"] for t in counting},
        "parameters": [] if whole and said != truth else _sizes(listing, report, told),
        "rollouts": max(listing.rollouts.values(), default=None),
        "black_box": black_box(report["fit"]["rollout"]),
    }
    out["right"] = bool(out["verdict_right"] and out["leading_right"] and not spurious)
    return out


def black_box(rollout: Mapping[str, Any]) -> float | None:
    """Error of the base with a Gaussian process over that with the effects, after held-out rollouts.

    The geometric mean over the measured channels; infinite where it ran away, None where nothing was measured.
    """
    channels = [e for e in rollout.values() if isinstance(e, Mapping) and e.get("after")]
    if not channels:
        return None
    ratios = [math.inf if e.get("gp") is None else float(e["gp"]) / float(e["after"]) for e in channels]
    return math.exp(sum(math.log(max(r, 1e-9)) for r in ratios) / len(ratios))


def _whole(listing: MachineListing, report: Json, truth: frozenset[tuple[str, str]]) -> bool:
    """Whether the leader as a whole is an equivalent of the truth, in other words than its own."""
    return bool(listing.equivalent and listing.equivalent[0]) and claims_of(report["effects"]) != truth


def _unjudged(effect: Json) -> Seen:
    """Of a trial that could not be judged: what the answer itself says."""
    return Seen(math.inf, float(effect["share"] or 0.0), float(effect["beyond"]))


def _counts(seen: Seen) -> bool:
    return seen.nats >= SEEN and (seen.share >= NEEDED or seen.beyond >= STANDS_OUT)


def _of_effect(effect: Json, seen: Seen, told: bool) -> dict[str, Any]:
    return {
        "family": effect["family"],
        "on": effect["on"],
        "counts": _counts(seen),
        "told": told,
        "needed": seen.share,
        "beyond": seen.beyond,
        "nats": seen.nats if math.isfinite(seen.nats) else None,
    }


def _sizes(listing: MachineListing, report: Json, told: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of the effects that count and were told by their own names; of two that changed places neither."""
    counting = {(t["family"], t["on"]) for t in told if t["counts"]}
    values = [e for e in listing.values if (e["family"], e["on"]) in counting]
    return [
        p | {"sized": bool(p["covered"] or p["error_of_effect"] <= SIZED)}
        for p in parameter_errors(values, report["effects"])
    ]
