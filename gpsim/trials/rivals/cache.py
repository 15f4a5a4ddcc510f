"""What is dear to find out about a trial, kept beside its score: its equivalents, and what PySINDy calls its effects.

It follows from the answer and the recording alone, so OUT/equivalents/NAME.json holds for every diagnosis of the trial
and for every way of scoring it. Another answer, another recording or another version of the rule is listed anew.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gpsim.recordings import read_recording
from gpsim.trials.blinding import PUBLIC, Answer
from gpsim.trials.rivals import sindy
from gpsim.trials.rivals.equivalents import EQUIVALENTS_VERSION, Claims, Rival, rivals, rough_rivals
from gpsim.trials.rivals.kept import EQUIVALENTS, read_kept, write_kept


@dataclass(frozen=True)
class Listing:
    """Every rival that was fitted, the best first, and PySINDy's claims where it applies and is installed."""

    rivals: list[Rival]
    sindy: Claims | None


def cached_listing(out: Path, name: str, answer: Answer, outcome: Mapping[str, Any]) -> Listing:
    """The listing of a revealed trial, from OUT/equivalents or made now and kept there.

    outcome: of its diagnosis, whose digests of answer and recording were verified.
    """
    path = out / EQUIVALENTS / f"{name}.json"
    identity = {
        "version": EQUIVALENTS_VERSION,
        "answer_sha256": outcome["answer_sha256"],
        "recording": outcome["recording"],
    }
    found = read_kept(path)
    kept = found if all(found.get(key) == value for key, value in identity.items()) else identity
    new: dict[str, Any] = {}
    if "rivals" not in kept:
        new |= _rivals(answer, out / PUBLIC / name)
    if kept.get("sindy") is None:  # it may have been installed since
        new["sindy"] = _sindy(answer, out / PUBLIC / name)
    kept = kept | new
    if kept != found:
        write_kept(path, kept)
    said = kept["sindy"]
    return Listing(
        [
            Rival(_claims(r["claims"]), math.inf if r["nats_lost"] is None else r["nats_lost"], r["richer"])
            for r in kept["rivals"]
        ],
        None if said is None else _claims(said),
    )


def _rivals(answer: Answer, public: Path) -> dict[str, Any]:
    started = time.monotonic()
    listed = rough_rivals(answer) if "rough" in answer.content else rivals(answer, read_recording(public))
    found = [
        {
            "claims": list(map(list, r.claims)),
            "nats_lost": r.loss,
            "richer": r.richer,
            "equivalent": r.equivalent,
        }
        for r in listed
    ]
    return {"rivals": found, "seconds": round(time.monotonic() - started, 2)}


def _sindy(answer: Answer, public: Path) -> list[list[str]] | None:
    if not sindy.installed() or not sindy.applies(answer.content):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of thresholds that eliminate all terms, which is an answer
        return [list(claim) for claim in sindy.name(read_recording(public))]


def _claims(pairs: list[list[str]]) -> Claims:
    return tuple((family, on) for family, on in pairs)
