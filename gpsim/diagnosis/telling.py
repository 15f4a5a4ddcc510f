"""The diagnosis in words: four paragraphs that a person would say to a colleague, each with its number."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Report = Mapping[str, Any]


def paragraphs(report: Report) -> list[str]:
    """Where, what, how much, and whether the fit is better."""
    return [_where(report), _what(report), _how_much(report), _better(report)]


def ranking(report: Report) -> list[str]:
    """Every hypothesis that was fitted, the best first."""
    return [
        f"{entry['nats_behind']:10.1f}  {entry['scheme']:<14} {_terms(entry['effects'])}"
        for entry in report["ranking"]
    ]


def _where(report: Report) -> str:
    location = report["location"]
    shares = sorted(location["channels"].items(), key=lambda item: -item[1])
    if report["verdict"] == "none":
        return "Where: nowhere. Simulator and recording differ by no more than noise and numerical error."
    parts = ", ".join(f"{100 * share:.0f} % of {name}'s residual" for name, share in shares if share > 0.01)
    text = f"Where: beyond noise lies {parts or 'a small part of the residual'}"
    if location["depends_on"]:
        text += f"; it depends on {', '.join(location['depends_on'][:3])}"
    for name, (low, high) in location["region"].items():
        text += f"; it acts for {name} in [{low:.3g}, {high:.3g}]"
    if location["since"] is not None:
        text += f"; since t = {location['since']:.3g} s"
    return text + "."


def _what(report: Report) -> str:
    verdict, effects = report["verdict"], report["effects"]
    if verdict == "none":
        return "What: nothing is missing that these data could show (0 effects)."
    said = "; ".join(effect["sentence"] for effect in effects)
    if verdict == "unknown":
        partial = f" A part of it looks like this: {said}." if said else ""
        return f"What: nothing that I know explains it (remainder p = {report['remainder']['p_value']:.2g}).{partial}"
    if verdict == "ambiguous":
        others = " or ".join("; ".join(e["sentence"] for e in a["effects"]) for a in report["alternatives"])
        return f"What: {said} (probability {effects[0]['probability']:.2f}), but it could as well be that {others}."
    return f"What: {said} (evidence {min(e['evidence_gain'] for e in effects):.0f} nats)."


def _how_much(report: Report) -> str:
    numbers = [
        f"{effect['family']} on {effect['on']}: {name} = {p['value']:.4g} [{p['low']:.4g}, {p['high']:.4g}] {p['unit']}"
        for effect in report["effects"]
        for name, p in effect["parameters"].items()
    ]
    if not numbers:
        return "How much: 0; there is no effect to measure."
    text = "How much (90 % intervals): " + "; ".join(numbers) + "."
    return text + (f" To tell the rivals apart, {report['tell_apart']}." if report["tell_apart"] else "")


def _better(report: Report) -> str:
    parts = []
    for name, e in report["fit"]["one_step"].items():
        parts.append(
            f"{name} {e['before']:.3g} before, {e['tuned']:.3g} tuned, {e['gp']:.3g} with a GP, {e['after']:.3g} after "
            f"(noise floor {e['noise_floor']:.3g} {e['unit']})"
        )
    return "Is the fit better, one step ahead on held-out data: " + "; ".join(parts) + "."


def _terms(effects: list[list[str]]) -> str:
    return " + ".join(f"{family} on {on}" for family, on in effects) or "nothing missing"
