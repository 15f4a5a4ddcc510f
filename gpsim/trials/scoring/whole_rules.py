"""What counts as right on a whole robot: its rows, joint by joint, its bodies, what is said besides, and rollouts.

A row is the friction or the rotor of a joint, and counts where it makes 1 % of the joint's torque. Other names that are
the same by definition are taken for it: a servo's velocity gain for viscous friction, a bias of a command or an
encoder's zero behind a servo for a torque offset, late sensors for late commands.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gpsim.trials.blinding import Answer
from gpsim.trials.rivals import WholeListing
from gpsim.trials.robots import ROWS, Layout, layout_of, of_body, spec_of
from gpsim.trials.scoring.claims import (
    Claim,
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
from gpsim.trials.worlds import TrueEffect

COUNTS = 0.01  # of the joint's torque
WITHIN = 0.15  # of its true size, or of what changed bodies ask for
Sized = tuple[float, float, float]
"""A value, and its interval."""
ALIKE, COMBINED, OWN = "alike", "in a combination", "own name"


def score_whole(answer: Answer, report: Json | None, listing: WholeListing | None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of a whole robot; a missing report is wrong in all.

    rows: every row of the robot, whether it counts, what was said of it, whether that is right; bodies: the same of
    bodies, and by what; spurious: headline effects that are not there.
    """
    effects, truth = answer.content["effects"], frozenset(answer.claims)
    out = opened(answer, servos=bool(layout_of(answer.world.system).servos), verdicts=["named"])
    if report is None or listing is None:
        rows = [_row(e, None) for e in effects if e["family"] in ROWS]
        bodies = [_body(e, "") for e in effects if _of_body(e)]
        return out | failed(rows=rows, bodies=bodies, **spurious_of([]), parameters=[], rollouts=None)
    combined = [set(c["of"]) for c in report["combinations"]]
    said = _said_rows(report, answer)
    rows = [_row(e, said.get(identity(e))) for e in effects if e["family"] in ROWS]
    alike = listing.bodies_off <= WITHIN
    bodies = [_body(e, _how(e, report, combined, alike)) for e in effects if _of_body(e)]
    allowed = truth | _same(truth, layout_of(answer.world.system), list(answer.world.noise))
    spurious = [
        e
        for e in headline_of(report["effects"])
        if identity(e) not in allowed and not (alike and _of_body(e)) and not is_combined(e, truth, combined)
    ]
    verdict, names = str(report["verdict"]), claims_of(report["effects"])
    verdicts = ["ambiguous", "named"] if combined else ["named"]
    every = all(part["right"] for part in (*rows, *bodies) if part["counts"])
    return out | {
        "verdicts": verdicts,
        "verdict": verdict,
        "said": listed(names),
        "rows": rows,
        "bodies": bodies,
        "bodies_off": listing.bodies_off,
        **spurious_of(spurious),
        "verdict_right": verdict in verdicts,
        "leading_right": every,
        "families_right": {f for f, _ in names} >= {f for f, _ in truth},
        "parameters": parameter_errors(effects, report["effects"]),
        "rollouts": max(listing.rollouts.values(), default=None),
        "right": bool(verdict in verdicts and every and not spurious),
    }


def _of_body(effect: Json) -> bool:
    family, on = identity(effect)
    return of_body(TrueEffect(family, on, {}))


def _part(effect: Json) -> dict[str, Any]:
    counts = effect["share"] >= COUNTS
    return {"family": effect["family"], "on": effect["on"], "share": effect["share"], "counts": counts}


def _row(effect: Json, said: Sized | None) -> dict[str, Any]:
    """said: the value and its interval, where there is one."""
    (true,) = effect["parameters"].values()
    near = said is not None and (abs(said[0] - true) <= WITHIN * abs(true) or said[1] <= true <= said[2])
    value = None if said is None else said[0]
    return _part(effect) | {"told": said is not None, "true": true, "value": value, "right": bool(near)}


def _body(effect: Json, how: str) -> dict[str, Any]:
    return _part(effect) | {"how": how, "right": bool(how)}


def _how(effect: Json, report: Json, combined: Sequence[set[str]], alike: bool) -> str:
    """By what a body is right: its size under its own name, a combination that was named, or torques alike."""
    for p in parameter_errors([effect], report["effects"]):
        if p["name"] in ("mass", "ratio") and (p["covered"] or p["error_of_effect"] <= WITHIN):
            return OWN
    if any(is_part(effect, names) for names in combined):
        return COMBINED
    return ALIKE if alike else ""


def _said_rows(report: Json, answer: Answer) -> dict[Identity, Sized]:
    """Family and joint -> value, low and high of every row that was said; a servo's damping added to its joint's."""
    layout = layout_of(answer.world.system)
    found: dict[Identity, Sized] = {}
    for e in report["effects"]:
        (family, on), neutral, size = identity(e), 0.0, 1.0
        owner, _, what = on.rpartition(".")
        if family == "parameter_offset" and what == "kv" and owner in layout.servos:
            family, on = "viscous_friction", layout.driven[owner]
            neutral, size = 1.0, _damping(answer.world.system, owner)
        elif family not in ROWS:
            continue
        (told,) = e["parameters"].values()
        # An interval that is not known is the value alone.
        edges = (told["value"] if told[edge] is None else told[edge] for edge in ("low", "high"))
        values = [(float(x) - neutral) * size for x in (told["value"], *edges)]
        value, low, high = np.add(found.get((family, on), (0.0, 0.0, 0.0)), values).tolist()
        found[family, on] = value, low, high
    return found


def _damping(system: str, servo: str) -> float:
    """N m s/rad: a servo's velocity gain as it is believed."""
    model = spec_of(system).compile()
    return -float(np.array(model.actuator_biasprm)[list(layout_of(system).action).index(servo), 2])


def _same(truth: Claim, layout: Layout, channels: Sequence[str]) -> Claim:
    """What is the same as an effect that is there, by another name."""
    out = set()
    for action, joint in layout.driven.items():
        if ("constant_force", joint) in truth:
            out |= {("actuator_bias", action), ("joint_offset", joint)}
        if action in layout.servos:
            out.add(("parameter_offset", f"{action}.kv"))
        if ("actuator_delay", action) in truth:
            out |= {("sensor_delay", channel) for channel in channels}
    return frozenset(out)
