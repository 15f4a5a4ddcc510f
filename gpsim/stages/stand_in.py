"""Whether the target that is driven is another one than was recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gpsim.artifacts import MANIFEST, read_manifest
from gpsim.stages.building import drivable
from gpsim.stages.stage import Request


def measured_on(request: Request) -> str | None:
    """In words what a stand-in's figures are of, where the recording is of something else; else None.

    It is where logs are imported, and where `recording=` names one that was not made by driving this very stand-in.
    """
    given, target = request.config["recording"], request.section("target")["target"]
    imported = request.config["collect"]["source"] is not None
    if not drivable(request.config) or (given is None and not imported):
        return None
    if given is not None and _driven(Path(str(given))) == target:
        return None
    name = target["name"]
    return f"the stand-in {name}, not on what was recorded; choose target=recording to judge by the recording"


def _driven(recording: Path) -> Any:
    """The target that gpsim drove for a recording; None where it did not."""
    if not (recording / MANIFEST).is_file():
        return None
    made = read_manifest(recording)
    return made.manifest["config"].get("target") if made.stage == "collect" else None
