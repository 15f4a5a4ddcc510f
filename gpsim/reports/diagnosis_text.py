"""The diagnosis in words: four paragraphs that a person would say to a colleague, each with its number."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gpsim.diagnosis.assessment import KINDS, SINCE_REVERSAL
from gpsim.diagnosis.settings import LackOfFitSettings

Report = Mapping[str, Any]
NOTHING = "nothing missing"
RANKINGS = {"all": "On all training windows:", "search": "Given up in the search, on its windows:"}
MANY = 1e6  # odds beyond which nobody counts
COARSE = 0.7  # of the base simulator's error, that finer steps leave: what they take away is worth a word
GLITCHES = 3.0  # times the typical error: a larger root mean square is made by a few samples


def paragraphs(report: Report) -> list[str]:
    """Where, what, how much, and whether the fit is better."""
    return [_where(report), _what(report), _how_much(report), _better(report)]


def ranking(report: Report) -> list[str]:
    """Every hypothesis that was fitted, the best first; those of the search alone, which had fewer data, at the end."""
    lines = []
    for windows, title in RANKINGS.items():
        group = [entry for entry in report["ranking"] if entry.get("windows", "search") == windows]
        if group:
            lines += [title, *(_ranked(entry) for entry in group)]
    return lines


def _where(report: Report) -> str:
    location = report["location"]
    shares = sorted(location["channels"].items(), key=lambda item: -item[1])
    if report["verdict"] == "none":
        return (
            "Where: nowhere. Simulator and recording differ by no more than noise and numerical error."
            + _own_step(report)
            + _looked_at(report)
        )
    parts = ", ".join(f"{100 * share:.0f} % of {name}'s residual" for name, share in shares if share > 0.01)
    text = f"Where: beyond noise lies {parts or _no_part(report)}"
    if location["depends_on"]:
        text += f"; it depends on {', '.join(location['depends_on'][:3])}"
    for name, (low, high) in location["region"].items():
        text += f"; it acts for {name} in {_between(low, high)}"
    if location["since"] is not None:
        text += f"; since t = {_moment(location['since'], report.get('dt'))} s"
    if location.get("since_episode") is not None:
        text += f"; since episode {location['since_episode']}"
    return f"{text}{_part(report)}.{_looked_at(report)}"


def _own_step(report: Report) -> str:
    """What of the residual the base simulator's own step makes, where that is much."""
    errors = [(name, e) for name, e in report["fit"]["one_step"].items() if e.get("finely") is not None]
    coarse = [(n, e) for n, e in errors if e["before"] is not None and e["finely"] < COARSE * e["before"]]
    if not coarse:
        return ""
    left = ", ".join(
        f"{number(e['finely'])} of {name}'s {number(e['before'])} {e['unit']}" for name, e in coarse
    )
    return f" The simulator's own step is coarse: integrated finely, {left} is left one step ahead."


def _part(report: Report) -> str:
    """In which part of state, action or time nearly all of it lies; what a named region says already is left out."""
    part = report["location"].get("concentrated")
    location = report["location"]
    named = location["region"] or location["since"] is not None or location.get("since_episode") is not None
    if part is None or named:
        return ""
    (low, high), name = part["interval"], part["channel"]
    of = name.removeprefix(SINCE_REVERSAL)
    where = f"{part['where']} {name} = {_between(low, high)}" if of == name else _soon_after(of, high)
    return (
        f"; {100 * part['share_of_mismatch']:.0f} % of {part['rate']}'s lies {where}, "
        f"in {100 * part['share_of_samples']:.0f} % of the samples"
    )


def _soon_after(of: str, seconds: float) -> str:
    return f"within {seconds:.3g} s of a reversal of {of}" if seconds > 0.0 else f"where {of} turns round"


def _between(low: float, high: float) -> str:
    """An interval: three digits of its ends, more where they share the first ones."""
    size, width = max(abs(low), abs(high)), abs(high - low)
    shared = math.floor(math.log10(size / width)) if 0 < width < math.inf else 0
    digits = 3 + max(shared, 0)
    return f"[{low:.{digits}g}, {high:.{digits}g}]"


def _moment(t: float, dt: float | None) -> str:
    """A moment [s] to a step of its clock, dt [s]; three digits where nobody knows that step."""
    if dt is None:
        return f"{t:.3g}"
    return f"{t:.{max(0, math.ceil(-math.log10(dt)))}f}"


def _looked_at(report: Report) -> str:
    """What a reader must know of the data that were looked at."""
    text = ""
    if report["thinned"] > 1:
        text += f" The clock is fast: every {_ordinal(report['thinned'])} sample was read, commands averaged between."
    if report["not_measured"]:
        names = ", ".join(report["not_measured"])
        text += f" Nobody measured {names}: it is what each model's own windows say."
    return text


def _what(report: Report) -> str:
    verdict, effects = report["verdict"], report["effects"]
    if verdict == "none":
        return "What: nothing is missing that these data could show (0 effects)."
    said = "; ".join(effect["sentence"] for effect in effects)
    if verdict == "unknown":
        partial = f" A part of it looks like this: {said}." if said else ""
        p_value = number(report["remainder"]["p_value"], 2)
        law = _missing_law(report["remainder"].get("lack_of_fit"))
        return f"What: nothing that I know explains it (remainder p = {p_value}).{law}{partial}"
    if verdict == "ambiguous":
        others = " or ".join("; ".join(e["sentence"] for e in a["effects"]) for a in report["alternatives"])
        return f"What: {said} (probability {effects[0]['probability']:.2f}), but it could as well be that {others}."
    weakest = min(effects, key=lambda e: e["evidence_gain"])
    return f"What: {said} (evidence {weakest['evidence_gain']:.0f} nats{_odds(effects)})."


def _odds(effects: list[Report]) -> str:
    """How many times less probable the best is that does without one of the effects."""
    known = [e["odds"] for e in effects if e.get("odds", {}).get("nats") is not None]
    if not known:
        return ""
    least = min(known, key=lambda odds: odds["nats"])
    many = least["nats"] > math.log(MANY)
    times = "more than a million" if many else f"{float(number(math.exp(least['nats']), 2)):,.0f}"
    return f"; odds of {times} to 1 against the next best, {_terms(least['against'])}"


def _missing_law(lack: Mapping[str, Any] | None) -> str:
    """What the missing law is about, as far as that can be told without knowing it."""
    if lack is None or lack["p_value"] >= LackOfFitSettings().significance:
        return ""
    on = " and ".join(lack["on"])
    if lack.get("memory"):
        on += f" and on what it was over the last {lack['memory']:.2g} s"
    return f" In {lack['rate']} something is missing that depends on {on} ({lack['nats']:.0f} nats)."


def _how_much(report: Report) -> str:
    numbers = [
        f"{effect['family']} on {effect['on']}: {name} = {p['value']:.4g} {_interval(p)}{_unit(p)}"
        f"{' (AT ITS BOUND: do not trust it)' if p['at_bound'] else ''}"
        for effect in report["effects"]
        for name, p in effect["parameters"].items()
    ]
    if not numbers:
        return "How much: 0; there is no effect to measure."
    text = "How much (90 % intervals): " + "; ".join(numbers) + "."
    return text + (f" To tell the rivals apart, {report['tell_apart']}." if report["tell_apart"] else "")


def _interval(parameter: Mapping[str, Any]) -> str:
    """Where the curvature gave none, the contract's limits are null."""
    low, high = parameter["low"], parameter["high"]
    return (
        "(no interval: the data do not determine it)" if None in (low, high) else f"[{low:.4g}, {high:.4g}]"
    )


def _unit(parameter: Mapping[str, Any]) -> str:
    """Nothing behind a plain ratio."""
    return "" if parameter["unit"] == "1" else f" {parameter['unit']}"


def _better(report: Report) -> str:
    modelled = bool(report["effects"]) and report["remainder"]["gp"]["beside"] == "effects"
    steps = [f"{name} {_step_errors(e, modelled)}" for name, e in report["fit"]["one_step"].items()]
    rollout = report["fit"]["rollout"]
    runs = [f"{name} {_run_errors(e)}" for name, e in rollout.items() if name != "horizon_s"]
    said = "; ".join(steps) or "no rate follows from what was recorded"
    text = f"Is the fit better, one step ahead on held-out data: {said}.{_of_gp(report)}"
    return text + (f" After {rollout['horizon_s']:.3g} s: {'; '.join(runs)}." if runs else "")


def _of_gp(report: Report) -> str:
    """Why no Gaussian process models what is left, or why one stands in the effects' place."""
    gp = report["remainder"]["gp"]
    if report["verdict"] != "none" and not gp["used"]:
        return f" No GP on what is left: {gp['why_not']}."
    partial = report["effects"] and gp["beside"] == "base"
    return (
        " The GP goes with the base alone: what the partial account leaves it learns less well."
        if partial
        else ""
    )


def _step_errors(errors: Mapping[str, Any], modelled: bool) -> str:
    """RMS errors; where rare glitches make most of them, what is typical too. modelled: by a GP beside the effects."""
    n = {kind: number(errors[kind]) for kind in KINDS}
    text = (
        f"{n['before']} before, {n['tuned']} tuned, {n['gp']} with a GP, {n['after']} after{_of_before(errors)}"
        f"{', ' + n['after_gp'] + ' after with a GP' if modelled else ''} "
        f"(noise floor {n['noise_floor']} {errors['unit']}"
    )
    usual = errors["typical"]
    if None not in (errors["after"], usual["after"]) and errors["after"] > GLITCHES * usual["after"]:
        often = {kind: number(value) for kind, value in usual.items()}
        text += f"; rare glitches dominate, typically {often['before']} before and {often['after']} after"
    return text + ")"


def _run_errors(errors: Mapping[str, Any]) -> str:
    before, gp, after = (number(errors[kind]) for kind in ("before", "gp", "after"))
    return f"{before} before, {gp} with a GP, {after} after {errors['unit']}{_of_before(errors)}"


def _of_before(errors: Mapping[str, Any]) -> str:
    """What is left of the base's error, with its 90 % interval, where anything was named."""
    left = errors.get("after_over_before", {"low": None})
    if left["low"] is None or left["value"] in (None, 1.0):
        return ""
    share, low, high = (in_percent(left[key]) for key in ("value", "low", "high"))
    return f" ({share} % of it, {low} to {high})"


def in_percent(share: float) -> str:
    """A share in per cent, two digits at least and no exponent."""
    return f"{100 * share:.0f}" if share >= 0.0995 else f"{100 * share:.2g}"


def number(value: float | None, digits: int = 3) -> str:
    """So many digits; a simulation that ran away has no error or p that JSON could hold."""
    return "diverged" if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


def _ordinal(number: int) -> str:
    return f"{number}{ {2: 'nd', 3: 'rd'}.get(number, 'th') }"


def _no_part(report: Report) -> str:
    return "a small part of the residual" if report["fit"]["one_step"] else "a rate that nobody measured"


def _ranked(entry: Report) -> str:
    gates = entry.get("gates", [""] * len(entry["effects"]))
    terms = [
        f"{family} on {on}" + (f" (for some {gate})" if gate else "")
        for (family, on), gate in zip(entry["effects"], gates, strict=True)
    ]
    return f"{entry['nats_behind']:10.1f}  {entry['scheme']:<14} {' + '.join(terms) or NOTHING}"


def _terms(effects: list[list[str]]) -> str:
    return " + ".join(f"{family} on {on}" for family, on in effects) or NOTHING
