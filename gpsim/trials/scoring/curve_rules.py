"""What counts as right on a world whose law no family has: a measured curve at its site, of its input, near the law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.blinding import Answer
from gpsim.trials.scoring.claims import Json, asserted, claims_of, headline_of, identity

CURVES = "curves"
NEAR = 0.1  # of the true law's range, that a curve may be off in root mean square over what was visited
CONSTANTS = {"constant_force": "force", "sensor_bias": "offset", "actuator_bias": "bias"}
"""Families that may hold a curve's mean beside it, and the parameter that does."""


def score_curve(answer: Answer, report: Json | None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis; a missing report is wrong in all.

    off: how far the curve is from the law, in parts of the law's range; None without a curve at the right place.
    named_wrong: a law of the catalogue is said to hold.
    """
    (effect,) = answer.content["effects"]
    truth = answer.content["curve"]
    out: dict[str, Any] = {
        "stratum": CURVES,
        "kind": effect["family"],
        "visible": bool(answer.content["visible"]),
        "identifiable": True,
        "equivalents": [],
        "truth": [[effect["family"], effect["on"]]],
        "parameters": [],
    }
    wrong = dict.fromkeys(("right", "verdict_right", "leading_right", "families_right", "place_right"), False)
    if report is None:
        return out | wrong | {"verdict": "failed", "said": [], "off": None, "curve_right": False}
    headline, verdict = headline_of(report["effects"]), str(report["verdict"])
    off = _off(truth, effect["on"], report["effects"])
    near = off is not None and off <= NEAR
    named = [e for e in headline if asserted(e) and not _constant(e, effect["on"])]
    said_so = verdict in ("partial", "unknown")
    return out | {
        "verdict": verdict,
        "said": sorted(map(list, claims_of(report["effects"]))),
        "off": off,
        "place_right": off is not None,
        "curve_right": near,
        "named_wrong": bool(named),
        "verdict_right": said_so,
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


def _same(effect: Json, truth: Json, on: str) -> bool:
    """Whether it is a measured curve at the law's site and place, of its input."""
    curve = effect.get("curve")
    if not curve or identity(effect) != (truth["family"], on):
        return False
    return truth["input"] in (curve["input"], curve.get("second"))


def _constant(effect: Json, on: str) -> bool:
    return effect["family"] in CONSTANTS and identity(effect)[1] == on


def _told(curve: Json, truth: Json) -> FloatArray:
    """What the curve adds to what the base makes of its input, at the inputs of the answer."""
    x, at, values = np.array(truth["at"]), np.array(curve["at"]), np.array(curve["values"])
    if curve.get("second_at"):
        w, rows = np.array(truth["second"]), values.reshape(len(curve["second_at"]), len(at))
        lines = np.array([np.interp(w, at, row) for row in rows])
        return np.asarray(
            [np.interp(v, curve["second_at"], line) for v, line in zip(x, lines.T, strict=True)] - w
        )
    stays = 0.0 if truth["family"] == "force_curve" else x
    return np.asarray(np.interp(x, at, values) - stays)
