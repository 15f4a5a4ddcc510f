"""Artifacts: versioned folders with a manifest, written whole or not at all, verified when read."""

from gpsim.artifacts.artifact import (
    MANIFEST,
    TIMINGS,
    Artifact,
    Recipe,
    WarningLog,
    folder_digests,
    read_artifact,
    read_manifest,
    read_timings,
    read_warnings,
)
from gpsim.artifacts.locks import Leftover, erase, held, hide, leftovers, needed, sweep_all, unneeded
from gpsim.artifacts.store import SCHEMA, VERSION, Store, git_commit, listed_once, package_versions
