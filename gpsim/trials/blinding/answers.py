"""Revealing: an answer counts only if its hash is the one that was published before the diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.channels import FloatArray, IntArray
from gpsim.errors import UsageError
from gpsim.files import file_digest, read_object
from gpsim.trials.blinding.blind_diagnosis import read_outcome
from gpsim.trials.blinding.concealment import SCHEMA
from gpsim.trials.blinding.trial_files import ANSWER, PUBLIC, TRUTH, published, recording_digests
from gpsim.trials.worlds import SYSTEMS, World, world_from_json


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
