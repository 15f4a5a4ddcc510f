"""Where a trial's recordings lie in its public folder: one beside nothing else, or several in folders of their own."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.errors import UsageError
from gpsim.files import file_digest, write_json, written_whole
from gpsim.recordings import write_recording
from gpsim.trials.blinding.concealment import Concealed, answer_of, conceal
from gpsim.trials.blinding.machine_worlds import MachineConcealed, conceal_machine, machine_answer
from gpsim.trials.blinding.plan_worlds import LIMITS, PlanConcealed, conceal_plan, plan_answer
from gpsim.trials.blinding.robot_worlds import RobotConcealed, conceal_robot, robot_answer
from gpsim.trials.drawing import machine_rank, plan_rank
from gpsim.trials.robots import Files, robot_rank

RECORDING_FILE = "recording.yaml"


def recording_folders(public: Path) -> list[Path]:
    """The trial's own folder, or those of a machine's recordings in their order."""
    inner = sorted(path.parent for path in public.glob(f"*/{RECORDING_FILE}"))
    return inner or [public]


PUBLIC, PRIVATE = "public", "private"
ANSWER, TRUTH = "answer.json", "truth.npz"
HASHES = "answers.sha256"
NAME = re.compile(r"\d{4,}")  # of a trial's folder
AnyConcealed = Concealed | RobotConcealed | MachineConcealed | PlanConcealed


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
            text = json.dumps(_answer(concealed, file_digest(answers / TRUTH)), indent=1) + "\n"
            (answers / ANSWER).write_text(text, encoding="utf-8")
            recordings.mkdir(parents=True)
            _write_recordings(recordings, concealed)
            if isinstance(concealed, RobotConcealed):
                _write_model(recordings, concealed.files)
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


def _concealed(seed: int, number: int) -> AnyConcealed:
    if plan_rank(number) is not None:
        return conceal_plan(seed, number)
    if machine_rank(number) is not None:
        return conceal_machine(seed, number)
    return conceal(seed, number) if robot_rank(number) is None else conceal_robot(seed, number)


def _write_recordings(folder: Path, concealed: AnyConcealed) -> None:
    """One recording in the folder itself, a machine's in folders 1, 2, 3 in it."""
    if not isinstance(concealed, MachineConcealed):
        write_recording(concealed.recording, folder, "csv")
        if isinstance(concealed, PlanConcealed):
            write_json(folder / LIMITS, concealed.limits)
        return
    for i, recording in enumerate(concealed.recordings, 1):
        (folder / str(i)).mkdir()
        write_recording(recording, folder / str(i), "csv")
        _write_model(folder / str(i), concealed.files)


def _answer(concealed: AnyConcealed, truth_digest: str) -> dict[str, Any]:
    if isinstance(concealed, MachineConcealed):
        return machine_answer(concealed, truth_digest)
    if isinstance(concealed, PlanConcealed):
        return plan_answer(concealed, truth_digest)
    if isinstance(concealed, RobotConcealed):
        return robot_answer(concealed, truth_digest)
    return answer_of(concealed, truth_digest)


def _write_model(folder: Path, files: Files) -> None:
    """The model that is believed, and what it includes."""
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _write_truth(path: Path, concealed: AnyConcealed) -> None:
    """Readings without noise and the true model's residual rates; equal worlds give equal bytes.

    Of a robot there are no residual rates. Of a machine it is the first recording.
    """
    clean = np.concatenate([e.states for e in concealed.clean.episodes])
    rows = np.array([len(e.t) for e in concealed.clean.episodes])
    own, episode = np.empty((0, 0)), np.empty(0, dtype=np.int64)
    if not isinstance(concealed, RobotConcealed) and concealed.one_step is not None:
        own, episode = concealed.one_step.own, concealed.one_step.episode
    np.savez(path, clean=clean, rows=rows, own=own, episode=episode)
