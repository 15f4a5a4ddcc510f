"""What counts on worlds whose law no family has, and on worlds for plans.

A curve is right that was measured at the law's site, of its input, and is near the law. A plan is right that decides
what a first recording left open.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import PLANNED, Second
from gpsim.trials.scoring.claims import (
    Json,
    asserted,
    claims_of,
    failed,
    headline_of,
    identity,
    listed,
    opened,
)

NEAR = 0.1  # of the true law's range, that a curve may be off in root mean square over what was visited
BENDS = 0.01
"""Of a law's range, that it must be off every straight line over what was visited: else a law of the catalogue says
the same there (0 where but two commands were given; 0.05 and more of 23 laws of seed 2060)."""
CONSTANTS = {"constant_force": "force", "sensor_bias": "offset", "actuator_bias": "bias"}
"""Families that may hold a curve's mean beside it, and the parameter that does."""


def score_curve(answer: Answer, report: Json | None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis; a missing report is wrong in all.

    off: how far the curve is from the law, in parts of the law's range; None without a curve at the right place.
    named_wrong: a law of the catalogue is said to hold. identifiable: what was visited shows that the law is no line.
    """
    (effect,) = answer.content["effects"]
    truth = answer.content["curve"]
    own = {"kind": effect["family"], "visible": bool(answer.content["visible"]), "parameters": []}
    own["identifiable"] = _bends(truth) > BENDS
    out = opened(answer, **own, truth=[[effect["family"], effect["on"]]])
    if report is None:
        return out | failed(off=None, place_right=False, curve_right=False)
    headline, verdict = headline_of(report["effects"]), str(report["verdict"])
    off = _off(truth, effect["on"], report["effects"])
    near = off is not None and off <= NEAR
    named = [e for e in headline if asserted(e) and not _constant(e, effect["on"])]
    return out | {
        "verdict": verdict,
        "said": listed(claims_of(report["effects"])),
        "off": off,
        "place_right": off is not None,
        "curve_right": near,
        "named_wrong": bool(named),
        "verdict_right": verdict in ("partial", "unknown"),
        "leading_right": off is not None,
        "families_right": truth["family"] in {e["family"] for e in report["effects"]},
        "right": bool(near and not named),
    }


def _off(truth: Json, on: str, effects: Sequence[Json]) -> float | None:
    """Root mean square of the difference over what was visited, in parts of the law's range."""
    found = next((e for e in effects if _same(e, truth, on)), None)
    if found is None:
        return None
    beside = sum(float(e["parameters"][CONSTANTS[e["family"]]]["value"]) for e in effects if _constant(e, on))
    adds = np.array(truth["adds"])
    rest = _told(found["curve"], truth) + beside - adds
    return float(np.sqrt(np.mean(rest**2)) / max(float(np.ptp(adds)), 1e-300))


def _bends(truth: Json) -> float:
    """Root mean square of what a straight line misses of the law, in parts of the law's range."""
    adds, x = np.array(truth["adds"]), np.array([truth["at"], truth.get("second", truth["at"])]).T
    line = np.column_stack([np.ones(len(x)), x])
    rest = adds - line @ np.linalg.lstsq(line, adds)[0]
    return float(np.sqrt(np.mean(rest**2)) / max(float(np.ptp(adds)), 1e-300))


def _same(effect: Json, truth: Json, on: str) -> bool:
    """Whether it is a measured curve at the law's site and place, of its input."""
    curve = effect.get("curve")
    if not curve or identity(effect) != (truth["family"], on):
        return False
    return truth["input"] in (curve["input"], curve.get("second"))


def _constant(effect: Json, on: str) -> bool:
    return effect["family"] in CONSTANTS and identity(effect)[1] == on


def _told(curve: Json, truth: Json) -> FloatArray:
    """What the curve adds to what the base makes of its input, at the inputs of the answer; held beyond its ends."""
    x, at, values = np.array(truth["at"]), np.array(curve["at"]), np.array(curve["values"])
    if curve.get("second_at"):
        w, rows = np.array(truth["second"]), values.reshape(len(curve["second_at"]), len(at)) - at
        lines = np.array([np.interp(w, at, row) for row in rows])
        return np.asarray(
            [np.interp(v, curve["second_at"], line) for v, line in zip(x, lines.T, strict=True)]
        )
    base = 0.0 if truth["family"] == "force_curve" else at
    return np.asarray(np.interp(x, at, values - base))


def score_plan(answer: Answer, report: Json | None, second: Second | None) -> dict[str, Any]:
    """second: what was recorded afterwards; None where the first recording left nothing open.

    kinds: of every excitation the seconds until the right explanation was ahead by odds above ten, None where it never
    was, and whether the machine left the box. A world counts where any of them decides. right: where it does not count,
    or the plan decides.
    """
    kinds = score_plan_kinds(second)
    counts = any(k["seconds"] is not None for k in kinds.values())
    said = [] if report is None else listed(claims_of(report["effects"]))
    return opened(
        answer,
        verdict="failed" if report is None else str(report["verdict"]),
        said=said,
        open=second is not None,
        listed=second is not None and second.listed,
        counts=counts,
        length=None if second is None else second.seconds,
        kinds=kinds,
        right=report is not None and (not counts or kinds[PLANNED]["seconds"] is not None),
    )


def score_plan_kinds(second: Second | None) -> dict[str, dict[str, Any]]:
    """What is said of each excitation."""
    if second is None:
        return {}
    return {
        kind: {"nats": d.nats, "seconds": None if d.part is None else d.part * second.seconds, "left": d.left}
        for kind, d in second.kinds.items()
    }
