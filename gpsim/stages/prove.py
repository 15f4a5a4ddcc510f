"""prove: conceal worlds, diagnose them blind, reveal and score. Every trial that is finished is kept."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from functools import partial
from itertools import count, islice
from pathlib import Path
from typing import Any

from gpsim.artifacts import write_json
from gpsim.errors import UsageError
from gpsim.provenance import git_commit, package_versions
from gpsim.reports.prove_page import page
from gpsim.stages.trial_jobs import Progress, run_trials
from gpsim.trials.blind import DIAGNOSES, OUTCOME, diagnose_blind, published
from gpsim.trials.concealing import ANSWER, PRIVATE, PUBLIC, publish_hashes, trial_name, write_trial
from gpsim.trials.drawing import stratum_of
from gpsim.trials.judging import judge
from gpsim.trials.summary import summarise
from gpsim.trials.worlds import STRATA

CONFIG = "trials.json"


def numbers_of(trials: int, strata: Sequence[str] = (), long: bool = True) -> list[int]:
    """The first `trials` numbers whose world is of one of `strata` (all when empty); raises UsageError."""
    strange = sorted(set(strata) - set(STRATA))
    if strange:
        raise UsageError(f"no stratum '{strange[0]}'; there are: {', '.join(STRATA)}")

    def wanted(number: int) -> bool:
        stratum, is_long, _ = stratum_of(number)
        return (not strata or stratum in strata) and (long or not is_long)

    return list(islice((n for n in count(1) if wanted(n)), trials))


def conceal(out: Path, seed: int, numbers: Sequence[int], workers: int, progress: Progress) -> Path:
    """Write both halves of every trial below `out`, and the answers' hashes beside the recordings."""
    _remember(out, seed)
    (out / PUBLIC).mkdir(parents=True, exist_ok=True)
    digests = dict(run_trials(partial(_conceal_one, out, seed), numbers, workers, progress))
    publish_hashes(out, {trial_name(n): digest for n, digest in digests.items()})
    return out


def diagnose(out: Path, workers: int, progress: Progress) -> int:
    """Diagnose every recording below OUT/public that has not been yet, blind; how many there are in all."""
    names = {int(name): name for name in sorted(published(out))}
    for _ in run_trials(partial(_diagnose_one, out), list(names), workers, progress):
        pass
    return len(names)


def reveal(out: Path, answers: Path | None, workers: int, progress: Progress) -> dict[str, Any]:
    """Score every diagnosed trial against its verified answer; write prove.json and report.html."""
    paths = sorted((out / DIAGNOSES).glob(f"[0-9]*/{OUTCOME}"))
    if not paths:
        raise UsageError(f"{out}: no diagnoses to score; make them with: gpsim prove diagnose --out {out}")
    where = answers or out / PRIVATE
    numbers = [int(path.parent.name) for path in paths]
    scores = [s for _, s in run_trials(partial(_judge_one, out, where), numbers, workers, progress)]
    scores.sort(key=lambda s: str(s["trial"]))
    content = _facts(where) | summarise(scores)
    write_json(out / "prove.json", _plain(content))
    (out / "report.html").write_text(page(content, scores), encoding="utf-8")
    return content


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


def _diagnose_one(out: Path, number: int) -> float:
    return float(diagnose_blind(out, trial_name(number))["seconds"])


def _judge_one(out: Path, answers: Path, number: int) -> dict[str, Any]:
    return judge(out, answers, trial_name(number))


def _facts(answers: Path) -> dict[str, Any]:
    """Which seed it was, and what it was run with."""
    path = answers / CONFIG
    seed = json.loads(path.read_text(encoding="utf-8"))["seed"] if path.is_file() else None
    return {"seed": seed, "git_commit": git_commit(), "packages": package_versions()}


def _plain(content: Any) -> Any:
    """What is not finite is null."""
    if isinstance(content, dict):
        return {k: _plain(v) for k, v in content.items()}
    if isinstance(content, list):
        return [_plain(v) for v in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content


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
