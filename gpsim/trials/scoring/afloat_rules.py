"""What counts as right on what floats or stands: every effect with its size, and nothing said that is not there.

An effect is right that is told, in the headline or as a slight one, within 15 % of what it changes or with the truth in
its interval; or as a part of a combination that the diagnosis names. Two names are the same by definition, and only
these: a payload at a body's centre, whose moments of inertia are none, and more mass of that body.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gpsim.trials.blinding import Answer
from gpsim.trials.robots import SHOWS, spec_of
from gpsim.trials.scoring.claims import (
    FACTORS,
    Identity,
    Json,
    claims_of,
    failed,
    headline_of,
    identity,
    is_combined,
    is_part,
    listed,
    opened,
    parameter_errors,
    spurious_of,
)

WITHIN = 0.15  # of what an effect changes
TOLD = ("headline", "slight")
OFF_CENTRE = 0.02  # m from a body's centre of mass, at which a payload still is more mass of it


def score_afloat(answer: Answer, report: Json | None, rollouts: Mapping[str, float] | None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis; a missing report is wrong in all.

    parts: every effect, whether it counts, what was said of it, whether that is right. rollouts: channel -> error of
    held-out rollouts over that of the true model refitted.
    """
    effects, truth = answer.content["effects"], frozenset(answer.claims)
    wanted = ["named"] if truth else ["none"]
    out = opened(answer, verdicts=wanted, false_alarm=False)
    if report is None:
        parts = [_part(e, {}, False) for e in effects]
        return out | failed(parts=parts, **spurious_of([]), parameters=[], rollouts=None)
    said = [_by_its_mass(e, answer.world.system) for e in report["effects"]]
    combined = [set(c["of"]) for c in report["combinations"]]
    told = {identity(e): e for e in said if e.get("role", TOLD[0]) in TOLD}
    parts = [_part(e, told, any(is_part(e, names) for names in combined)) for e in effects]
    spurious = [
        e for e in headline_of(said) if identity(e) not in truth and not is_combined(e, truth, combined)
    ]
    verdict, names = str(report["verdict"]), claims_of(said)
    every = all(p["right"] for p in parts if p["counts"]) and not spurious
    if truth and combined:
        wanted = ["ambiguous", *wanted]
    return out | {
        "verdicts": wanted,
        "verdict": verdict,
        "said": listed(names),
        "parts": parts,
        **spurious_of(spurious),
        "verdict_right": verdict in wanted,
        "false_alarm": not truth and verdict != "none",
        "leading_right": every,
        "families_right": {f for f, _ in names} >= {f for f, _ in truth},
        "parameters": parameter_errors(effects, list(told.values())),
        "rollouts": max((rollouts or {}).values(), default=None),
        "right": every if truth else verdict == "none",
    }


def _part(effect: Json, told: Mapping[Identity, Json], combined: bool) -> dict[str, Any]:
    """Whether an effect was told, and right in its size; combined: it is a part of a combination that was named."""
    ((name, true),) = effect["parameters"].items()
    out = {"family": effect["family"], "on": effect["on"], "counts": effect["rollout"] >= SHOWS, "true": true}
    said = told.get(identity(effect))
    if said is None:
        return out | {"told": False, "value": None, "right": combined}
    found = said["parameters"][name]
    # An interval that is not known is the value alone.
    low, high = (found["value"] if found[edge] is None else found[edge] for edge in ("low", "high"))
    near = abs(found["value"] - true) <= WITHIN * abs(true - (1.0 if name in FACTORS else 0.0))
    right = bool(near or low <= true <= high or combined)
    return out | {"told": True, "value": found["value"], "right": right}


def _by_its_mass(effect: Json, system: str) -> Json:
    """A payload at the centre of what carries it, as that body's mass; anything else as it is."""
    if effect["family"] != "payload":
        return effect
    model, told = spec_of(system).compile(), effect["parameters"]
    body = model.body(str(effect["on"])).id
    at = np.array([told[axis]["value"] for axis in "xyz"]) - np.array(model.body_ipos[body])
    if np.linalg.norm(at) > OFF_CENTRE:
        return effect
    edges = told["mass"].items()
    ratio = {k: None if v is None else 1.0 + v / float(model.body_mass[body]) for k, v in edges if k in EDGES}
    return {
        **effect,
        "family": "parameter_offset",
        "on": f"{effect['on']}.mass",
        "parameters": {"ratio": ratio},
    }


EDGES = ("value", "low", "high")
