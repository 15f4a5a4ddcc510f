"""How two artifacts differ, or an artifact and what is asked for: key by key, in facts."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from gpsim.artifacts import Artifact, Recipe
from gpsim.files import Json, canonical
from gpsim.runs.catalogue import Catalogue, Entry
from gpsim.runs.figures import figures_of
from gpsim.runs.lineage import parents

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


@dataclass(frozen=True)
class Making:
    """What an artifact is made from, as its manifest has it; parents: role to digest."""

    stage: str
    config: Json
    seeds: Json
    parents: Mapping[str, str]
    format: int
    code: str

    @classmethod
    def of(cls, artifact: Artifact) -> Making:
        """What a finished artifact was made from."""
        manifest = artifact.manifest
        return cls(
            artifact.stage,
            manifest.get("config") or {},
            manifest.get("seeds") or {},
            {role: parent.get("sha256", "") for role, parent in (manifest.get("parents") or {}).items()},
            manifest.get("format", 1),
            manifest.get("code", ""),
        )

    @classmethod
    def asked(cls, recipe: Recipe) -> Making:
        """What an artifact is to be made from."""
        return cls(
            recipe.stage,
            json.loads(canonical(recipe.config)),
            json.loads(canonical(recipe.seeds)),
            {role: parent.digest for role, parent in recipe.parents.items()},
            recipe.format,
            recipe.code,
        )


def differences(old: Making, new: Making) -> tuple[Difference, ...]:
    """Every key in which two recipes differ: none, and their artifacts are the same.

    Parents are given by their digests, "" for one that is not made yet.
    """
    settings = list(_keys("setting", old.config, new.config))
    return (
        *_keys("stage", {"stage": old.stage}, {"stage": new.stage}),
        *(d for kind in ("setting", "file") for d in settings if d.kind == kind),
        *_keys("seed", old.seeds, new.seeds),
        *_keys("parent", old.parents, new.parents),
        *_keys("code", {"format": old.format, "code": old.code}, {"format": new.format, "code": new.code}),
    )


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
            for d in differences(Making.of(one.artifact), Making.of(other.artifact))
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
