"""One finished loop of the smallest budget over two seeds, made once for all tests and all of their processes."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from budgets import TINY

LOOP = [sys.executable, "-m", "gpsim.cli.main", "run", "full-loop", *TINY]


def finished_loop(factory: pytest.TempPathFactory, *without: str) -> tuple[Path, str, str]:
    """(a folder with a copy of its runs/, what it wrote to stdout and to stderr); `without` names stages to leave out."""
    base = factory.getbasetemp()
    shared = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "loop-of-all-tests"
    shared.mkdir(exist_ok=True)
    with (shared / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (shared / "err").exists():
            _make(shared)
    folder = factory.mktemp("loop")
    shutil.copytree(shared / "runs", folder / "runs", ignore=shutil.ignore_patterns(*without))
    return folder, (shared / "out").read_text(), (shared / "err").read_text()


def _make(folder: Path) -> None:
    words = [*LOOP, "--seeds", "2", "--jobs", "1", "--json"]
    ended = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    (folder / "out").write_text(ended.stdout)
    (folder / "err").write_text(ended.stderr)
