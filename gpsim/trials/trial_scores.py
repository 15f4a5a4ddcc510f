"""Judging one trial: reveal its answer, list its equivalents, score the diagnosis and the rivals beside it."""

from __future__ import annotations

import json
import os
import time
import warnings
from pathlib import Path
from typing import Any

from gpsim.recordings import Recording, read_recording
from gpsim.trials import sindy
from gpsim.trials.blind import diagnosis_digest, read_outcome, read_report
from gpsim.trials.concealing import PUBLIC
from gpsim.trials.equivalents import Rival, rivals
from gpsim.trials.revealing import Answer, reveal
from gpsim.trials.scoring import score

SCORES = "scores"


def judge(out: Path, answers: Path, name: str) -> dict[str, Any]:
    """The score of a diagnosed trial, kept in OUT/scores; the answer is verified each time.

    A trial that was diagnosed anew is scored anew.
    """
    answer = reveal(out, answers, name)
    path = out / SCORES / f"{name}.json"
    digest = diagnosis_digest(out, name)
    if path.is_file():
        kept: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if kept.get("diagnosis_sha256") == digest:
            return kept
    started = time.monotonic()
    recording = read_recording(out / PUBLIC / name)
    others = rivals(answer, recording)
    outcome = read_outcome(out, name)
    found = score(answer, read_report(out, name), others)
    found |= _of_world(answer) | {
        "trial": name,
        "diagnosis_sha256": digest,
        "seconds": outcome["seconds"],
        "error": outcome["error"],
        "rivals": [{"claims": list(map(list, r.claims)), "nats_lost": r.loss} for r in others[:6]],
        "sindy": _sindy(answer, recording, others),
    }
    found["scoring_seconds"] = round(time.monotonic() - started, 2)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    temporary.replace(path)
    return found


def _of_world(answer: Answer) -> dict[str, Any]:
    """What the strata need."""
    content, world = answer.content, answer.world
    effects = content["effects"]
    gates = {"region" if e["region"] else "since" for e in effects if e["region"] or e["since"] is not None}
    order = ("subtle", "medium", "plain")
    return {
        "long": content["long"],
        "transitions": content["transitions"],
        "system": world.system,
        "engine": world.engine,
        "noise_level": world.noise_level,
        "noise_known": world.noise_known,
        "velocities": world.velocities,
        "excitation": world.excitation,
        "strength": min((e["strength"] for e in effects), key=order.index, default=""),
        "gate": ", ".join(sorted(gates)) or "everywhere",
        "effects": effects,
    }


def _sindy(answer: Answer, recording: Recording, others: list[Rival]) -> dict[str, Any] | None:
    if not sindy.installed() or not sindy.applies(answer.content):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of thresholds that eliminate all terms, which is an answer
        said = sindy.name(recording)
    right = {frozenset(answer.claims)} | {frozenset(r.claims) for r in others if r.equivalent}
    return {"said": list(map(list, said)), "right": frozenset(said) in right}
