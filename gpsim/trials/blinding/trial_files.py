"""What lies where: the two halves of a trial, and the answers' hashes, published beside the recordings."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np

from gpsim.errors import UsageError
from gpsim.files import file_digest, written_whole
from gpsim.recordings import write_recording
from gpsim.trials.blinding.concealment import Concealed, answer_of, conceal

PUBLIC, PRIVATE = "public", "private"
ANSWER, TRUTH = "answer.json", "truth.npz"
HASHES = "answers.sha256"
NAME = re.compile(r"\d{4,}")  # of a trial's folder


def trial_name(number: int) -> str:
    """The folder of a trial."""
    return f"{number:04d}"


def write_trial(out: Path, seed: int, number: int) -> str:
    """Write both halves of a trial, each whole or not at all; the answer's SHA-256. What exists is kept."""
    name = trial_name(number)
    private, public = out / PRIVATE / name, out / PUBLIC / name
    if not (private / ANSWER).is_file() or not (public / "recording.yaml").is_file():
        concealed = conceal(seed, number)
        with written_whole(private) as answers, written_whole(public) as recordings:
            answers.mkdir(parents=True)
            _write_truth(answers / TRUTH, concealed)
            text = json.dumps(answer_of(concealed, file_digest(answers / TRUTH)), indent=1) + "\n"
            (answers / ANSWER).write_text(text, encoding="utf-8")
            recordings.mkdir(parents=True)
            write_recording(concealed.recording, recordings, "csv")
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
    """File -> SHA-256, of a recording."""
    return {p.name: file_digest(p) for p in sorted(folder.iterdir())}


def _hashes(path: Path) -> dict[str, str]:
    """Trial -> SHA-256, from a file of hashes; raises UsageError."""
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    if any(len(line) != 2 or not NAME.fullmatch(line[1]) for line in lines):
        raise UsageError(f"{path}: expected lines of a SHA-256 and a trial")
    return {name: digest for digest, name in lines}


def _write_truth(path: Path, concealed: Concealed) -> None:
    """Readings without noise and the true model's residual rates; equal worlds give equal bytes."""
    clean = np.concatenate([e.states for e in concealed.clean.episodes])
    rows = np.array([len(e.t) for e in concealed.clean.episodes])
    np.savez(path, clean=clean, rows=rows, own=concealed.one_step.own, episode=concealed.one_step.episode)
