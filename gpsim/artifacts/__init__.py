"""Artifacts: versioned folders with a manifest, written whole or not at all, verified when read."""

from gpsim.artifacts.artifact import MANIFEST, TIMINGS, Artifact, Recipe, read_artifact, read_manifest
from gpsim.artifacts.locks import held
from gpsim.artifacts.mishaps import Mishaps, read_warnings
from gpsim.artifacts.provenance import git_commit, package_versions
from gpsim.artifacts.store import Store

__all__ = [
    "MANIFEST",
    "TIMINGS",
    "Artifact",
    "Mishaps",
    "Recipe",
    "Store",
    "git_commit",
    "held",
    "package_versions",
    "read_artifact",
    "read_manifest",
    "read_warnings",
]
