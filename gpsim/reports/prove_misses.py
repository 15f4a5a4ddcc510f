"""Every miss of a proof in words: the world, its truth, what was said of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Json = Mapping[str, Any]


def miss_rows(scores: Sequence[Json]) -> list[dict[str, str]]:
    """One line a miss, for the page."""
    return [
        {
            "trial": str(s["trial"]),
            "stratum": str(s["stratum"]),
            "world": f"{s['system']}, {s['noise_level']} noise, {s['velocities'] or _unmeasured(s)}, {s['excitation']}"
            + ("" if s["visible"] else ", not visible")
            + (f", {', '.join(s['defects'])}" if s["defects"] else ""),
            "truth": _true_share(s) + (" + ".join(_told(e) for e in s["effects"]) or "nothing"),
            "said": f"{s['verdict']}{_said_share(s)}: "
            + (" + ".join(f"{f} on {on}" for f, on in s["said"]) or "nothing"),
            "equivalents": "; ".join(" + ".join(f"{f} on {on}" for f, on in c) for c in s["equivalents"]),
            "error": str(s["error"] or ""),
        }
        for s in scores
        if not s["right"]
    ]


def _unmeasured(score: Json) -> str:
    return "positions only" if "robot" in score else "pose only"


def _true_share(score: Json) -> str:
    """Of a rough world and a machine: the verdict called for, and what their own effects explain."""
    if "explained" not in score:
        return ""
    return f"{' or '.join(score['verdicts'])} (explained {score['explained']:.2f}): "


def _said_share(score: Json) -> str:
    share = score.get("said_explained")
    return "" if share is None else f" ({share:.2f})"


def _told(effect: Json) -> str:
    numbers = ", ".join(f"{k} {v:.4g}" for k, v in effect["parameters"].items())
    where = "".join(f", {k} in [{low:.3g}, {high:.3g}]" for k, (low, high) in effect["region"].items())
    when = f", since {effect['since']:.6g} s" if effect["since"] is not None else ""
    return f"{effect['family']} on {effect['on']} ({numbers}{where}{when})"
