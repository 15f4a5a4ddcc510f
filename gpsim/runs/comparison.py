"""The figures of an artifact, and how two artifacts, or one and what is asked for, differ: key by key, in facts."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from gpsim.artifacts import Artifact, Recipe
from gpsim.errors import UsageError
from gpsim.files import canonical, read_json
from gpsim.runs.catalogue import Catalogue, Entry
from gpsim.runs.lineage import parents

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


Kind = Literal["stage", "setting", "file", "seed", "parent", "code", "package", "figure", "content"]
_SHA256 = re.compile(r"[0-9a-f]{64}")
ABSENT = "absent"
"""Stands for a key that one side does not have: no setting is called so, and null is one."""


@dataclass(frozen=True)
class Difference:
    """One key in which two things differ.

    kind: `setting` and `seed` of the configuration, `file` that was read, `parent`, `code` (state of gpsim's own, or
    its commit), `package`, `figure` of the result, `content` (a file of the artifact). old, new: plain data; of files
    the sha256, of parents where they are, or stage and digest; ABSENT where that side has no such key.
    """

    kind: Kind
    key: str
    old: Any
    new: Any


Making = Mapping[str, Mapping[str, Any]]
"""What an artifact is made from, by the kinds of differences; parents by their digests, "" for one not made yet."""


def made_from(artifact: Artifact) -> Making:
    """What a finished artifact was made from."""
    m = artifact.manifest
    return {
        "stage": {"stage": artifact.stage},
        "setting": m.get("config") or {},
        "seed": m.get("seeds") or {},
        "parent": {role: parent.get("sha256", "") for role, parent in (m.get("parents") or {}).items()},
        "code": {"format": m.get("format", 1), "code": m.get("code", "")},
    }


def asked_of(recipe: Recipe) -> Making:
    """What an artifact is to be made from."""
    return {
        "stage": {"stage": recipe.stage},
        "setting": json.loads(canonical(recipe.config)),
        "seed": json.loads(canonical(recipe.seeds)),
        "parent": {role: parent.digest for role, parent in recipe.parents.items()},
        "code": {"format": recipe.format, "code": recipe.code},
    }


KINDS: tuple[Kind, ...] = ("stage", "setting", "file", "seed", "parent", "code")
"""Of differences in what two artifacts are made from, in their order."""


def differences(old: Making, new: Making) -> tuple[Difference, ...]:
    """Every key in which two recipes differ: none, and their artifacts are the same."""
    found = [d for kind in KINDS if kind in old for d in _keys(kind, old[kind], new[kind])]
    return tuple(sorted(found, key=lambda d: KINDS.index(d.kind)))


def nearest(
    candidates: Iterable[tuple[Artifact, Making]], wanted: Making
) -> tuple[Artifact, tuple[Difference, ...]] | None:
    """Of the artifacts, given with their recipes and the newest first, the one with the fewest differing keys."""
    weighed = [(artifact, differences(making, wanted)) for artifact, making in candidates]
    return min(weighed, key=lambda pair: len(pair[1]), default=None)


def compared(catalogue: Catalogue, one: Entry, other: Entry) -> tuple[Difference, ...]:
    """Every key in which two finished artifacts differ: what they were made from, by what, and what came out."""
    assert one.artifact is not None
    assert other.artifact is not None
    where = [
        {
            need.role: parent.name if parent is not None else f"{need.stage} {str(need.digest)[:12]}"
            for need, parent in parents(catalogue, entry)
        }
        for entry in (one, other)
    ]
    old, new = one.manifest, other.manifest
    files = (dict(sorted(manifest["files"].items())) for manifest in (old, new))
    return (
        *(
            replace(d, old=where[0].get(d.key, ABSENT), new=where[1].get(d.key, ABSENT))
            if d.kind == "parent"
            else d
            for d in differences(made_from(one.artifact), made_from(other.artifact))
        ),
        *_keys("code", {"commit": old.get("git_commit")}, {"commit": new.get("git_commit")}),
        *_keys("package", old.get("packages") or {}, new.get("packages") or {}),
        *_keys("figure", figures_of(one.path), figures_of(other.path)),
        *_keys("content", *files),
    )


def flat(content: Any, above: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
    """Nested mappings as one, from the ways to the values; lists are values."""
    if isinstance(content, Mapping) and content:
        return {
            way: v for key, value in content.items() for way, v in flat(value, (*above, str(key))).items()
        }
    return {above: content}


def _keys(kind: Kind, old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Difference]:
    """Differing keys of nested mappings, in their order; a setting that is a sha256 is that of a file."""
    before, after = flat(old) if old else {}, flat(new) if new else {}
    for way in dict.fromkeys([*before, *after]):
        values = before.get(way, ABSENT), after.get(way, ABSENT)
        if canonical(values[0]) != canonical(values[1]):
            a_file = kind == "setting" and any(isinstance(v, str) and _SHA256.fullmatch(v) for v in values)
            yield Difference("file" if a_file else kind, ".".join(way), *values)
