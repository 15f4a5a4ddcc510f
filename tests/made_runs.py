"""Small artifacts that rest on one another, and what a disk really holds of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from gpsim.artifacts import MANIFEST, Artifact, Recipe, Store, read_artifact
from gpsim.errors import UsageError
from gpsim.files import file_digest


def made(
    root: Path,
    stage: str,
    config: object = 0,
    parents: Mapping[str, Artifact] | None = None,
    *,
    experiment: str = "cartpole",
    out: Path | None = None,
    code: str = "",
    content: str = "same",
) -> Artifact:
    """Publish an artifact of one small file; another `code` alone makes a twin."""

    def write(folder: Path) -> None:
        (folder / "content.txt").write_text(content)

    recipe = Recipe(stage, {"n": config}, parents or {}, {"seed": 0}, code=code)
    return Store(root, experiment).publish(recipe, write, out=out)


def recorded(root: Path, content: str = "episode,t,x\n") -> Artifact:
    """An artifact that holds a recording's table."""

    def write(folder: Path) -> None:
        (folder / "recording.csv").write_text(content)

    return Store(root, "cartpole").publish(Recipe("collect", {"of": content}, {}, {"seed": 0}), write)


def diagnosed(root: Path, recording: Artifact, n: int = 0) -> Artifact:
    """An artifact that names its recording by its files alone, as a diagnosis does."""
    files = {"recording.csv": file_digest(recording.path / "recording.csv")}
    recipe = Recipe("diagnose", {"recording": files, "n": n}, {}, {"seed": 0})
    return Store(root, "cartpole").publish(recipe, lambda folder: (folder / "a").touch())


def whole_artifacts(*places: Path) -> dict[Path, Artifact]:
    """Every artifact of which every byte is right, by looking at the disk alone."""
    found = {}
    for place in places:
        for manifest in place.rglob(MANIFEST):
            if not any(part.startswith(".") for part in manifest.relative_to(place).parts):
                found[manifest.parent] = read_artifact(manifest.parent)
    return found


def orphans(*places: Path) -> list[Path]:
    """Artifacts of which a parent, or the recording that they were made from, is nowhere."""
    there = whole_artifacts(*places)
    digests = {artifact.digest for artifact in there.values()}
    files = {sha for artifact in there.values() for sha in artifact.manifest["files"].values()}
    return [
        path
        for path, artifact in there.items()
        if not {parent["sha256"] for parent in artifact.manifest["parents"].values()} <= digests
        or not set(artifact.manifest["config"].get("recording", {}).values()) <= files
    ]


def snapshot(place: Path) -> dict[str, tuple[bytes | None, int]]:
    """Every file and folder below a place: bytes and the moment of the last change."""
    return {
        path.relative_to(place).as_posix(): (
            path.read_bytes() if path.is_file() else None,
            path.stat().st_mtime_ns,
        )
        for path in sorted(place.rglob("*"))
    }


def spoil(artifact: Artifact) -> None:
    """Damage its manifest."""
    manifest = artifact.path / MANIFEST
    content = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(content | {"stage": "other"}))
    try:
        read_artifact(artifact.path)
    except UsageError:
        return
    raise AssertionError("nothing was spoilt")
