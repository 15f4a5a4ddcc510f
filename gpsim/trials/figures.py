"""The figures of every kind of worlds beside the plain ones, each with its interval, by strata and by family.

None stands where there is nothing to count. A failed diagnosis finds nothing and its verdict is wrong; it is left out
of the figures of which less is better.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gpsim.trials.intervals import (
    Score,
    coverage,
    flat,
    interval,
    mean,
    median,
    median_of,
    rate,
    rates_by,
    share,
    tally,
)

Key = Callable[[Score], str]
WITHIN = 1.3  # times the true model's own error after a rollout
CLEARLY = 0.95  # of the effects' error, that a black box must stay below to be better
PLANNED = "plan"
SERVOS = "_servos"
TOGETHER = ("actuator_lag", "actuator_delay")  # all actuators of what floats have them alike


def _of(name: str, nothing: str = "") -> Key:
    return lambda s: str(s[name] or nothing)


def _yes_or_no(name: str, yes: str = "yes", no: str = "no") -> Key:
    return lambda s: yes if s[name] else no


NOISE, EXCITATION = {"noise": _of("noise_level")}, {"excitation": _of("excitation")}
NOISE_KNOWN = {"noise known": _yes_or_no("noise_known")}
STRATA: Mapping[str, Mapping[str, Key]] = {
    "rough": {
        "called for": lambda s: " or ".join(s["verdicts"]), "main effects": lambda s: str(s["main"]),
        "system": _of("system"), "velocities": _of("velocities", "pose only"), **NOISE, **EXCITATION,
    },
    "mjcf": {
        "robot": _of("system"), "velocities": _of("velocities", "positions only"), **EXCITATION,
        "strength": _of("strength", "nothing missing"), **NOISE_KNOWN,
    },
    "machines": {
        "class": _of("kind"), "recordings": lambda s: str(s["recordings"]),
        "effects that count": lambda s: str(s["counting"]), "velocities": _of("velocities", "none"), **NOISE,
        **EXCITATION,
    },
    "whole": {
        "robot": lambda s: str(s["system"]).removesuffix(SERVOS),
        "driven by": _yes_or_no("servos", "position servos", "motors"),
        "read": _yes_or_no("velocities", "speeds, too", "positions in steps, rows lost"),
        "bodies off": lambda s: str(len(s["bodies"])), **NOISE_KNOWN,
    },
    "afloat": {
        "robot": _of("system"),
        "effects": lambda s: str(
            len({p["family"] if p["family"] in TOGETHER else (p["family"], p["on"]) for p in s["parts"]})
        ),
        "read": _yes_or_no("velocities", "pose and twist", "pose only"), **NOISE_KNOWN,
    },
    "curves": {
        "system": _of("system"), "velocities": _of("velocities", "pose only"), **NOISE, "strength": _of("strength"),
        **EXCITATION,
    },
}  # fmt: skip
"""Kind of worlds -> name of a stratum -> its value of a score."""


def answered(scores: Sequence[Score]) -> list[Score]:
    """Those of diagnoses that ended with an answer."""
    return [s for s in scores if s["verdict"] != "failed"]


def _parameters(scores: Sequence[Score], figure: str, scaled: bool = False) -> list[list[Any]]:
    """A figure of every parameter, world by world; scaled: only of those whose size means something."""
    each = [s.get("parameters", ()) for s in scores]
    return [[p[figure] for p in world if p["has_scale"] or not scaled] for world in each]


def _end(scores: Sequence[Score]) -> dict[str, Any]:
    """What every block has."""
    seconds = [float(s["seconds"]) for s in scores]
    return {
        "n": len(scores),
        "right": sum(bool(s["right"]) for s in scores),
        "failed": len(scores) - len(answered(scores)),
        "seconds": {"median": float(np.median(seconds)), "max": max(seconds)} if seconds else None,
    }


def _rough(scores: Sequence[Score]) -> dict[str, Any]:
    """Of rough worlds. Equivalents of another size count in proportion."""
    main, found = sum(s["main"] for s in scores), sum(s["found"] * s["main"] for s in scores)
    covered = flat(_parameters(scores, "covered"))
    return _end(scores) | {
        "headline_found": found / main if main else None,
        "interval_headline_found": interval(round(found), main),
        **share("verdict_right", [s["verdict_right"] for s in scores]),
        **_spurious(scores),
        **share("coverage_90", covered),
        "spurious_asserted": mean("", [float(s["asserted"]) for s in answered(scores)])[""],
        "main": main,
        "parameters": len(covered),
        "median_relative_error": median_of(flat(_parameters(scores, "relative_error", scaled=True))),
    }


def _robots(scores: Sequence[Score]) -> dict[str, Any]:
    """Of robots' worlds. A failed diagnosis of a world without effects is no alarm."""
    out = _end(scores) | coverage(_parameters(scores, "covered"))
    for size in ("single", "pair"):
        found = rate([s["right"] for s in scores if s["stratum"] == size], "right")
        out |= {f"{size}s": found["n"], f"{size}s_right": found["right"], f"{size}_right": found["share"]}
        out[f"interval_{size}_right"] = found["interval"]
    nothing = [bool(s.get("false_alarm")) for s in answered(scores) if s["stratum"] == "none"]
    return out | {
        "nulls": len(nothing),
        "alarms": sum(nothing),
        **share("false_alarms", nothing),
        "parameters": len(flat(_parameters(scores, "covered"))),
        **median("median_relative_error", _parameters(scores, "relative_error", scaled=True)),
        "interval_right": interval(out["right"], len(scores)),
    }


def _shares(hits: Mapping[str, Sequence[bool]], counted: bool = True) -> dict[str, Any]:
    """The share of each, its interval, and of how many it is."""
    out: dict[str, Any] = {}
    for name, each in hits.items():
        out |= share(name, each) | ({f"{name}_count": sum(map(bool, each))} if counted else {})
        out[f"{name}_of"] = len(each)
    return out


def _in_parts(scores: Sequence[Score], hits: Mapping[str, Sequence[bool]], counted: bool) -> dict[str, Any]:
    """Of worlds that are judged effect by effect: the shares of hits, and what all of them have."""
    near = [  # whether held-out rollouts are near the true model's; nothing where none could be compared
        s["verdict"] != "failed" and s["rollouts"] <= WITHIN
        for s in scores
        if s["verdict"] == "failed" or s["rollouts"] is not None
    ]
    ratios = [[float(s["rollouts"])] for s in answered(scores) if s["rollouts"] is not None]
    right = {"verdict_right": [s["verdict_right"] for s in scores], "rollouts_within": near}
    return {
        **_end(scores),
        **_shares({**hits, **right}, counted),
        **_spurious(scores),
        **coverage(_parameters(scores, "covered")),
        **median("median_rollouts", ratios),
    }


def _machines(scores: Sequence[Score]) -> dict[str, Any]:
    """Of whole machines."""
    told = rate([t["told"] for t in _counting(scores, "effects_told")], "told")
    black_boxes = [s["black_box"] for s in answered(scores) if s["black_box"] is not None]
    hits = {
        "sized": flat(_parameters(scores, "sized")),
        "black_box_better": [ratio < CLEARLY for ratio in black_boxes],
    }
    return _in_parts(scores, hits, counted=False) | {
        "told": told["share"],
        "interval_told": told["interval"],
        "counting": told["n"],
        "parameters": len(flat(_parameters(scores, "covered"))),
        "median_error_of_effect": median_of(flat(_parameters(scores, "error_of_effect", scaled=True))),
    }


def _whole(scores: Sequence[Score]) -> dict[str, Any]:
    """Of whole robots. A failed diagnosis has no row and no body right; it says nothing that is not there."""
    covered, rows = flat(_parameters(scores, "covered")), list(_counting(scores, "rows"))
    hits = {
        "rows_right": [r["right"] for r in rows],
        "rows_told": [r["told"] for r in rows],
        "bodies_right": [b["right"] for b in _counting(scores, "bodies")],
    }
    covers = {"coverage_90_count": sum(covered), "coverage_90_of": len(covered)}
    return _in_parts(scores, hits, counted=True) | covers | {"rollouts_limit": WITHIN}


def _afloat(scores: Sequence[Score]) -> dict[str, Any]:
    """Of what floats or stands. A failed diagnosis tells nothing and is no alarm."""
    hits = {
        "worlds_right": [s["right"] for s in scores],
        "false_alarms": [s["false_alarm"] for s in answered(scores) if not s["parts"]],
        "effects_right": [p["right"] for p in _counting(scores, "parts")],
        "coverage_90": flat(_parameters(scores, "covered")),
    }
    return _in_parts(scores, hits, counted=True)


def _curves(scores: Sequence[Score]) -> dict[str, Any]:
    """Of worlds with a law of no family. A failed diagnosis has no curve."""
    return {
        **_end(scores),
        **share("curve_right", [s["curve_right"] for s in scores]),
        **share("place_right", [s["place_right"] for s in scores]),
        **share("named_wrong", [s["named_wrong"] for s in answered(scores)]),
        "median_off": median_of([float(s["off"]) for s in scores if s["off"] is not None]),
    }


def _spurious(scores: Sequence[Score]) -> dict[str, Any]:
    """What was told and is not there, a world."""
    return mean("spurious", [float(s["spurious"]) for s in answered(scores)])


def _counting(scores: Sequence[Score], *kinds: str) -> Iterator[Mapping[str, Any]]:
    """Every row, or body, that counts."""
    return (part for s in scores for kind in kinds for part in s[kind] if part["counts"])


def _figures(scores: Sequence[Score], kind: str, block: Callable[..., Any], **more: Any) -> dict[str, Any]:
    """Those of all worlds, by strata, more, and the trials that are not right in all."""
    strata = {
        name: {v: block([s for s in scores if key(s) == v]) for v in sorted({key(s) for s in scores})}
        for name, key in STRATA[kind].items()
    }
    misses = [s["trial"] for s in scores if not s["right"]]
    return {**block(scores), "strata": strata, **more, "misses": misses}


def _verdicts(scores: Sequence[Score]) -> dict[str, dict[str, int]]:
    """What was said where what was called for."""
    return tally((" or ".join(s["verdicts"]), str(s["verdict"])) for s in scores)


def _strange(scores: Sequence[Score], of: str = "") -> dict[str, int]:
    """How often what was said and is not there was said: a family, or where `of` is a key of scores, its place, too."""
    names = (
        f"{s[of]}: {family} on {on}" if of else family
        for s in scores
        for family, on in s.get("spurious_names", ())
    )
    return dict(sorted(Counter(names).items()))


def rough_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """By defect of the log, too; main effects by family: whether they, or a whole equivalent, were in the headline."""
    hits = [(f, s["found"] == 1.0 or [f, on] in s["said"]) for s in scores for f, on in s["truth"]]
    said = {"families": rates_by(hits, "found"), "verdicts": _verdicts(scores)}
    out = _figures(scores, "rough", _rough, **said)
    defects = sorted({defect for s in scores for defect in s["defects"]})
    out["strata"]["defect"] = {d: _rough([s for s in scores if d in s["defects"]]) for d in defects}
    return out


def robot_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Single effects by family, too."""
    singles = [(s["truth"][0][0], s["right"]) for s in scores if s["stratum"] == "single"]
    return _figures(scores, "mjcf", _robots, families=rates_by(singles, "right"))


def machine_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """By family and class of machine, too: what counts and was told, and what was told and is not there."""
    told = [
        (f"{s['kind']}: {t['family']} on {t['on']}", t["told"])
        for s in scores
        for t in _counting([s], "effects_told")
    ]
    families, strange = rates_by(told, "told"), _strange(scores, "kind")
    more = {"families": families, "spurious_families": strange, "verdicts": _verdicts(scores)}
    return _figures(scores, "machines", _machines, **more)


def whole_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """By family and by joint, too, and what was said and is not there."""
    masses, robot = {"parameter_offset": "mass of a body"}, STRATA["whole"]["robot"]
    parts = _counting(scores, "rows", "bodies")
    families = rates_by(
        [(masses.get(part["family"], part["family"]), part["right"]) for part in parts], "right"
    )
    joints = [(f"{robot(s)}: {row['on']}", row["right"]) for s in scores for row in _counting([s], "rows")]
    more = {"families": families, "joints": rates_by(joints, "right"), "spurious_families": _strange(scores)}
    return _figures(scores, "whole", _whole, **more)


def afloat_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """Effects by family, too, and what was said and is not there."""
    families = rates_by([(p["family"], p["right"]) for p in _counting(scores, "parts")], "right")
    strange = _strange(scores, "system")
    return _figures(scores, "afloat", _afloat, families=families, spurious_families=strange)


def curve_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """By kind of law, too; of those that are visible, where what was visited shows that no line says the same."""
    seen = [s for s in scores if s["visible"] and s["identifiable"]]
    kinds = rates_by([(s["kind"], s["right"]) for s in seen], "right")
    return _figures(seen, "curves", _curves, families=kinds)


def plan_figures(scores: Sequence[Score]) -> dict[str, Any]:
    """counting: worlds that any excitation resolves; of those every kind's share, and how long it took.

    The median of the seconds takes one that never decides for infinitely long. over_fixed: the plan's median over that
    of the fixed excitation whose median is least.
    """
    counting, kinds = [s for s in scores if s["counts"]], {}
    for name in counting[0]["kinds"] if counting else ():
        each = [s["kinds"][name] for s in counting]
        seconds = [math.inf if k["seconds"] is None else float(k["seconds"]) for k in each]
        left = rate([k["left"] for k in each], "left")
        kinds[name] = rate([math.isfinite(s) for s in seconds], "resolved") | {
            "median_seconds": float(np.median(seconds)), "left": left["left"], "left_share": left["share"],
            "interval_left": left["interval"],
        }  # fmt: skip
    fixed = min((k["median_seconds"] for name, k in kinds.items() if name != PLANNED), default=math.inf)
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
        "over_fixed": plan["median_seconds"] / fixed if math.isfinite(fixed) else None,
        "failed": len(scores) - len(answered(scores)),
        "misses": [s["trial"] for s in scores if not s["right"]],
    }


FIGURES: Mapping[str, Callable[[Sequence[Score]], dict[str, Any]]] = {
    "rough": rough_figures,
    "mjcf": robot_figures,
    "machines": machine_figures,
    "whole": whole_figures,
    "afloat": afloat_figures,
    "curves": curve_figures,
    "plans": plan_figures,
}
"""Part of the summary -> its figures."""
