"""What is handed over to be diagnosed: a recording or its path, or several of one machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from gpsim.errors import UsageError
from gpsim.face.recordings import read_recording
from gpsim.face.simulators import folder_of, simulator_of
from gpsim.mjcf import in_its_columns
from gpsim.recordings import Recording, joined
from gpsim.simulators import Simulator
from gpsim.trust import trusting

Recordings = Recording | str | Path | Sequence[Recording | str | Path] | Mapping[str, Recording | str | Path]
"""One recording, or several of one machine."""


def opened(given: Recordings, model: Simulator | None, trust: bool = False) -> tuple[Recording, Simulator]:
    """What is to be diagnosed, several recordings as one, and the simulator.

    trust: whether code that only a recording names may run.
    """
    if isinstance(given, Mapping) and any(isinstance(one, Recording | str | Path) for one in given.values()):
        named = {str(name): one for name, one in given.items()}
    elif isinstance(given, Sequence) and not isinstance(given, str):
        named = dict(zip(_names_of(given), given, strict=True))
    else:
        named = {"": given}  # type: ignore[dict-item]  # `taken_of` says what it is instead
    if not named:
        raise UsageError("diagnose: expected a recording, or several, got none")
    found = []
    for one in named.values():
        taken = taken_of(one, model)
        with trusting(trust):
            own = model or simulator_of(taken, folder_of(one))
        found.append((in_its_columns(taken, own), own))
    if len(found) == 1:
        return found[0]
    return joined([recording for recording, _ in found], list(named)), found[0][1]


def _names_of(given: Sequence[Recording | str | Path]) -> list[str]:
    """What recordings are called: as their folders or files, numbered where these are alike or there are none."""
    names = [Path(one).stem if isinstance(one, str | Path) else "" for one in given]
    told = all(names) and len(set(names)) == len(names)
    return names if told else [str(i + 1) for i in range(len(given))]


def taken_of(recording: Recording | str | Path, simulator: Simulator | None) -> Recording:
    """A recording, or the one that a path names; raises UsageError for anything else."""
    if isinstance(recording, str | Path):
        return read_recording(recording, simulator)
    if not isinstance(recording, Recording):
        raise UsageError(
            f"expected a recording, got {type(recording).__name__}: make one by read_recording or "
            "recording_from_frame"
        )
    return recording
