"""Which code and which libraries made an artifact."""

from __future__ import annotations

import platform
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGES = (
    "gpsim",
    "gymnasium",
    "numpy",
    "pandas",
    "pyarrow",
    "rosbags",
    "scipy",
    "stable-baselines3",
    "torch",
)


@cache
def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that decide an artifact's bytes."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "absent"
    return versions


@cache
def git_commit() -> str | None:
    """The commit of the checkout that gpsim runs from; None outside a checkout of gpsim itself."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return None
    command = ["git", "-C", str(root), "rev-parse", "HEAD"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip()
