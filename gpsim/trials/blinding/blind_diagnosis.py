"""Diagnosing a trial blind: in a process and a folder of its own that hold nothing but the public half."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gpsim.artifacts import git_commit
from gpsim.errors import UsageError
from gpsim.files import disk_errors, read_object, tells_of_full_disk, written_whole
from gpsim.trials.blinding.trial_files import (
    DIAGNOSES,
    HASHES,
    LIMITS,
    OUTCOME,
    PUBLIC,
    published,
    read_outcome,
    recording_digests,
    recording_folders,
)
from gpsim.trials.robots import robot_rank

RECORDING, DIAGNOSIS, PLAN = "recording", "diagnosis", "plan"
LIMIT = 900.0  # s after which a diagnosis is given up
ROBOTS_LIMIT = 3600.0  # s, of a robot, which simulates for longer
# The command line in a fresh interpreter: what a user would run, and no module of the trials comes along. It ends when
# the proof that started it is gone.
COMMAND = """
import os
from gpsim.workers import leave_with
leave_with(os.getppid())
from gpsim.cli.main import main
main()
"""


def diagnose_blind(out: Path, name: str) -> dict[str, Any]:
    """Diagnose one trial; what is finished is kept. The outcome says how it ended and how long it took.

    What stands in it of the answer's hash and of the recording was read before the diagnosis began. A full disk is no
    outcome: it raises UsageError, and the trial is diagnosed when there is space.
    """
    target = out / DIAGNOSES / name
    if (target / OUTCOME).is_file():
        return read_outcome(out, name)
    known = _before(out, name)
    with _room() as room:
        shutil.copytree(out / PUBLIC / name, room / RECORDING)
        known["recording"] = recording_digests(room / RECORDING)
        started = time.monotonic()
        limit = LIMIT if robot_rank(int(name)) is None else ROBOTS_LIMIT
        code, said = _run(room, limit)
        if code < 0:  # killed, for want of memory say: that need not happen again
            shutil.rmtree(room / DIAGNOSIS, ignore_errors=True)
            known["killed_first"] = -code
            started = time.monotonic()
            code, said = _run(room, limit)
        if code and tells_of_full_disk(said):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        outcome = {
            "exit": code,
            "seconds": round(time.monotonic() - started, 2),
            "error": _last_words(code, said),
        } | known
        if not code and (room / RECORDING / LIMITS).is_file():
            outcome |= _planned(room, limit)
        with disk_errors(out, "--out"):
            _keep(outcome, room, target)
    return outcome


@contextmanager
def _room() -> Iterator[Path]:
    """A folder to diagnose in, gone after the block; raises UsageError where there is no room for it."""
    try:
        shelf = Path(tempfile.gettempdir())
    except FileNotFoundError as error:  # what it says where every disk is full
        raise UsageError(f"{error.strerror}: free space there, or name a folder with TMPDIR") from error
    with disk_errors(shelf, "TMPDIR"), tempfile.TemporaryDirectory(prefix="gpsim-blind-") as folder:
        yield Path(folder)


def _planned(room: Path, limit: float) -> dict[str, Any]:
    """Plan the next recording where the first left something open; how that ended."""
    if not read_object(room / DIAGNOSIS / "diagnosis.json")["alternatives"]:
        return {}
    stated = read_object(room / RECORDING / LIMITS)
    box = f"plan.box={json.dumps(stated['box']).replace(chr(34), '')}"
    code, said = _ran(
        room, ["plan", DIAGNOSIS, "--minutes", str(stated["minutes"]), box, "--out", PLAN], limit
    )
    return {"plan_exit": code, "plan_error": _last_words(code, said)}


def _keep(outcome: dict[str, Any], room: Path, target: Path) -> None:
    """Write how it ended, and what was made in the room, to the folder `target`, whole or not at all."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(target) as made:
        made.mkdir()
        for kind in (DIAGNOSIS, PLAN):
            if (room / kind).is_dir():
                shutil.copytree(room / kind, made / kind)
        (made / OUTCOME).write_text(json.dumps(outcome, indent=1) + "\n", encoding="utf-8")
        shutil.rmtree(target, ignore_errors=True)


def _last_words(code: int, said: str) -> str | None:
    """In one line why a diagnosis failed; None where it did not."""
    if code < 0:
        return f"killed by signal {-code}"
    return said.strip().splitlines()[-1][:300] if code and said.strip() else None


def _before(out: Path, name: str) -> dict[str, Any]:
    """What is on record before a diagnosis begins; raises UsageError."""
    digest = published(out).get(name)
    if digest is None:
        raise UsageError(
            f"{out / PUBLIC / HASHES}: no hash of the answer to trial {name}; it is published before anybody diagnoses"
        )
    if not (out / PUBLIC / name).is_dir():
        raise UsageError(
            f"{out / PUBLIC / name}: no recording of the published trial; hand over public/ whole"
        )
    return {"answer_sha256": digest, "git_commit": git_commit()}


def diagnosis_digest(out: Path, name: str) -> str:
    """The sha256 of how a diagnosis ended and of what it said."""
    paths = (out / DIAGNOSES / name / OUTCOME, out / DIAGNOSES / name / DIAGNOSIS / "diagnosis.json")
    return hashlib.sha256(b"".join(p.read_bytes() for p in paths if p.is_file())).hexdigest()


def read_report(out: Path, name: str) -> dict[str, Any] | None:
    """diagnosis.json of a finished trial; None where the diagnosis failed, however far it had come."""
    path = out / DIAGNOSES / name / DIAGNOSIS / "diagnosis.json"
    if read_outcome(out, name)["exit"] != 0 or not path.is_file():
        return None
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def _run(room: Path, limit: float) -> tuple[int, str]:
    """The diagnosis."""
    shown = [path.relative_to(room).as_posix() for path in recording_folders(room / RECORDING)]
    words = ["diagnose", *shown, "--out", DIAGNOSIS, "--cores", "1"]  # other trials have the others
    return _ran(room, words, limit)


def _ran(room: Path, words: list[str], limit: float) -> tuple[int, str]:
    """Exit code and what was said on stderr; 124 when it took too long."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", COMMAND, *words],
            cwd=room,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=limit,
            check=False,
            text=True,
        )
    except subprocess.TimeoutExpired:
        return 124, f"no {words[0]} within {limit:.0f} s"
    return done.returncode, done.stderr
