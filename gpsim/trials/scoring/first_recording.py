"""What a diagnosis of several recordings says of the first, whose truth it is scored against."""

from __future__ import annotations

from typing import Any

from gpsim.trials.scoring.claims import Json


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
