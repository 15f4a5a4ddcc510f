"""Diagnosing a trial blind: in a process and a folder of its own that hold nothing but the public half."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from gpsim.artifacts import file_digest
from gpsim.errors import UsageError
from gpsim.provenance import git_commit
from gpsim.trials.concealing import HASHES, PUBLIC

DIAGNOSES, OUTCOME, DIAGNOSIS = "diagnoses", "outcome.json", "diagnosis"
RECORDING = "recording"
LIMIT = 900.0  # s after which a diagnosis is given up
# The command line in a fresh interpreter: what a user would run, and no module of the trials comes along. It ends when
# the proof that started it is gone.
COMMAND = """
import os, threading, time

def watch(parent):
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)

threading.Thread(target=watch, args=(os.getppid(),), daemon=True).start()
from gpsim.cli.main import main
main()
"""


def published(out: Path) -> dict[str, str]:
    """Trial -> SHA-256 of its answer, as published beside the recordings; raises UsageError."""
    path = out / PUBLIC / HASHES
    if not path.is_file():
        raise UsageError(
            f"{path}: no hashes of the answers; they are published before anybody diagnoses: gpsim prove conceal"
        )
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    if any(len(line) != 2 for line in lines):
        raise UsageError(f"{path}: expected lines of a SHA-256 and a trial")
    return {name: digest for digest, name in lines}


def diagnose_blind(out: Path, name: str) -> dict[str, Any]:
    """Diagnose one trial; what is finished is kept. The outcome says how it ended and how long it took."""
    target = out / DIAGNOSES / name
    if (target / OUTCOME).is_file():
        return read_outcome(out, name)
    with tempfile.TemporaryDirectory(prefix="gpsim-blind-") as folder:
        room = Path(folder)
        shutil.copytree(out / PUBLIC / name, room / RECORDING)
        started = time.monotonic()
        code, said = _run(room)
        if code < 0:  # killed, for want of memory say: that need not happen again
            shutil.rmtree(room / DIAGNOSIS, ignore_errors=True)
            started = time.monotonic()
            code, said = _run(room)
        outcome = {
            "exit": code,
            "seconds": round(time.monotonic() - started, 2),
            "error": said.strip().splitlines()[-1][:300] if code and said.strip() else None,
            "recording": {p.name: file_digest(p) for p in sorted((room / RECORDING).iterdir())},
            "answer_sha256": published(out)[name],
            "git_commit": git_commit(),
        }
        made = room / "made"
        made.mkdir()
        if (room / DIAGNOSIS).is_dir():
            (room / DIAGNOSIS).rename(made / DIAGNOSIS)
        (made / OUTCOME).write_text(json.dumps(outcome, indent=1) + "\n", encoding="utf-8")
        temporary = target.with_name(f".{name}.{os.getpid()}")
        shutil.rmtree(temporary, ignore_errors=True)
        shutil.copytree(made, temporary)
        shutil.rmtree(target, ignore_errors=True)
        temporary.rename(target)
    return outcome


def read_outcome(out: Path, name: str) -> dict[str, Any]:
    """How a finished diagnosis ended."""
    content: dict[str, Any] = json.loads((out / DIAGNOSES / name / OUTCOME).read_text(encoding="utf-8"))
    return content


def diagnosis_digest(out: Path, name: str) -> str:
    """The sha256 of how a diagnosis ended and of what it said."""
    paths = (out / DIAGNOSES / name / OUTCOME, out / DIAGNOSES / name / DIAGNOSIS / "diagnosis.json")
    return hashlib.sha256(b"".join(p.read_bytes() for p in paths if p.is_file())).hexdigest()


def read_report(out: Path, name: str) -> dict[str, Any] | None:
    """diagnosis.json of a finished trial; None where the diagnosis failed."""
    path = out / DIAGNOSES / name / DIAGNOSIS / "diagnosis.json"
    if not path.is_file():
        return None
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def _run(room: Path) -> tuple[int, str]:
    """Exit code and what was said on stderr; 124 when it took too long."""
    words = ["diagnose", RECORDING, "--out", DIAGNOSIS, "--cores", "1"]  # other trials have the others
    try:
        done = subprocess.run(
            [sys.executable, "-c", COMMAND, *words],
            cwd=room,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=LIMIT,
            check=False,
            text=True,
        )
    except subprocess.TimeoutExpired:
        return 124, f"no diagnosis within {LIMIT:.0f} s"
    return done.returncode, done.stderr
