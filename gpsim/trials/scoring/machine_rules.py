"""What counts as right on a whole machine: effects that count are told, nothing else is; sizes, rollouts, the verdict.

Everything that a diagnosis says counts, headline and slight. An effect of the machine counts where it could be seen
(see `rivals`) and is needed for 1 % of the mismatch, or stands out of the noise by itself; others may be
told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import MachineListing, Seen
from gpsim.trials.scoring.claims import (
    Json,
    claims_of,
    failed,
    headline_of,
    identity,
    listed,
    opened,
    parameter_errors,
    said_share,
    spurious_of,
)
from gpsim.trials.scoring.rules import claims_of_nuisances, rough_verdicts

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
    out = opened(
        answer,
        kind=machine["kind"],
        recordings=len(machine["sessions"]),
        explained=explained,
        verdicts=sorted(rough_verdicts(explained, False)),
        counting=sum(map(_counts, seen)),
    )
    if report is None or listing is None:
        untold = [_of_effect(e, s, False) for e, s in zip(own, seen, strict=True)]
        nothing = {"told": 0, "spurious": 0, "parameters": [], "rollouts": None, "black_box": None}
        return out | failed(effects_told=untold, **nothing)
    said, verdict = claims_of(report["effects"]), str(report["verdict"])
    # The leader as a whole may be an equivalent of the truth, in other words than its own.
    whole = bool(listing.equivalent and listing.equivalent[0]) and said != truth
    places = set(listing.stands.values())
    told = [_of_effect(e, s, whole or identity(e) in said | places) for e, s in zip(own, seen, strict=True)]
    allowed = truth | set(listing.stands) | claims_of_nuisances(answer)
    spurious = [] if whole else [e for e in report["effects"] if identity(e) not in allowed]
    counting = [t for t in told if t["counts"]]
    equivalents = whole or bool(listing.stands) or any(listing.equivalent[1:])
    verdicts, every = rough_verdicts(explained, equivalents), all(t["told"] for t in counting)
    return out | {
        "identifiable": not equivalents,
        "equivalents": [listed((truth - places) | set(listing.stands))] if listing.stands else [],
        "verdicts": sorted(verdicts),
        "verdict": verdict,
        "said": listed(said),
        "said_explained": said_share(report),
        "effects_told": told,
        "told": sum(t["told"] for t in counting),
        **spurious_of(spurious),
        "spurious_headline": len(headline_of(spurious)),
        "verdict_right": verdict in verdicts,
        "leading_right": every,
        "families_right": {f for f, _ in said} >= {t["family"] for t in counting},
        "parameters": [] if whole else _sizes(listing, report, told),
        "rollouts": max(listing.rollouts.values(), default=None),
        "black_box": black_box(report["fit"]["rollout"]),
        "right": bool(verdict in verdicts and every and not spurious),
    }


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


def black_box(rollout: Mapping[str, Any]) -> float | None:
    """Error of the base with a Gaussian process over that with the effects, after held-out rollouts.

    The geometric mean over the measured channels; infinite where it ran away, None where nothing was measured.
    """
    channels = [e for e in rollout.values() if isinstance(e, Mapping) and e.get("after")]
    if not channels:
        return None
    ratios = [math.inf if e.get("gp") is None else float(e["gp"]) / float(e["after"]) for e in channels]
    return math.exp(sum(math.log(max(r, 1e-9)) for r in ratios) / len(ratios))


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
