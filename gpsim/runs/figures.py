"""The figures of an artifact: what its files say in numbers and single words, flat, for lists and comparisons."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gpsim.errors import UsageError
from gpsim.files import read_json

Figures = dict[str, float | int | str | bool]
UNREADABLE = (UsageError, OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError)
"""What reading a file raises that is absent, or not as it was written."""
TOLD = ("value", "low", "high")


def figures_of(folder: Path) -> Figures:
    """Name to number or word of what a stage wrote into a folder; empty where it wrote none that is known.

    What is not finite or no number, as texts of several words, is left out; so is a file that cannot be read.
    """
    found: Figures = {}
    for name, read in READERS.items():
        try:
            found |= read(folder / name)
        except UNREADABLE:
            continue
    return found


def _json(path: Path) -> Figures:
    return dict(_numbers(read_json(path), ()))


def _diagnosis(path: Path) -> Figures:
    """The verdict, what it explains, every effect's parameters, and the fit."""
    content = read_json(path)
    found: Figures = {"verdict": str(content["verdict"])}
    share = ((content.get("explained") or {}).get("rollout") or {}).get("share")
    if share is not None:
        found["explained"] = float(share)
    ons = [e["on"] if isinstance(e["on"], str) else ", ".join(e["on"]) for e in content["effects"]]
    wheres = [f"{e['family']} on {on}" for e, on in zip(content["effects"], ons, strict=True)]
    found["effects"] = "; ".join(wheres)
    for effect, where in zip(content["effects"], wheres, strict=True):
        for name, parameter in effect["parameters"].items():
            found |= _numbers({k: parameter.get(k) for k in TOLD}, (where, name))
        found |= _numbers({"importance": (effect.get("importance") or {}).get("share")}, (where,))
    for layer in ("one_step", "rollout"):
        errors = content["fit"].get(layer) or {}
        for channel, fit in errors.items():
            if isinstance(fit, Mapping):
                told = {key: fit.get(key) for key in ("before", "after", "after_gp", "noise_floor")}
                found |= _numbers(told, (layer, channel))
    return found


def _last_row(path: Path) -> Figures:
    """The last row of a learning curve."""
    *_, last = csv.DictReader(path.read_text(encoding="utf-8").splitlines())
    return {name: float(last[name]) for name in ("steps", "mean_return")}


def _certified(path: Path) -> Figures:
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    return {"starts": len(rows), "certified": sum(row["certified"] == "1" for row in rows)}


def _numbers(content: Any, above: tuple[str, ...]) -> Figures:
    """Numbers, truths and single words of nested mappings."""
    if isinstance(content, Mapping):
        found: Figures = {}
        for key, value in content.items():
            found |= _numbers(value, (*above, str(key)))
        return found
    plain = isinstance(content, bool | int) or (isinstance(content, float) and math.isfinite(content))
    if plain or (isinstance(content, str) and " " not in content):
        return {".".join(above): content}
    return {}


READERS: Mapping[str, Callable[[Path], Figures]] = {
    "diagnosis.json": _diagnosis,
    "evaluation.json": _json,
    "summary.json": _json,
    "score.json": _json,
    "fit.json": _json,
    "residuals.json": _json,
    "learning_curve.csv": _last_row,
    "certified.csv": _certified,
}
"""The files that are looked at, those whose figures count most first."""
