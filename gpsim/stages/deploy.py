"""deploy --replay: recorded drives of a policy under the monitor, as it would have watched them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gpsim.errors import UsageError
from gpsim.files import Json
from gpsim.recordings import Recording, read_recording
from gpsim.stages import safety
from gpsim.stages.evaluate_deployed import trips
from gpsim.stages.import_log import changes_of, read_logs, salvages
from gpsim.stages.stage import Request


def replay(request: Request, logs: Sequence[Path]) -> Json:
    """Of every drive in the logs when and why it would have been stopped, and what false stops were stated.

    logs: raw ones, read by collect.mapping, or the folder of a recording.
    """
    safety.check(request)
    recording, whole = _read(request, logs)
    drives = safety.watched(request, recording, trips(recording, whole))
    settings = safety.settings_of(request)
    return {"drives": drives, "stated_false_stops": settings.false_stops, "minutes": settings.minutes}


def _read(request: Request, logs: Sequence[Path]) -> tuple[Recording, bool]:
    """The recording, and whether each of its logs is one drive."""
    for log in logs:
        if not log.exists():
            raise UsageError(f"{log}: no such log; give a bag, a table, or the folder of a recording")
    if len(logs) == 1 and (logs[0] / "recording.yaml").is_file():
        return read_recording(logs[0]), False
    section = request.config["collect"]
    given = section["mapping"]
    mapping = None if given is None else str(given)
    recording, _, raw = read_logs(list(logs), mapping, changes_of(section), salvages(section))
    return recording, (raw.get("episodes") or {}).get("by", "file") == "file"


def replay_lines(found: Json) -> list[str]:
    """A line a drive, and how often nothing would have been stopped."""
    lines = [_line(drive) for drive in found["drives"]]
    stopped = sum(drive["stopped_at"] is not None for drive in found["drives"])
    lines.append(
        f"{stopped} of {len(found['drives'])} drives would have been stopped; stated: a false stop in "
        f"{found['minutes']:g} minutes with a probability of {found['stated_false_stops']:g} at most"
    )
    return lines


def _line(drive: dict[str, Any]) -> str:
    if drive["stopped_at"] is None:
        return f"{drive['drive']}: {drive['seconds']:.1f} s, not stopped"
    return f"{drive['drive']}: stopped after {drive['stopped_at']:.2f} of {drive['seconds']:.1f} s ({drive['why']})"
