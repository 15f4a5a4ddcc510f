"""prove: conceal worlds, diagnose them blind, reveal and score. Every trial that is finished is kept."""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import count, islice
from pathlib import Path
from typing import Any

from gpsim.artifacts import git_commit, held, package_versions
from gpsim.errors import UsageError
from gpsim.files import disk_errors, plain, read_object, write_json, written_whole
from gpsim.launchers import Launcher, Progress
from gpsim.reports.prove_page import miss_rows, page, record
from gpsim.stages.jobs import run_trials
from gpsim.trials.blinding import (
    ANSWER,
    DIAGNOSES,
    HASHES,
    NAME,
    OUTCOME,
    PRIVATE,
    PUBLIC,
    diagnose_blind,
    publish_hashes,
    published,
    trial_name,
    write_trial,
)
from gpsim.trials.drawing import stratum_of
from gpsim.trials.machines import ARM, kind_of
from gpsim.trials.robots import stratum_of as robots_stratum
from gpsim.trials.scoring import score_trial
from gpsim.trials.summary import summarise
from gpsim.trials.worlds import FROM, STRATA

CONFIG = "trials.json"
OPTION = "--out"  # names another place, where this one cannot be written
MJCF = "mjcf"
"""What --system asks for."""
ROBOT_STRATA = ("single", "pair", "none")
APART = {name: f"--{name} 20, with --trials 0 no others" for name in ("machines", "curves", "rough")}
COUNTED = {"whole": "whole robots", "rough": "rough worlds", "afloat": "worlds that float or stand"}
ROBOTS_APART = {"whole": "--system mjcf --robots 20, with --trials 0"}
ROBOTS_APART |= {"afloat": "--system mjcf --floating 20, with --trials 0"}
NOT_RECORDED = "not recorded"  # the commit of a diagnosis outside a checkout, or by an earlier version


def numbers_of(
    trials: int,
    strata: Sequence[str] = (),
    long: bool = True,
    rough: int = 0,
    machines: int = 0,
    curves: int = 0,
    plan: int = 0,
) -> list[int]:
    """The first `trials` numbers whose world is of one of `strata` (all when empty), and of rough worlds and so on.

    Raises UsageError.
    """
    _refuse_strange(strata, STRATA, "", ROBOTS_APART | APART)
    if "words" in strata and len(strata) > 1:
        raise UsageError("worlds of newer families are scored separately: use only --stratum words")

    def wanted(number: int) -> bool:
        stratum, is_long, _ = stratum_of(number)
        return (not strata or stratum in strata) and (long or not is_long)

    if trials + rough + machines + curves + plan < 1:
        raise UsageError(
            "no worlds: give their number with --trials, or for rough logs, machines, curves and plans with --rough, "
            "--machines, --curves, --plan"
        )
    first = FROM["words"] + 1 if "words" in strata else 1
    plain_ones = islice((n for n in count(first) if wanted(n)), trials)
    after = ((FROM["curves"], curves), (FROM["rough"], rough))
    counted = [number for first, many in after for number in range(first + 1, first + many + 1)]
    plans = range(FROM["plans"] + 1, FROM["plans"] + plan + 1)
    packages = {of.metadata["Name"] for of in importlib.metadata.distributions()}
    with_arms = {"mujoco", "example-robot-data"} <= packages  # which arms need
    able = (n for n in count(FROM["machines"] + 1) if with_arms or kind_of(n) != ARM)
    return [*plain_ones, *counted, *islice(able, machines), *plans]


def _refuse_strange(strata: Sequence[str], known: Sequence[str], of: str, apart: Mapping[str, str]) -> None:
    """Raise UsageError for a stratum that is none; apart: kinds that are asked for otherwise, and how."""
    strange = sorted(set(strata) - set(known))
    for name, how in apart.items():
        if name in strange:
            raise UsageError(f"{COUNTED.get(name, name)} are counted by themselves: {how}")
    if strange:
        raise UsageError(f"no stratum '{strange[0]}'{of}; there are: {', '.join(known)}")


def robots_numbers(trials: int, strata: Sequence[str] = (), whole: int = 0, floating: int = 0) -> list[int]:
    """The first `trials` numbers of worlds whose simulator is a MuJoCo model, of one of `strata`.

    And of whole robots and of what floats or stands. All strata when empty. Raises UsageError.
    """
    _refuse_strange(strata, ROBOT_STRATA, " of --system mjcf", ROBOTS_APART)
    if trials + whole + floating < 1:
        raise UsageError("no worlds: give their number with --trials, --robots or --floating")
    wanted = (rank for rank in count(1) if not strata or robots_stratum(rank)[0] in strata)
    few = [FROM["robots"] + rank for rank in islice(wanted, trials)]
    others = ((FROM["whole"], whole), (FROM["afloat"], floating))
    return [*few, *(n for first, many in others for n in range(first + 1, first + many + 1))]


def conceal(out: Path, seed: int, numbers: Sequence[int], launcher: Launcher, progress: Progress) -> Path:
    """Write both halves of every trial below `out`, and the answers' hashes beside the recordings."""
    with disk_errors(out, OPTION):
        _remember(out, seed)
        (out / PUBLIC).mkdir(parents=True, exist_ok=True)
        digests = dict(run_trials(partial(write_trial, out, seed), numbers, launcher, progress))
        publish_hashes(out, {trial_name(n): digest for n, digest in digests.items()})
    return out


def diagnose(out: Path, launcher: Launcher, progress: Progress) -> int:
    """Diagnose every recording below OUT/public that has not been yet, blind; how many there are in all."""
    with disk_errors(out, OPTION):
        names = {int(name): name for name in sorted(published(out))}
        ahead = [number for number, name in names.items() if not (out / DIAGNOSES / name / OUTCOME).is_file()]
        for _ in run_trials(partial(_diagnose_one, out), ahead, launcher, progress):
            pass
    return len(names)


def reveal(out: Path, answers: Path | None, launcher: Launcher, progress: Progress) -> dict[str, Any]:
    """Score every diagnosed trial against its verified answer; write prove.json, report.html and record.md."""
    with disk_errors(out, OPTION):
        return _reveal(out, answers, launcher, progress)


def _reveal(out: Path, answers: Path | None, launcher: Launcher, progress: Progress) -> dict[str, Any]:
    found = (path.parent.name for path in (out / DIAGNOSES).glob(f"[0-9]*/{OUTCOME}"))
    names = sorted(name for name in found if NAME.fullmatch(name))
    if not names:
        raise UsageError(f"{out}: no diagnoses to score; make them with: gpsim prove diagnose --out {out}")
    where = answers or out / PRIVATE
    work, numbers = partial(_score_one, out, where), [int(name) for name in names]
    scores = [s for _, s in run_trials(work, numbers, launcher, progress)]
    scores.sort(key=lambda s: str(s["trial"]))
    undiagnosed = sorted(set(published(out)) - set(names))
    config = where / CONFIG
    content = {
        "seed": read_object(config)["seed"] if config.is_file() else None,
        "git_commit": git_commit(),
        "diagnosed_under": sorted({str(s["git_commit"] or NOT_RECORDED) for s in scores}),
        "packages": package_versions(),
        "undiagnosed": undiagnosed,
        **summarise(scores),
        "every_miss": miss_rows(scores),
    }
    with written_whole(out / "prove.json") as made:
        write_json(made, plain(content))
    for name, text in (("report.html", page(content, scores)), ("record.md", record(content))):
        with written_whole(out / name) as made:
            made.write_text(text, encoding="utf-8")
    return content


def read_answers(out: Path) -> list[dict[str, Any]]:
    """Every answer below `out`, in order; unverified."""
    paths = sorted((out / PRIVATE).glob(f"[0-9]*/{ANSWER}"))
    if not paths:
        raise UsageError(
            f"{out}: no answers below {PRIVATE}/; make some with: gpsim prove conceal --out {out}"
        )
    return [read_object(path) for path in paths]


def _diagnose_one(out: Path, number: int) -> float:
    name = trial_name(number)
    with disk_errors(out, OPTION):
        (out / DIAGNOSES).mkdir(exist_ok=True)
    # Another proof in the same folder may be at it: what it finishes is found.
    with held(out / DIAGNOSES / f".{name}.lock", lambda who: None):
        return float(diagnose_blind(out, name)["seconds"])


def _score_one(out: Path, answers: Path, number: int) -> dict[str, Any]:
    return score_trial(out, answers, trial_name(number))


def _remember(out: Path, seed: int) -> None:
    """One folder holds trials of one seed, concealed by whoever holds their answers."""
    path = out / PRIVATE / CONFIG
    if not path.is_file() and (out / PUBLIC / HASHES).is_file():
        raise UsageError(
            f"{out}: contains recordings whose answers are elsewhere; diagnose them with: gpsim prove diagnose --out "
            f"{out}"
        )
    if path.is_file():
        known = read_object(path)["seed"]
        if known != seed:
            raise UsageError(f"{out}: holds trials of seed {known}; choose another --out for seed {seed}")
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as made:
        made.write_text(json.dumps({"seed": seed}) + "\n", encoding="utf-8")
