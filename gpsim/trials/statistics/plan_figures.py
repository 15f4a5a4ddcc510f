"""Of worlds for plans: how many each excitation resolves, after how long, and how often the machine left the box."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.trials.statistics.intervals import rate

Score = Mapping[str, Any]
PLANNED = "plan"


def plan_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """counting: worlds that any excitation resolves; of those every kind's share, and how long it took.

    The median of the seconds takes one that never decides for infinitely long. over_fixed: the plan's median over that
    of the fixed excitation whose median is least.
    """
    counting = [s for s in scores if s["counts"]]
    names = list(counting[0]["kinds"]) if counting else []
    kinds = {name: _kind([s["kinds"][name] for s in counting]) for name in names}
    fixed = [k["median_seconds"] for name, k in kinds.items() if name != PLANNED]
    plan = kinds.get(PLANNED, {})
    return {
        "n": len(counting),
        "drawn": len(scores),
        "open": sum(s["open"] for s in scores),
        "listed": sum(s["listed"] for s in scores),
        "kinds": kinds,
        "resolved": plan.get("share"),
        "interval_resolved": plan.get("interval"),
        "left": plan.get("left_share"),
        "interval_left": plan.get("interval_left"),
        "over_fixed": None
        if not kinds or not math.isfinite(min(fixed))
        else plan["median_seconds"] / min(fixed),
        "failed": sum(s["verdict"] == "failed" for s in scores),
        "misses": [s["trial"] for s in scores if not s["right"]],
    }


def _kind(each: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    seconds = [math.inf if k["seconds"] is None else float(k["seconds"]) for k in each]
    left = rate([bool(k["left"]) for k in each], "left")
    return rate([math.isfinite(s) for s in seconds], "resolved") | {
        "median_seconds": float(np.median(seconds)),
        "left": left["left"],
        "left_share": left["share"],
        "interval_left": left["interval"],
    }
