"""What counts of a world for plans: whether, and after how long, a second recording decides what a first left open."""

from __future__ import annotations

from typing import Any

from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import PLANNED, Second
from gpsim.trials.scoring.claims import Json, claims_of

PLANS = "plans"


def score_plan(answer: Answer, report: Json | None, second: Second | None) -> dict[str, Any]:
    """second: what was recorded afterwards; None where the first recording left nothing open.

    kinds: of every excitation the seconds until the right explanation was ahead by odds above ten, None where it never
    was, and whether the machine left the box. A world counts where any of them decides. right: where it does not count,
    or the plan decides.
    """
    kinds = score_plan_kinds(second)
    counts = any(k["seconds"] is not None for k in kinds.values())
    return {
        "stratum": PLANS,
        "visible": True,
        "identifiable": True,
        "equivalents": [],
        "truth": sorted(map(list, answer.claims)),
        "verdict": "failed" if report is None else str(report["verdict"]),
        "said": [] if report is None else sorted(map(list, claims_of(report["effects"]))),
        "open": second is not None,
        "listed": second is not None and second.listed,
        "counts": counts,
        "length": None if second is None else second.seconds,
        "kinds": kinds,
        "right": report is not None and (not counts or kinds[PLANNED]["seconds"] is not None),
    }


def score_plan_kinds(second: Second | None) -> dict[str, dict[str, Any]]:
    """What is said of each excitation."""
    if second is None:
        return {}
    return {
        kind: {"nats": d.nats, "seconds": None if d.part is None else d.part * second.seconds, "left": d.left}
        for kind, d in second.kinds.items()
    }
