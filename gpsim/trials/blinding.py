"""The blind protocol: write concealed worlds, diagnose their recordings without the answers, reveal the answers.

Whoever conceals publishes the recordings and the answers' hashes; a diagnosis runs in a process and a folder of its own
that hold nothing but one recording; an answer counts only if its hash is the one that was published. One recording lies
in the public folder itself, those of a machine in folders of their own.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.artifacts import git_commit
from gpsim.channels import FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.files import disk_errors, file_digest, read_object, tells_of_full_disk, write_json, written_whole
from gpsim.recordings import write_recording
from gpsim.trials.concealing import SCHEMA, Concealed, conceal
from gpsim.trials.worlds import FROM, SYSTEMS, World, world_from_json

RECORDING_FILE = "recording.yaml"
LIMITS = "limits.json"  # beside a recording: what a plan has to keep to
DIAGNOSES, OUTCOME = "diagnoses", "outcome.json"
PUBLIC, PRIVATE = "public", "private"
ANSWER, TRUTH = "answer.json", "truth.npz"
HASHES = "answers.sha256"
NAME = re.compile(r"\d{4,}")  # of a trial's folder
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


def recording_folders(public: Path) -> list[Path]:
    """The trial's own folder, or those of a machine's recordings in their order."""
    inner = sorted(path.parent for path in public.glob(f"*/{RECORDING_FILE}"))
    return inner or [public]


def trial_name(number: int) -> str:
    """The folder of a trial."""
    return f"{number:04d}"


def write_trial(out: Path, seed: int, number: int) -> str:
    """Write both halves of a trial, each whole or not at all; the answer's SHA-256. What exists is kept."""
    name = trial_name(number)
    private, public = out / PRIVATE / name, out / PUBLIC / name
    there = public.is_dir() and (recording_folders(public)[0] / RECORDING_FILE).is_file()
    if not (private / ANSWER).is_file() or not there:
        concealed = conceal(seed, number)
        with written_whole(private) as answers, written_whole(public) as recordings:
            answers.mkdir(parents=True)
            _write_truth(answers / TRUTH, concealed)
            text = json.dumps(concealed.answer(file_digest(answers / TRUTH)), indent=1) + "\n"
            (answers / ANSWER).write_text(text, encoding="utf-8")
            recordings.mkdir(parents=True)
            _write_recordings(recordings, concealed)
            for half in (private, public):
                shutil.rmtree(half, ignore_errors=True)
    return file_digest(private / ANSWER)


def _write_recordings(public: Path, concealed: Concealed) -> None:
    """One recording in the folder itself, a machine's in folders 1, 2, 3 in it; with what is believed and stated."""
    for i, recording in enumerate(concealed.recordings, 1):
        folder = public if concealed.world.machine is None else public / str(i)
        folder.mkdir(exist_ok=True)
        write_recording(recording, folder, "csv")
        for name, text in concealed.files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        if concealed.limits is not None:
            write_json(folder / LIMITS, concealed.limits)


def _write_truth(path: Path, concealed: Concealed) -> None:
    """Readings without noise and the true model's residual rates, where there are some; equal worlds, equal bytes."""
    clean = np.concatenate([e.states for e in concealed.clean.episodes])
    rows = np.array([len(e.t) for e in concealed.clean.episodes])
    own, episode = np.empty((0, 0)), np.empty(0, dtype=np.int64)
    if concealed.one_step is not None:
        own, episode = concealed.one_step.own, concealed.one_step.episode
    np.savez(path, clean=clean, rows=rows, own=own, episode=episode)


def publish_hashes(out: Path, digests: dict[str, str]) -> None:
    """Write the answers' hashes beside the recordings; those of other trials stay, and none is ever replaced.

    Raises UsageError where another hash was published.
    """
    path = out / PUBLIC / HASHES
    if path.is_file():
        known = published(out)
        strange = [name for name, digest in digests.items() if known.get(name, digest) != digest]
        if strange:
            raise UsageError(
                f"{path}: another answer to trial {strange[0]} was published; choose another --out"
            )
        digests = known | digests
    lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items()))
    with written_whole(path) as made:
        made.write_text(lines, encoding="utf-8")


def published(out: Path) -> dict[str, str]:
    """Trial -> SHA-256 of its answer, as published beside the recordings; raises UsageError."""
    path = out / PUBLIC / HASHES
    if not path.is_file():
        raise UsageError(
            f"{path}: no hashes of the answers, which must exist before the diagnosis: gpsim prove conceal"
        )
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    if any(len(line) != 2 or not NAME.fullmatch(line[1]) for line in lines):
        raise UsageError(f"{path}: expected lines of a SHA-256 and a trial")
    return {name: digest for digest, name in lines}


def recording_digests(folder: Path) -> dict[str, str]:
    """File -> SHA-256, of a recording and of the model beside it."""
    files = (p for p in sorted(folder.rglob("*")) if p.is_file())
    return {p.relative_to(folder).as_posix(): file_digest(p) for p in files}


def diagnose_blind(out: Path, name: str) -> dict[str, Any]:
    """Diagnose one trial; what is finished is kept. The outcome says how it ended and how long it took.

    What stands in it of the answer's hash and of the recording was read before the diagnosis began. A full disk is no
    outcome: it raises UsageError, and the trial is diagnosed when there is space.
    """
    target, public = out / DIAGNOSES / name, out / PUBLIC / name
    if (target / OUTCOME).is_file():
        return read_outcome(out, name)
    digest = published(out).get(name)
    if digest is None:
        raise UsageError(
            f"{out / PUBLIC / HASHES}: no hash of the answer to trial {name}, which must exist before the diagnosis"
        )
    if not public.is_dir():
        raise UsageError(f"{public}: no recording of the published trial; hand over all of public/")
    known: dict[str, Any] = {"answer_sha256": digest, "git_commit": git_commit()}
    with _room() as room:
        shutil.copytree(public, room / RECORDING)
        known["recording"] = recording_digests(room / RECORDING)
        shown = [path.relative_to(room).as_posix() for path in recording_folders(room / RECORDING)]
        words = ["diagnose", *shown, "--out", DIAGNOSIS, "--cores", "1"]  # other trials have the others
        limit = ROBOTS_LIMIT if int(name) > FROM["robots"] else LIMIT
        started = time.monotonic()
        code, said = _ran(room, words, limit)
        if code < 0:  # killed, for want of memory say: that need not happen again
            shutil.rmtree(room / DIAGNOSIS, ignore_errors=True)
            known["killed_first"] = -code
            started = time.monotonic()
            code, said = _ran(room, words, limit)
        if code and tells_of_full_disk(said):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        seconds = round(time.monotonic() - started, 2)
        outcome = {"exit": code, "seconds": seconds, "error": _last_words(code, said)} | known
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


def _ran(room: Path, words: list[str], limit: float) -> tuple[int, str]:
    """Exit code and what was said on stderr; 124 when it took too long."""
    nothing, command = subprocess.DEVNULL, [sys.executable, "-c", COMMAND, *words]
    try:
        done = subprocess.run(
            command, cwd=room, stdin=nothing, stdout=nothing, stderr=subprocess.PIPE, timeout=limit,
            check=False, text=True,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return 124, f"no {words[0]} within {limit:.0f} s"
    return done.returncode, done.stderr


def _planned(room: Path, limit: float) -> dict[str, Any]:
    """Plan the next recording where the first left something open; how that ended."""
    if not read_object(room / DIAGNOSIS / "diagnosis.json")["alternatives"]:
        return {}
    stated = read_object(room / RECORDING / LIMITS)
    box = f"plan.box={json.dumps(stated['box']).replace(chr(34), '')}"
    words = ["plan", DIAGNOSIS, "--minutes", str(stated["minutes"]), box, "--out", PLAN]
    code, said = _ran(room, words, limit)
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


def read_outcome(out: Path, name: str) -> dict[str, Any]:
    """How a finished diagnosis ended; raises UsageError."""
    path = out / DIAGNOSES / name / OUTCOME
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: damaged; delete the folder and diagnose trial {name} again") from error
    return content


@dataclass(frozen=True)
class Answer:
    """A verified answer. clean: readings without noise, one array an episode; own: (N, R), episode: (N,)."""

    content: dict[str, Any]
    clean: list[FloatArray]
    own: FloatArray
    episode: IntArray

    @property
    def world(self) -> World:
        """The world that was concealed."""
        return world_from_json(self.content["world"], self.content["effects"])

    @property
    def actions(self) -> tuple[str, ...]:
        """Names of the world's commands."""
        return tuple(SYSTEMS[self.world.system].action)

    @property
    def claims(self) -> list[tuple[str, str]]:
        """Family and place of every effect of the catalogue."""
        return [(e["family"], e["on"]) for e in self.content["effects"] if not e["outside"]]


def reveal(out: Path, answers: Path, name: str) -> Answer:
    """The answer to a diagnosed trial; raises UsageError when it is not the one whose hash was published.

    Nor is anything revealed when the recording is not the one that was diagnosed.
    """
    outcome, public = read_outcome(out, name), out / PUBLIC / name
    if not public.is_dir() or recording_digests(public) != outcome.get("recording"):
        raise UsageError(f"{public}: missing, or not the diagnosed recording; trial {name} is refused")
    path = answers / name / ANSWER
    if not path.is_file():
        raise UsageError(f"{path}: no such answer; name the folder of the answers with --answers")
    digest, refused = file_digest(path), f"the answer of trial {name} is refused"
    for said, where in (
        (published(out).get(name), "published beside the recordings"),
        (outcome["answer_sha256"], "that stood there when it was diagnosed"),
    ):
        if digest != said:
            raise UsageError(f"{path}: does not match the hash {where}; {refused}")
    content = read_object(path)
    if content.get("schema") != SCHEMA:
        raise UsageError(f"{path}: expected schema {SCHEMA}, got {content.get('schema')!r}")
    truth = answers / name / TRUTH
    if not truth.is_file() or file_digest(truth) != content["truth_sha256"]:
        raise UsageError(f"{truth}: missing, or not what {ANSWER} says; {refused}")
    with np.load(truth) as arrays:
        ends = np.cumsum(arrays["rows"])[:-1]
        return Answer(content, np.split(arrays["clean"], ends), arrays["own"], arrays["episode"])
