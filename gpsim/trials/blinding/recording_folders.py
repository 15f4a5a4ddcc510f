"""Where a trial's recordings lie in its public folder: one beside nothing else, or several in folders of their own."""

from __future__ import annotations

from pathlib import Path

RECORDING_FILE = "recording.yaml"


def recording_folders(public: Path) -> list[Path]:
    """The trial's own folder, or those of a machine's recordings in their order."""
    inner = sorted(path.parent for path in public.glob(f"*/{RECORDING_FILE}"))
    return inner or [public]
