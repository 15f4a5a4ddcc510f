"""Every Python 3.11 or newer that can be started from here, one a minor version."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

OLDEST = 11


def other_pythons(own: int) -> dict[str, Path]:
    """`python3.12` -> an interpreter that starts, without that of the minor version `own`."""
    found: dict[int, Path] = {}
    for minor, path in _candidates():
        if minor >= OLDEST and minor != own and minor not in found and _starts(path, minor):
            found[minor] = path
    return {f"python3.{minor}": found[minor] for minor in sorted(found)}


def _candidates() -> Iterator[tuple[int, Path]]:
    """What is called so on PATH, and, behind a pyenv's shim, which may not start, the versions that it stands for."""
    for folder in map(Path, os.get_exec_path()):
        for path in sorted(folder.glob("python3.*")) if folder.is_dir() else ():
            if name := re.fullmatch(r"python3\.(\d+)", path.name):
                yield int(name[1]), path
                for version in sorted((folder.parent / "versions").glob(f"3.{name[1]}.*/bin/{path.name}")):
                    yield int(name[1]), version


def _starts(path: Path, minor: int) -> bool:
    asked = "import sys, venv; print(sys.version_info[1])"
    try:
        done = subprocess.run([path, "-c", asked], capture_output=True, text=True, check=False, timeout=60)
    except OSError:
        return False
    return done.returncode == 0 and done.stdout.strip() == str(minor)
