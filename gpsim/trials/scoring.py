"""What counts as right: one diagnosis against its answer, by the rules of its stratum (`RULES`).

Claims are sets of (family, place). A claim is right when it is the truth or one of the world's listed equivalents. On
plain worlds and robots of few effects every effect counts, slight ones, too; on rough worlds the headline. The rules
are pure functions: no files, no fits. `score_trial` reveals an answer, has its equivalents listed, and judges.

A diagnosis.json may contradict itself, too: verdict, odds, probabilities, sizes and claims must agree. The rules are
those by which a verdict is made, read from the file alone, so that any file can be held to them. A file of an earlier
version lacks some keys, and is not held to what they say.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.diagnosis.settings import VerdictSettings
from gpsim.effects import own_name
from gpsim.files import plain, tells_of_full_disk, written_whole
from gpsim.findings import Estimate, no_size, read, sized
from gpsim.trials.blinding import Answer, diagnosis_digest, read_outcome, read_report, reveal
from gpsim.trials.claims import (
    Claim,
    Json,
    asserted,
    claims_of,
    failed,
    gate_figures,
    headline_of,
    identity,
    listed,
    opened,
    parameter_errors,
    said_share,
    told_of,
    words_of,
)
from gpsim.trials.fits import Listing, Rival, cached_listing
from gpsim.trials.judged import afloat_rollouts, machine_listing, robot_rivals, whole_listing
from gpsim.trials.plan_rivals import second_recordings
from gpsim.trials.scoring_parts import (
    claims_of_nuisances,
    of_first,
    rough_verdicts,
    score_afloat,
    score_curve,
    score_machine,
    score_plan,
    score_whole,
)
from gpsim.trials.worlds import SYSTEMS

FEW, MANY = 0.03, 0.9  # of the samples: a region that holds less, or more, is none
CLOSE = 1.025  # of a ratio of probabilities: explanations are as likely, and numbers are rounded in the file


def contradictions(diagnosis: Json) -> list[str]:
    """What of a diagnosis.json, as it was parsed, contradicts something else in it; empty where nothing does."""
    verdict, effects = diagnosis["verdict"], diagnosis["effects"]
    claims = [e for e in effects if e.get("role", "headline") == "headline"]
    found = list(_probabilities(diagnosis))
    for effect in effects:
        share = effect.get("acts_in")
        if share is not None and not FEW <= share <= MANY:
            found.append(f"{_name(effect)} is limited, and acts in {100 * share:.3g} % of the samples")
    if verdict in ("unknown", "none"):
        return found + [f"verdict {verdict}, and {_name(e)} is a headline effect" for e in claims]
    for effect in claims:
        if no_size(effect["family"], _sizes(effect)):
            found.append(f"the size of {_name(effect)}, a headline effect, is unknown")
    if not effects:
        found.append(f"verdict {verdict}, without an effect")
    if verdict == "named":
        found += _named(diagnosis, claims)
    if verdict == "ambiguous" and not diagnosis["alternatives"] and not any(_low(e) for e in claims):
        found.append("verdict ambiguous, but without an alternative or low odds")
    return found


def _named(diagnosis: Json, claims: Sequence[Json]) -> Iterator[str]:
    """What an account that is named must not have."""
    if not claims:
        yield "verdict named, without a headline effect"
    for effect in claims:
        sizes = _sizes(effect)
        if any(size.at_bound for size in sizes.values()):
            yield f"verdict named, but {_name(effect)} stopped at its bound"
        if not sized(effect["family"], sizes):
            yield f"verdict named, but the size of {_name(effect)} is unknown"
        if effect.get("form") == "approximate":
            yield f"verdict named, but the law of {_name(effect)} holds only approximately"
        if _low(effect):
            yield f"verdict named, but the odds against an account without {_name(effect)} are low"
    for rival in diagnosis["alternatives"]:
        lacking = set(map(_claim, claims)) - set(map(_claim, rival["effects"]))
        if lacking:
            yield f"verdict named, but an alternative lacks {', '.join(f'{f} on {on}' for f, on in sorted(lacking))}"
    explained = diagnosis.get("explained") or {}
    share = explained.get("rollout") or {"share": 0.0, "high": None}
    something = diagnosis.get("remainder", {}).get("structured") or explained.get("counts", True)
    if something and share["high"] is not None and share["high"] < VerdictSettings().nearly_all:
        yield "verdict named, but much less than nine tenths are explained"
    most = share["share"] if share["high"] is None else share["high"]
    taken = (diagnosis["fit"].get("black_box") or {"takes_off": {"share": 0.0}})["takes_off"]
    least = taken["share"] if taken.get("low") is None else taken["low"]
    if least > VerdictSettings().black_box and most < 1 - VerdictSettings().headline:
        yield "verdict named, but a black box removes more than a quarter of the error"


def _probabilities(diagnosis: Json) -> Iterator[str]:
    """Of explanations: they add up, and verdict and odds go by them."""
    effects, rivals = diagnosis["effects"], diagnosis["alternatives"]
    if not effects:
        return
    own = {e["probability"] for e in effects}
    if len(own) > 1:
        yield "effects of one account have different probabilities"
    leader, best = max(own), max((r["probability"] for r in rivals), default=0.0)
    if leader + sum(r["probability"] for r in rivals) > 1.0 + 1e-6:
        yield "probabilities add up to more than 1"
    margin = math.exp(VerdictSettings().tie) * CLOSE
    if best > margin * leader:
        yield f"the leader's probability is {leader:.2g}, an alternative's {best:.2g}"
    if best > leader * CLOSE and diagnosis.get("leads", "simplest") == "likeliest":
        yield "the leader is called the likeliest, but an alternative is more likely"
    for effect in effects:
        nats = (effect.get("odds") or {}).get("nats")
        against = [r["probability"] for r in rivals if _claim(effect) not in map(_claim, r["effects"])]
        if nats is not None and against and leader > 0.0:
            said = math.log(leader / max(max(against), 1e-300))
            if nats > said + math.log(CLOSE):
                yield f"the odds against an account without {_name(effect)} contradict its probability"


def _low(effect: Json) -> bool:
    """Whether the odds of a claim are low."""
    nats = (effect.get("odds") or {}).get("nats")
    return nats is not None and nats < math.log(VerdictSettings().odds)


def _sizes(effect: Json) -> dict[str, Estimate]:
    """Those that recordings share, and what is one recording's own of several."""
    sizes = dict(effect["parameters"])
    for place, own in enumerate((effect.get("own") or {}).values()):
        sizes |= {own_name(name, place): size for name, size in own.items()}
    return {name: read(Estimate, size, name) for name, size in sizes.items()}


def _claim(effect: Json) -> tuple[str, str]:
    on = effect["on"]
    return effect["family"], on if isinstance(on, str) else ",".join(on)


def _name(effect: Json) -> str:
    return " on ".join(_claim(effect))


SCORES = "scores"
LEAST_SEEN = 0.05  # a true share below which one step cannot show in which rate the effect is
LEADING_RATE = 0.5  # a rate with at least this share of the largest true share is a right one to point at


def score(answer: Answer, report: Json | None, rivals: Sequence[Rival]) -> dict[str, Any]:
    """Everything that can be said of one diagnosis; a missing report is a failed diagnosis, wrong in all."""
    if answer.content["stratum"] == "rough":
        return score_rough(answer, report, rivals)
    effects, truth = answer.content["effects"], frozenset(answer.claims)
    inside, robot = not any(e["outside"] for e in effects), answer.content.get("robot")
    equal = {frozenset(r.claims) for r in rivals if r.equivalent} - {truth}
    named = words_of(effects)
    words = {frozenset(named)} if named and len(effects) == 1 else set()
    right_claims = (equal | {truth}) if inside else equal | words
    out = opened(answer, equal, visible=bool(answer.content.get("visible", True)))
    out["truth"] = out["truth"] or [[e["family"], e["on"]] for e in effects]
    if (
        robot is not None
    ):  # no effect has a gate, so none may be claimed; neither rates nor one step are scored
        out |= {"robot": robot, "parameters": []}
    if report is None:
        gates = gate_figures(effects, [], {}, 1.0, stands_in=False)
        return out | failed() | {name: worst for name, worst in gates.items() if name != "gate_right"}
    verdict, leader = str(report["verdict"]), claims_of(report["effects"])
    families = [sorted(f for f, _ in claims) for claims in (leader, *right_claims)]
    out |= {
        "verdict": verdict,
        "said": listed(leader),
        "alternatives": sorted(listed(claims_of(a["effects"])) for a in report["alternatives"]),
        "leading_right": leader in right_claims and bool(leader),
        "families_right": families[0] in families[1:] and bool(leader),
        "found": len(leader & truth),
        "verdict_right": verdict in _verdicts(out["stratum"], equal | words),
        "right": _right(out["stratum"], report, truth, right_claims),
    }
    if out["stratum"] == "none":
        out["false_alarm"] = verdict in ("named", "ambiguous", "partial") or bool(leader)
    if not inside:
        out |= _outside(report, frozenset().union(*equal, *words))
        out["right"] = bool(out["said_so"] or (verdict == "named" and out["leading_right"]))
    elif truth or robot is not None:
        out["parameters"] = parameter_errors(effects, report["effects"]) if leader == truth else []
    if robot is not None:
        out["gated"] = any(e["region"] or e["since"] is not None for e in report["effects"])
        return out | {"right": bool(out["right"] and (out["stratum"] == "none" or not out["gated"]))}
    if inside and truth:
        out |= _location(answer, report, leader, right_claims)
    return out | {"fit": held_out_fit(answer, report)}


def score_rough(answer: Answer, report: Json | None, rivals: Sequence[Rival]) -> dict[str, Any]:
    """Everything that can be said of one diagnosis of a rough world; a missing report finds nothing.

    found: share of the main effects among the headline, or of an equivalent of them all; spurious: headline effects
    that are neither, nor what a nuisance may be called; asserted: those of them that are said to hold, with odds.
    """
    truth = frozenset(answer.claims)
    equal = {frozenset(r.claims) for r in rivals if r.equivalent and r.claims} - {truth}
    explained = float(answer.content["rough"]["explained"])
    verdicts = rough_verdicts(explained, bool(equal))
    out = opened(answer, equal, explained=explained, verdicts=sorted(verdicts), main=len(truth))
    if report is None:
        return out | failed(found=0.0, spurious=0, asserted=0, parameters=[])
    headline, right_claims = headline_of(report["effects"]), {truth, *equal}
    said = claims_of(headline)
    allowed = frozenset().union(*right_claims) | claims_of_nuisances(answer)
    spurious = [e for e in headline if identity(e) not in allowed]
    found = max(len(said & claims) / len(claims) for claims in right_claims)
    return out | {
        "said_explained": said_share(report),
        "found": found,
        "asserted": sum(map(asserted, spurious)),
        "parameters": parameter_errors(answer.content["effects"], headline),
        **told_of(report, said, truth, list(verdicts), spurious, found == 1.0),
    }


def held_out_fit(answer: Answer, report: Json) -> dict[str, dict[str, float]]:
    """Rate -> each model's held-out one-step error over the true model's own on the same episodes."""
    held = [int(name) for name in report["fit"]["held_out"] if str(name).isdigit()]
    rows = np.isin(answer.episode, held)
    own = answer.own[rows if rows.any() else slice(None)]
    rates, kinds = SYSTEMS[answer.world.system].rates, ("before", "tuned", "gp", "after", "after_gp")
    out = {}
    for rate, errors in report["fit"]["one_step"].items():
        best = max(float(np.sqrt(np.mean(own[:, rates.index(rate)] ** 2))), 1e-12)
        out[rate] = {kind: float(errors[kind]) / best for kind in kinds if errors.get(kind) is not None}
    return out


def _right(stratum: str, report: Json, truth: Claim, right_claims: set[Claim]) -> bool:
    """`ambiguous` is right only if the truth is in the set and every member is the truth or a listed equivalent."""
    verdict, leader = report["verdict"], claims_of(report["effects"])
    if stratum == "none":
        return bool(verdict == "none")
    if verdict == "named":
        return leader in right_claims
    if verdict == "ambiguous":
        members = {leader, *(claims_of(a["effects"]) for a in report["alternatives"])}
        return truth in members and members <= right_claims
    return verdict == "none" and frozenset() in right_claims


def _verdicts(stratum: str, equal: set[Claim]) -> set[str]:
    """The verdicts that a world calls for; with listed equivalents there is more than one."""
    if stratum == "none":
        return {"none"}
    if stratum == "unknown":
        return {"unknown", "partial"} | ({"named"} if equal else set())
    return {"named"} | ({"ambiguous"} if equal else set()) | ({"none"} if frozenset() in equal else set())


def _outside(report: Json, equivalent: Claim) -> dict[str, Any]:
    """Of a world outside the catalogue: whether it was said so, and whether a wrong name was asserted.

    Said so: `unknown`, `partial`, or every headline effect's law only approximates. A wrong name, whatever the verdict:
    a headline effect that is in no listed equivalent.
    """
    headline = headline_of(report["effects"])
    nearest = bool(headline) and all(e.get("form") == "approximate" for e in headline)
    wrong = any(asserted(e) for e in headline if identity(e) not in equivalent)
    return {"said_so": report["verdict"] in ("unknown", "partial") or nearest, "named_wrong": wrong}


def _location(answer: Answer, report: Json, leader: Claim, right_claims: set[Claim]) -> dict[str, Any]:
    """Whether the rate, the place and the gates are right."""
    world, readings = answer.world, np.concatenate(answer.clean)
    edges = zip(readings.min(axis=0).tolist(), readings.max(axis=0).tolist(), strict=True)
    visited = dict(zip(SYSTEMS[world.system].names, edges, strict=True))
    duration, effects = float(world.clock_offsets[-1] + world.steps * world.dt), answer.content["effects"]
    right = leader in right_claims
    out: dict[str, Any] = {
        "rate_right": _rate_right(answer.content["one_step"], report["location"]["channels"]),
        "place_right": right or {on for _, on in leader} == {on for _, on in answer.claims},
        **gate_figures(effects, report["effects"], visited, duration, stands_in=right),
    }
    out["location_right"] = bool(out["rate_right"] and out["place_right"] and out["gate_right"])
    return out


def _rate_right(one_step: Json, said: Mapping[str, float]) -> bool:
    """Whether the rate with the largest share in the diagnosis is one of the leading ones in truth."""
    shares = {r: max(0.0, 1.0 - (e["own"] / max(e["base"], 1e-300)) ** 2) for r, e in one_step.items()}
    most = max(shares.values())
    if not said or max(said.values()) <= 0 or most < LEAST_SEEN:
        return bool(most < LEAST_SEEN)
    pointed = max(said, key=lambda rate: said[rate])
    return bool(shares.get(pointed, 0.0) >= LEADING_RATE * most)


RULES: Mapping[str, tuple[Callable[..., Any], Callable[..., dict[str, Any]]]] = {
    "machines": (machine_listing, score_machine),
    "whole": (whole_listing, score_whole),
    "afloat": (afloat_rollouts, score_afloat),
    "curves": (lambda *given: None, score_curve),
    "plans": (second_recordings, score_plan),
}
"""Stratum -> what is dear to find out of a trial, and how its diagnosis is judged by that; all others by `score`."""


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
        stratum = answer.content["stratum"]
        found = RULES[stratum][1](answer, None, None) if stratum in RULES else score(answer, None, [])
        found |= {"scored": False, "rivals": [], "sindy": None}
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


def _judged(out: Path, name: str, answer: Answer, outcome: Json, report: Json | None) -> dict[str, Any]:
    """The diagnosis by the rules of its stratum; the rivals that came nearest, and whether PySINDy was right."""
    stratum = answer.content["stratum"]
    if stratum in RULES:
        listing, rules = RULES[stratum]
        first = of_first(report) if report is not None and stratum == "machines" else report
        found = rules(answer, first, listing(out, name, answer, outcome, first))
        return found | {"rivals": [], "sindy": None}
    if "robot" in answer.content:  # of a robot's world those that were said
        known = Listing(robot_rivals(out, name, answer, outcome, report), None)
    else:
        known = cached_listing(out, name, answer, outcome)
    right = {frozenset(answer.claims)} | {frozenset(r.claims) for r in known.rivals if r.equivalent}
    said = known.sindy
    return score(answer, report, known.rivals) | {
        "rivals": [{"claims": list(map(list, r.claims)), "nats_lost": r.loss} for r in known.rivals[:6]],
        "sindy": None if said is None else {"said": list(map(list, said)), "right": frozenset(said) in right},
    }


def _of_world(answer: Answer) -> dict[str, Any]:
    """What the strata need."""
    content, world = answer.content, answer.world
    effects = content["effects"]
    gates = {"region" if e["region"] else "since" for e in effects if e["region"] or e["since"] is not None}
    order = ("subtle", "medium", "plain")
    same = ("system", "engine", "noise_level", "noise_known", "velocities", "excitation")
    return {
        "long": content["long"],
        "transitions": content["transitions"],
        **{name: getattr(world, name) for name in same},
        "strength": min((e["strength"] for e in effects if e["strength"]), key=order.index, default=""),
        "gate": ", ".join(sorted(gates)) or "everywhere",
        "effects": effects,
        "defects": next((content[k]["defects"] for k in ("rough", "machine", "whole") if k in content), []),
    }
