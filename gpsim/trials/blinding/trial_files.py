"""A trial's files: its public and its private half, and revealing what is private.

One recording lies in the public folder itself, those of a machine in folders of their own. An answer counts only if its
hash is the one that was published before the diagnosis.
"""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.files import file_digest, read_object, write_json, written_whole
from gpsim.recordings import write_recording
from gpsim.trials.blinding.concealment import SCHEMA, Concealed, conceal
from gpsim.trials.blinding.machine_worlds import conceal_machine, conceal_plan
from gpsim.trials.blinding.robot_worlds import conceal_robot
from gpsim.trials.drawing import machine_rank, plan_rank
from gpsim.trials.robots import robot_rank
from gpsim.trials.worlds import SYSTEMS, World, world_from_json

RECORDING_FILE = "recording.yaml"
LIMITS = "limits.json"  # beside a recording: what a plan has to keep to
DIAGNOSES, OUTCOME = "diagnoses", "outcome.json"
PUBLIC, PRIVATE = "public", "private"
ANSWER, TRUTH = "answer.json", "truth.npz"
HASHES = "answers.sha256"
NAME = re.compile(r"\d{4,}")  # of a trial's folder


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
        concealed = _concealed(seed, number)
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


def publish_hashes(out: Path, digests: dict[str, str]) -> None:
    """Write the answers' hashes beside the recordings; those of other trials stay, and none is ever replaced.

    Raises UsageError where another hash was published.
    """
    path = out / PUBLIC / HASHES
    if path.is_file():
        known = _hashes(path)
        for name, digest in digests.items():
            if known.get(name, digest) != digest:
                raise UsageError(
                    f"{path}: another answer to trial {name} was published; choose another --out"
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
            f"{path}: no hashes of the answers; they are published before anybody diagnoses: gpsim prove conceal"
        )
    return _hashes(path)


def recording_digests(folder: Path) -> dict[str, str]:
    """File -> SHA-256, of a recording and of the model beside it."""
    files = (p for p in sorted(folder.rglob("*")) if p.is_file())
    return {p.relative_to(folder).as_posix(): file_digest(p) for p in files}


def _hashes(path: Path) -> dict[str, str]:
    """Trial -> SHA-256, from a file of hashes; raises UsageError."""
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    if any(len(line) != 2 or not NAME.fullmatch(line[1]) for line in lines):
        raise UsageError(f"{path}: expected lines of a SHA-256 and a trial")
    return {name: digest for digest, name in lines}


def _concealed(seed: int, number: int) -> Concealed:
    if plan_rank(number) is not None:
        return conceal_plan(seed, number)
    if machine_rank(number) is not None:
        return conceal_machine(seed, number)
    return conceal(seed, number) if robot_rank(number) is None else conceal_robot(seed, number)


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
        raise UsageError(
            f"{public}: missing, or not the recording that was diagnosed; trial {name} is refused"
        )
    path = answers / name / ANSWER
    if not path.is_file():
        raise UsageError(f"{path}: no such answer; say where the answers are with --answers")
    digest = file_digest(path)
    for said, where in (
        (published(out).get(name), "published beside the recordings"),
        (outcome["answer_sha256"], "that stood there when it was diagnosed"),
    ):
        if digest != said:
            raise UsageError(
                f"{path}: does not match the hash {where}; the answer of trial {name} is refused"
            )
    content = read_object(path)
    if content.get("schema") != SCHEMA:
        raise UsageError(f"{path}: expected schema {SCHEMA}, got {content.get('schema')!r}")
    truth = answers / name / TRUTH
    if not truth.is_file() or file_digest(truth) != content["truth_sha256"]:
        raise UsageError(
            f"{truth}: missing, or not what {ANSWER} says; the answer of trial {name} is refused"
        )
    with np.load(truth) as arrays:
        ends = np.cumsum(arrays["rows"])[:-1]
        return Answer(content, np.split(arrays["clean"], ends), arrays["own"], arrays["episode"])
