"""The score of one trial: its answer revealed, its equivalents listed, the diagnosis and PySINDy judged by them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gpsim.files import plain, tells_of_full_disk, written_whole
from gpsim.trials.blinding import Answer, diagnosis_digest, read_outcome, read_report, reveal
from gpsim.trials.rivals import (
    Listing,
    Second,
    afloat_rollouts,
    cached_listing,
    machine_listing,
    robot_rivals,
    second_recordings,
    whole_listing,
)
from gpsim.trials.scoring.afloat_rules import score_afloat
from gpsim.trials.scoring.claims import Json
from gpsim.trials.scoring.contradictions import contradictions
from gpsim.trials.scoring.curve_rules import score_curve, score_plan
from gpsim.trials.scoring.machine_rules import of_first, score_machine
from gpsim.trials.scoring.rules import score
from gpsim.trials.scoring.whole_rules import score_whole

SCORES = "scores"


def score_trial(out: Path, answers: Path, name: str) -> dict[str, Any]:
    """Score a diagnosed trial anew and write OUT/scores/NAME.json; raises UsageError when its answer is refused.

    What goes wrong after that, a full disk apart, is the trial's own error: it counts as wrong and stops no other.
    """
    answer = reveal(out, answers, name)
    outcome = read_outcome(out, name)
    try:
        report = read_report(out, name)
        found = _judged(out, name, answer, outcome, report) | {"scored": True, "error": outcome["error"]}
        found["contradictions"] = [] if report is None else contradictions(report)
    except Exception as error:  # whatever it is, it must not block the reveal of the others
        if isinstance(error, OSError) and tells_of_full_disk(str(error)):
            raise
        found = _unscored(answer) | {"scored": False, "rivals": [], "sindy": None}
        found["error"] = f"not scored: {type(error).__name__}: {' '.join(str(error).split())[:200]}"
    found |= _of_world(answer) | {
        "trial": name,
        "diagnosis_sha256": diagnosis_digest(out, name),
        "git_commit": outcome.get("git_commit"),
        "seconds": outcome["seconds"],
    }
    path = out / SCORES / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as made:
        made.write_text(json.dumps(plain(found), indent=1) + "\n", encoding="utf-8")
    return found


def _second(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> Second | None:
    left_open = report is not None and report["alternatives"]
    return second_recordings(out, name, answer) if left_open else None


Rules = tuple[Callable[..., Any], Callable[..., dict[str, Any]]]
BY_THEMSELVES: Mapping[str, Rules] = {
    "machines": (machine_listing, score_machine),
    "whole": (whole_listing, score_whole),
    "afloat": (afloat_rollouts, score_afloat),
    "curves": (lambda *given: None, lambda answer, report, nothing: score_curve(answer, report)),
    "plans": (_second, score_plan),
}
"""Stratum -> what is dear to find out of a trial, and how its diagnosis is judged by that."""


def _judged(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> dict[str, Any]:
    """The diagnosis by the rules of its stratum, and what stands beside it."""
    stratum = answer.content["stratum"]
    if stratum in BY_THEMSELVES:
        listing, rules = BY_THEMSELVES[stratum]
        first = of_first(report) if report is not None and stratum == "machines" else report
        found = rules(answer, first, listing(out, name, answer, outcome, first))
        return found | {"rivals": [], "sindy": None}
    if "robot" in answer.content:  # of a robot's world those that were said
        listed = Listing(robot_rivals(out, name, answer, outcome, report), None)
    else:
        listed = cached_listing(out, name, answer, outcome)
    return score(answer, report, listed.rivals) | _beside(answer, listed)


def _unscored(answer: Answer) -> dict[str, Any]:
    """As a failed diagnosis scores."""
    stratum = answer.content["stratum"]
    return (
        BY_THEMSELVES[stratum][1](answer, None, None) if stratum in BY_THEMSELVES else score(answer, None, [])
    )


def _of_world(answer: Answer) -> dict[str, Any]:
    """What the strata need."""
    content, world = answer.content, answer.world
    effects = content["effects"]
    gates = {"region" if e["region"] else "since" for e in effects if e["region"] or e["since"] is not None}
    order = ("subtle", "medium", "plain")
    return {
        "long": content["long"],
        "transitions": content["transitions"],
        "system": world.system,
        "engine": world.engine,
        "noise_level": world.noise_level,
        "noise_known": world.noise_known,
        "velocities": world.velocities,
        "excitation": world.excitation,
        "strength": min((e["strength"] for e in effects if e["strength"]), key=order.index, default=""),
        "gate": ", ".join(sorted(gates)) or "everywhere",
        "effects": effects,
        "defects": next((content[k]["defects"] for k in ("rough", "machine", "whole") if k in content), []),
    }


def _beside(answer: Answer, listed: Listing) -> dict[str, Any]:
    """The rivals that came nearest, and whether PySINDy was right."""
    right = {frozenset(answer.claims)} | {frozenset(r.claims) for r in listed.rivals if r.equivalent}
    said = listed.sindy
    return {
        "rivals": [{"claims": list(map(list, r.claims)), "nats_lost": r.loss} for r in listed.rivals[:6]],
        "sindy": None if said is None else {"said": list(map(list, said)), "right": frozenset(said) in right},
    }
