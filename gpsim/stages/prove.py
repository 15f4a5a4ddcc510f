"""prove: conceal worlds, diagnose them blind, reveal and score. Every trial that is finished is kept."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import partial
from itertools import count, islice
from pathlib import Path
from typing import Any

from gpsim.errors import UsageError
from gpsim.stages.trial_jobs import Progress, run_trials
from gpsim.trials.concealing import ANSWER, PRIVATE, PUBLIC, publish_hashes, write_trial
from gpsim.trials.drawing import stratum_of

CONFIG = "trials.json"


def numbers_of(trials: int, strata: Sequence[str] = (), long: bool = True) -> list[int]:
    """The first `trials` numbers whose world is of one of `strata` (all when empty)."""

    def wanted(number: int) -> bool:
        stratum, is_long, _ = stratum_of(number)
        return (not strata or stratum in strata) and (long or not is_long)

    return list(islice((n for n in count(1) if wanted(n)), trials))


def conceal(out: Path, seed: int, numbers: Sequence[int], workers: int, progress: Progress) -> Path:
    """Write both halves of every trial below `out`, and the answers' hashes beside the recordings."""
    _remember(out, seed)
    (out / PUBLIC).mkdir(parents=True, exist_ok=True)
    digests = dict(run_trials(partial(_conceal_one, out, seed), numbers, workers, progress))
    publish_hashes(out, {f"{n:04d}": digest for n, digest in digests.items()})
    return out


def read_answers(out: Path) -> list[dict[str, Any]]:
    """Every answer below `out`, in order; unverified."""
    paths = sorted((out / PRIVATE).glob(f"*/{ANSWER}"))
    if not paths:
        raise UsageError(
            f"{out}: no answers below {PRIVATE}/; make some with: gpsim prove conceal --out {out}"
        )
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


def _conceal_one(out: Path, seed: int, number: int) -> str:
    return write_trial(out, seed, number)


def _remember(out: Path, seed: int) -> None:
    """One folder holds trials of one seed."""
    path = out / PRIVATE / CONFIG
    if path.is_file():
        known = json.loads(path.read_text(encoding="utf-8"))["seed"]
        if known != seed:
            raise UsageError(f"{out}: holds trials of seed {known}; choose another --out for seed {seed}")
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"seed": seed}) + "\n", encoding="utf-8")
