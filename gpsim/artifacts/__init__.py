"""Artifacts: versioned folders with a manifest, written whole or not at all, verified when read."""

from gpsim.artifacts.artifact import (
    MANIFEST,
    TIMINGS,
    Artifact,
    Recipe,
    read_artifact,
    read_manifest,
    read_timings,
)
from gpsim.artifacts.keys import VERSION, listed_once
from gpsim.artifacts.leftovers import Leftover, erase, leftovers, sweep_all
from gpsim.artifacts.locks import held
from gpsim.artifacts.mishaps import Mishaps, read_warnings
from gpsim.artifacts.provenance import git_commit, package_versions
from gpsim.artifacts.removal import hide, unneeded
from gpsim.artifacts.store import SCHEMA, Store

__all__ = [
    "MANIFEST",
    "SCHEMA",
    "TIMINGS",
    "VERSION",
    "Artifact",
    "Leftover",
    "Mishaps",
    "Recipe",
    "Store",
    "erase",
    "git_commit",
    "held",
    "hide",
    "leftovers",
    "listed_once",
    "package_versions",
    "read_artifact",
    "read_manifest",
    "read_timings",
    "read_warnings",
    "sweep_all",
    "unneeded",
]
