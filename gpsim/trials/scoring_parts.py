"""What counts as right in parts: machines, whole robots, what floats or stands, measured curves, plans.

- Machines: effects that count are told, headline or slight, nothing else is; sizes, rollouts, the verdict. An effect
  counts where it could be seen (see `judged`) and is needed for 1 % of the mismatch, or stands out of the noise by
  itself; others may be told.
- Whole robots: a row is the friction or the rotor of a joint, and counts where it makes 1 % of the joint's torque.
  Other names that are the same by definition are taken for it: a servo's velocity gain for viscous friction, a bias of
  a command or an encoder's zero behind a servo for a torque offset, late sensors for late commands.
- What floats or stands: an effect is right that is told, in the headline or as a slight one, within 15 % of what it
  changes or with the truth in its interval; or as a part of a combination that the diagnosis names. Two things are
  the same by definition, and only these: a payload at a body's centre, whose moments of inertia are none, and more mass
  of that body; and mass, inertia, drag, wind and all gains of what floats in one ratio: Newton's and Euler's equations
  have all of them as factors, so that no motion tells one unit from another. Taken are those that need no more numbers
  than the truth.
- A curve is right that was measured at the law's site, of its input, and is near the law. A plan is right that decides
  what a first recording left open.

A missing report is wrong in all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.trials.blinding import Answer
from gpsim.trials.claims import (
    FACTORS,
    Claim,
    Identity,
    Json,
    asserted,
    bounds,
    claims_of,
    failed,
    headline_of,
    identity,
    is_combined,
    is_part,
    listed,
    opened,
    parameter_errors,
    said_share,
    spurious_of,
    told_of,
    words_of,
)
from gpsim.trials.judged import MachineListing, Seen, WholeListing
from gpsim.trials.plan_rivals import PLANNED, Second
from gpsim.trials.robots import ROWS, SHOWS, Layout, layout_of, of_body, spec_of

NAMED_FROM, PARTIAL_FROM = 0.9, 0.5  # of the mismatch, that the main effects explain
EITHER = 0.03  # this near to a threshold both verdicts are right
SEEN, NEEDED, STANDS_OUT = 3.0, 0.01, 1.0  # nats, share of the mismatch, standard deviations of the noise
WITHIN = 0.15  # of what an effect changes, by which its size may be off, or of what changed bodies ask for
COUNTS = 0.01  # of the joint's torque
ALIKE, COMBINED, OWN = "alike", "in a combination", "own name"
SCALED = ("viscous_friction", "quadratic_drag", "constant_force")
LEAST = 0.03  # what a gain is off by at least where it is drawn
OFF_CENTRE = 0.02  # m from a body's centre of mass, at which a payload still is more mass of it
NEAR = 0.1  # of the true law's range, that a curve may be off in root mean square over what was visited
BENDS = 0.01
"""Of a law's range, that it must be off every straight line over what was visited: else a law of the catalogue says
the same there (0 where but two commands were given; 0.05 and more of 23 laws of seed 2060)."""
CONSTANTS = {"constant_force": "force", "sensor_bias": "offset", "actuator_bias": "bias"}
"""Families that may hold a curve's mean beside it, and the parameter that does."""


def rough_verdicts(explained: float, equivalents: bool) -> set[str]:
    """The verdicts that a true share calls for: two of them near a threshold."""
    found: set[str] = set()
    if explained >= NAMED_FROM - EITHER:
        found |= {"named", "ambiguous"} if equivalents else {"named"}
    if PARTIAL_FROM - EITHER <= explained < NAMED_FROM + EITHER:
        found.add("partial")
    if explained < PARTIAL_FROM + EITHER:
        found.add("unknown")
    return found


def claims_of_nuisances(answer: Answer) -> Claim:
    """What a nuisance may be called: it is there. That is the lag of a late topic, and a kind that has become a word.

    Where all topics of the state are late together, that is the same as a late command.
    """
    world = answer.world
    late = world.rough.late if world.rough else {}
    claims = {("sensor_delay", channel) for channel in late}
    if set(late) == set(world.noise):
        claims |= {("actuator_delay", action) for action in answer.actions}
    return frozenset(claims | words_of(answer.content["effects"]))


def score_machine(answer: Answer, report: Json | None, listing: MachineListing | None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of a machine.

    effects_told: every effect of the machine, whether it counts and whether it was told, by its own name or by one that
    stands for it; spurious: what was told and is none of them, nor what a nuisance may be called.
    """
    own = [e for e in answer.content["effects"] if not e["outside"]]
    truth, machine = frozenset(answer.claims), answer.content["world"]["machine"]
    explained = float(answer.content["machine"]["explained"])
    # Of a trial that could not be judged: what the answer itself says.
    unjudged = tuple(Seen(math.inf, float(e["share"] or 0.0), float(e["beyond"])) for e in own)
    pairs = list(zip(own, listing.seen if listing else unjudged, strict=True))
    out = opened(
        answer,
        kind=machine["kind"],
        recordings=len(machine["sessions"]),
        explained=explained,
        verdicts=sorted(rough_verdicts(explained, False)),
        counting=sum(_counts(seen) for _, seen in pairs),
    )
    if report is None or listing is None:
        untold = [_of_effect(e, s, False) for e, s in pairs]
        nothing = {"told": 0, "spurious": 0, "parameters": [], "rollouts": None, "black_box": None}
        return out | failed(effects_told=untold, **nothing)
    said = claims_of(report["effects"])
    # The leader as a whole may be an equivalent of the truth, in other words than its own.
    whole = bool(listing.equivalent and listing.equivalent[0]) and said != truth
    places = set(listing.stands.values())
    told = [_of_effect(e, s, whole or identity(e) in said | places) for e, s in pairs]
    allowed = truth | set(listing.stands) | claims_of_nuisances(answer)
    spurious = [] if whole else [e for e in report["effects"] if identity(e) not in allowed]
    counting = [t for t in told if t["counts"]]
    equivalents = whole or bool(listing.stands) or any(listing.equivalent[1:])
    # Sizes of the effects that count and were told by their own names; of two that changed places neither.
    names = {(t["family"], t["on"]) for t in counting}
    values = [e for e in listing.values if not whole and (e["family"], e["on"]) in names]
    sizes = parameter_errors(values, report["effects"])
    every, verdicts = all(t["told"] for t in counting), sorted(rough_verdicts(explained, equivalents))
    return out | {
        "identifiable": not equivalents,
        "equivalents": [listed((truth - places) | set(listing.stands))] if listing.stands else [],
        "said_explained": said_share(report),
        "effects_told": told,
        "told": sum(t["told"] for t in counting),
        "spurious_headline": len(headline_of(spurious)),
        "parameters": [p | {"sized": bool(p["covered"] or p["error_of_effect"] <= WITHIN)} for p in sizes],
        "rollouts": max(listing.rollouts.values(), default=None),
        "black_box": black_box(report["fit"]["rollout"]),
        **told_of(report, said, frozenset(names), verdicts, spurious, every),
    }


def of_first(report: Json) -> dict[str, Any]:
    """The report with the effects that act in the first recording, as large as they are there; its held-out episodes.

    A report of one recording stays what it is.
    """
    several = report.get("recordings")
    if not several:
        return dict(report)
    name = str(several[0]["name"])

    def there(effects: list[Json]) -> list[dict[str, Any]]:
        """Those that act in the recording, with its own values where it has some."""
        return [
            {**e, "parameters": {**e["parameters"], **(e.get("own") or {}).get(name, {})}}
            for e in effects
            if e.get("recordings") is None or name in e["recordings"]
        ]

    held = [str(n) for n in report["fit"]["held_out"]]
    mine = [n.removeprefix(f"{name}/") for n in held if n.startswith(f"{name}/")]
    others = [{**a, "effects": there(a["effects"])} for a in report["alternatives"]]
    fit = {**report["fit"], "held_out": mine}
    return {**report, "effects": there(report["effects"]), "alternatives": others, "fit": fit}


def black_box(rollout: Mapping[str, Any]) -> float | None:
    """Error of the base with a Gaussian process over that with the effects, after held-out rollouts.

    The geometric mean over the measured channels; infinite where it ran away, None where nothing was measured.
    """
    channels = [e for e in rollout.values() if isinstance(e, Mapping) and e.get("after")]
    if not channels:
        return None
    ratios = [math.inf if e.get("gp") is None else float(e["gp"]) / float(e["after"]) for e in channels]
    return math.exp(sum(math.log(max(r, 1e-9)) for r in ratios) / len(ratios))


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


def score_whole(answer: Answer, report: Json | None, listing: WholeListing | None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of a whole robot.

    rows: every row of the robot, whether it counts, what was said of it, whether that is right; bodies: the same of
    bodies, and by what; spurious: headline effects that are not there.
    """
    effects, truth = answer.content["effects"], frozenset(answer.claims)
    layout = layout_of(answer.world.system)
    out = opened(answer, servos=bool(layout.servos), verdicts=["named"])
    rows_of = [e for e in effects if e["family"] in ROWS]
    bodies_of = [e for e in effects if of_body(*identity(e))]
    if report is None or listing is None:
        rows, bodies = [_row(e, None) for e in rows_of], [_body(e, "") for e in bodies_of]
        return out | failed(rows=rows, bodies=bodies, **spurious_of([]), parameters=[], rollouts=None)
    combined = [set(c["of"]) for c in report["combinations"]]
    said = _said_rows(report, answer.world.system)
    rows = [_row(e, said.get(identity(e))) for e in rows_of]
    alike = listing.bodies_off <= WITHIN
    bodies = [_body(e, _how(e, report, combined, alike)) for e in bodies_of]
    allowed = truth | _same(truth, layout, list(answer.world.noise))
    spurious = [
        e
        for e in headline_of(report["effects"])
        if identity(e) not in allowed
        and not (alike and of_body(*identity(e)))
        and not is_combined(e, truth, combined)
    ]
    every = all(part["right"] for part in (*rows, *bodies) if part["counts"])
    verdicts = ["ambiguous", "named"] if combined else ["named"]
    return out | {
        "rows": rows,
        "bodies": bodies,
        "bodies_off": listing.bodies_off,
        "parameters": parameter_errors(effects, report["effects"]),
        "rollouts": max(listing.rollouts.values(), default=None),
        **told_of(report, claims_of(report["effects"]), truth, verdicts, spurious, every),
    }


def _part(effect: Json, **more: Any) -> dict[str, Any]:
    counts = effect["share"] >= COUNTS
    return {"family": effect["family"], "on": effect["on"], "share": effect["share"], "counts": counts} | more


def _row(effect: Json, said: Sequence[float] | None) -> dict[str, Any]:
    """said: the value and its interval, where there is one."""
    (true,) = effect["parameters"].values()
    near = said is not None and (abs(said[0] - true) <= WITHIN * abs(true) or said[1] <= true <= said[2])
    value = None if said is None else said[0]
    return _part(effect, told=said is not None, true=true, value=value, right=bool(near))


def _body(effect: Json, how: str) -> dict[str, Any]:
    return _part(effect, how=how, right=bool(how))


def _how(effect: Json, report: Json, combined: Sequence[set[str]], alike: bool) -> str:
    """By what a body is right: its size under its own name, a combination that was named, or torques alike."""
    for p in parameter_errors([effect], report["effects"]):
        if p["name"] in ("mass", "ratio") and (p["covered"] or p["error_of_effect"] <= WITHIN):
            return OWN
    if any(is_part(effect, names) for names in combined):
        return COMBINED
    return ALIKE if alike else ""


def _said_rows(report: Json, system: str) -> dict[Identity, list[float]]:
    """Family and joint -> value, low and high of every row that was said; a servo's damping added to its joint's."""
    layout = layout_of(system)
    found: dict[Identity, list[float]] = {}
    for e in report["effects"]:
        (family, on), neutral, size = identity(e), 0.0, 1.0
        owner, _, what = on.rpartition(".")
        if family == "parameter_offset" and what == "kv" and owner in layout.servos:
            # N m s/rad: a servo's velocity gain as it is believed.
            believed = np.array(spec_of(system).compile().actuator_biasprm)
            family, on = "viscous_friction", layout.driven[owner]
            neutral, size = 1.0, -float(believed[list(layout.action).index(owner), 2])
        elif family not in ROWS:
            continue
        (told,) = e["parameters"].values()
        values = [(float(x) - neutral) * size for x in (told["value"], *bounds(told))]
        found[family, on] = np.add(found.get((family, on), (0.0, 0.0, 0.0)), values).tolist()
    return found


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


def score_afloat(answer: Answer, report: Json | None, rollouts: Mapping[str, float] | None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of what floats or stands.

    parts: every effect, whether it counts, what was said of it, whether that is right. rollouts: channel -> error of
    held-out rollouts over that of the true model refitted.
    """
    effects, truth = answer.content["effects"], frozenset(answer.claims)
    wanted = ["named"] if truth else ["none"]
    out = opened(answer, verdicts=wanted, false_alarm=False)
    if report is None:
        parts = [_told(e, {}, False) for e in effects]
        return out | failed(parts=parts, **spurious_of([]), parameters=[], rollouts=None)
    said = [_by_its_mass(e, answer.world.system) for e in report["effects"]]
    combined = [set(c["of"]) for c in report["combinations"]]
    told = {identity(e): e for e in said if e.get("role", "headline") in ("headline", "slight")}
    judged: list[tuple[int, int, Sequence[Json], list[dict[str, Any]], list[Json]]] = []
    for alike in _alike(effects, answer.world.system):
        there = claims_of(alike)
        parts = [_told(e, told, any(is_part(e, names) for names in combined)) for e in alike]
        more = [
            e for e in headline_of(said) if identity(e) not in there and not is_combined(e, there, combined)
        ]
        wrong = sum(p["counts"] and not p["right"] for p in parts) + len(more)
        judged.append((wrong, len(judged), alike, parts, more))
    least, _, effects, parts, spurious = min(judged, key=lambda j: j[:2])
    every, quiet = least == 0, report["verdict"] == "none"
    if truth and combined:
        wanted = ["ambiguous", *wanted]
    return (
        out
        | told_of(report, claims_of(said), truth, wanted, spurious, every)
        | {
            "parts": parts,
            "false_alarm": not truth and not quiet,
            "parameters": parameter_errors(effects, list(told.values())),
            "rollouts": max((rollouts or {}).values(), default=None),
            "right": every if truth else quiet,
        }
    )


def _alike(effects: Sequence[Json], system: str) -> list[Sequence[Json]]:
    """The truth; and of what floats the same in other units of mass, in which a gain, a mass or an inertia is right."""
    layout, out = layout_of(system), [effects]
    if layout.driven or not effects:
        return out
    body, told = spec_of(system).compile().body(1).name, {identity(e): e for e in effects}
    names = {("parameter_offset", f"{body}.{what}"): "ratio" for what in ("mass", "inertia")}
    names |= {("actuator_gain", action): "gain" for action in layout.action}
    factors = {key: told[key]["parameters"][name] if key in told else 1.0 for key, name in names.items()}
    for unit in sorted({x for x in factors.values() if x != 1.0}):
        made: list[Json] = []
        for e in effects:
            size = 1.0 / unit if e["family"] in SCALED else 1.0
            if identity(e) not in factors:
                made.append({**e, "parameters": {k: v * size for k, v in e["parameters"].items()}})
        for (family, on), x in factors.items():
            if x != unit:
                seen = SHOWS if abs(x / unit - 1.0) >= LEAST else 0.0
                size_now = {names[family, on]: x / unit}
                made.append({"family": family, "on": on, "rollout": seen, "parameters": size_now})
        if len(made) <= len(effects):
            out.append(made)
    return out


def _told(effect: Json, told: Mapping[Identity, Json], combined: bool) -> dict[str, Any]:
    """Whether an effect was told, and right in its size; combined: it is a part of a combination that was named."""
    ((name, true),) = effect["parameters"].items()
    out = {"family": effect["family"], "on": effect["on"], "counts": effect["rollout"] >= SHOWS, "true": true}
    said = told.get(identity(effect))
    if said is None:
        return out | {"told": False, "value": None, "right": combined}
    found = said["parameters"][name]
    low, high = bounds(found)
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
    mass, edges = float(model.body_mass[body]), (told["mass"].get(k) for k in ("value", "low", "high"))
    value, low, high = (None if v is None else 1.0 + v / mass for v in edges)
    ratio = {"ratio": {"value": value, "low": low, "high": high}}
    return {**effect, "family": "parameter_offset", "on": f"{effect['on']}.mass", "parameters": ratio}


def score_curve(answer: Answer, report: Json | None, nothing: None = None) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of a world whose law no family has.

    off: how far the curve is from the law, in parts of the law's range; None without a curve at the right place.
    named_wrong: a law of the catalogue is said to hold. identifiable: what was visited shows that the law is no line.
    """
    (effect,) = answer.content["effects"]
    truth, on = answer.content["curve"], effect["on"]
    out = opened(
        answer,
        kind=effect["family"],
        visible=bool(answer.content["visible"]),
        parameters=[],
        identifiable=_bends(truth) > BENDS,
        truth=[[effect["family"], on]],
    )
    if report is None:
        return out | failed(off=None, place_right=False, curve_right=False)
    verdict, off = str(report["verdict"]), _off(truth, on, report["effects"])
    near = off is not None and off <= NEAR
    named = [e for e in headline_of(report["effects"]) if asserted(e) and not _constant(e, on)]
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
    """Root mean square of the difference over what was visited, in parts of the law's range.

    None where no curve was measured at the law's site and place, of its input.
    """
    own = [e for e in effects if e.get("curve") and identity(e) == (truth["family"], on)]
    found = [e for e in own if truth["input"] in (e["curve"]["input"], e["curve"].get("second"))]
    if not found:
        return None
    beside = sum(float(e["parameters"][CONSTANTS[e["family"]]]["value"]) for e in effects if _constant(e, on))
    adds = np.array(truth["adds"])
    rest = _measured(found[0]["curve"], truth) + beside - adds
    return float(np.sqrt(np.mean(rest**2)) / max(float(np.ptp(adds)), 1e-300))


def _bends(truth: Json) -> float:
    """Root mean square of what a straight line misses of the law, in parts of the law's range."""
    adds, x = np.array(truth["adds"]), np.array([truth["at"], truth.get("second", truth["at"])]).T
    line = np.column_stack([np.ones(len(x)), x])
    rest = adds - line @ np.linalg.lstsq(line, adds)[0]
    return float(np.sqrt(np.mean(rest**2)) / max(float(np.ptp(adds)), 1e-300))


def _constant(effect: Json, on: str) -> bool:
    return effect["family"] in CONSTANTS and identity(effect)[1] == on


def _measured(curve: Json, truth: Json) -> FloatArray:
    """What the curve adds to what the base makes of its input, at the inputs of the answer; held beyond its ends."""
    x, at, values = np.array(truth["at"]), np.array(curve["at"]), np.array(curve["values"])
    if curve.get("second_at"):
        w, rows = np.array(truth["second"]), values.reshape(len(curve["second_at"]), len(at)) - at
        lines = np.array([np.interp(w, at, row) for row in rows])
        pairs = zip(x, lines.T, strict=True)
        return np.asarray([np.interp(v, curve["second_at"], line) for v, line in pairs])
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
    return opened(
        answer,
        verdict="failed" if report is None else str(report["verdict"]),
        said=[] if report is None else listed(claims_of(report["effects"])),
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
