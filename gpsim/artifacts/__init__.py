"""Artifacts: versioned folders with a manifest, written whole or not at all, verified when read."""

from gpsim.artifacts.artifact import MANIFEST, Artifact, Recipe, read_artifact, read_manifest
from gpsim.artifacts.provenance import git_commit, package_versions
from gpsim.artifacts.store import Store

__all__ = [
    "MANIFEST",
    "Artifact",
    "Recipe",
    "Store",
    "git_commit",
    "package_versions",
    "read_artifact",
    "read_manifest",
]
