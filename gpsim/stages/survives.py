"""What a policy was trained to survive: its page beside it, for people and for programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gpsim.corrected import Drawable, FunctionCorrection, PosteriorPlant
from gpsim.files import plain, read_object, write_json

SURVIVES, PAGE = "survives.json", "survives.md"


def write_survives(folder: Path, drawn: PosteriorPlant) -> None:
    """survives.json and survives.md: the explanations that episodes were drawn from, and their sizes' intervals."""
    total = sum(explanation.probability for explanation in drawn.explanations)
    content = {
        "drawn": "every episode",
        "explanations": [_facts(explanation, total) for explanation in drawn.explanations],
    }
    write_json(folder / SURVIVES, plain(content))
    lines = ["# What this policy was trained to survive", "", *survival_lines(folder), ""]
    lines += [
        "Each episode of its training drew one of these explanations, and its sizes with their correlations.",
        "Outside of that nothing was tried: a machine that is none of these is no part of what it survives.",
        "",
    ]
    (folder / PAGE).write_text("\n".join(lines), encoding="utf-8")


def survival_lines(folder: Path) -> list[str]:
    """A line an explanation; none of a policy that was trained in one simulator."""
    if not (folder / SURVIVES).is_file():
        return []
    return [_line(entry) for entry in read_object(folder / SURVIVES)["explanations"]]


def _facts(explanation: Drawable, total: float) -> dict[str, Any]:
    terms = explanation.plant.terms
    return {
        "share_of_episodes": explanation.probability / total,
        "effects": [f"{term.family} on {term.on}" for term in terms],
        "level": explanation.spread.level,
        "sizes": [
            {
                "of": f"{terms[s.term].family} on {terms[s.term].on}",
                "name": s.name,
                "low": s.low,
                "high": s.high,
            }
            for s in explanation.spread.sizes
        ],
        "function_of_the_rest": isinstance(explanation.plant.correction, FunctionCorrection),
    }


def _line(entry: dict[str, Any]) -> str:
    sizes = [f"{s['name']} of {s['of']} {s['low']:.4g} to {s['high']:.4g}" for s in entry["sizes"]]
    said = "; ".join(sizes) or ", ".join(entry["effects"]) or "the base simulator as it is"
    rest = "; a function of the Gaussian process on the rest" if entry["function_of_the_rest"] else ""
    interval = f" ({100 * entry['level']:g} % intervals)" if sizes else ""
    return f"survives, in {100 * entry['share_of_episodes']:.0f} % of its episodes: {said}{rest}{interval}"
