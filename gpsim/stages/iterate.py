"""run iterate: deploy, record, say what is new, refit, train - round after round, until one gains nothing.

Thesis, section 5.3. Every part of a round is an artifact of its own, found again where it exists: a run that was cut
off goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gpsim.artifacts import Artifact, Recipe
from gpsim.channels import FloatArray
from gpsim.environments import as_sensed, collect_episodes, policy_actor
from gpsim.errors import UsageError
from gpsim.evaluation import one_step_errors
from gpsim.files import Json, plain, read_object, write_json
from gpsim.launchers import Launcher
from gpsim.recordings import Episode, read_recording, write_recording
from gpsim.settings import positive
from gpsim.simulators import Plant
from gpsim.stages import build_residuals, building, certify, collect, safety, train_gp_policy
from gpsim.stages.building import base_plant, drivable, make_task, recording_of, target_plant
from gpsim.stages.jobs import Job, Told, run_jobs
from gpsim.stages.policy_files import read_policy
from gpsim.stages.stage import Request, Stage, generator, stage_about

DRIVE, SWEEP, SUMMARY = "drive", "sweep", "iteration.json"


@dataclass(frozen=True)
class Round:
    """One round: what its policy earned, and how new what it met was.

    trial: mean return on the trial's starts, by which policies are chosen; gain: over the best before, and its standard
    error; returns: mean on the evaluation's starts, which decide nothing; new: what the simulator of the round before
    leaves of the base's one-step error on this round's drives, None in the first; transitions: recorded so far.
    """

    trial: float
    gain: float | None
    gain_error: float | None
    returns: float
    adopted: bool
    new: float | None = None
    transitions: int | None = None


def check(request: Request) -> int:
    """The number of rounds; raises UsageError for settings with which nothing can be iterated."""
    rounds = positive(request.config["rounds"], "rounds")
    if not drivable(request.config):
        raise UsageError(
            "run iterate: target=recording cannot be driven; deploy the policy of each round yourself and give its "
            "log to the next as recording=DIR"
        )
    if request.config["recording"] is not None or request.config["diagnosis"] is not None:
        raise UsageError("run iterate: every round makes its own recording; remove recording= and diagnosis=")
    if train_gp_policy.robust(request) and request.config["correction"] is None:
        raise UsageError("run iterate: with robustness=posterior, use correction=effects or effects+gp")
    positive(request.config["collect"]["episodes"], "collect.episodes")
    collect.check(request)
    build_residuals.check(request)
    building.check_gp(request)
    target_plant(request.config)
    certify.recipe(request)
    return rounds


def run(request: Request, launcher: Launcher, told: Told) -> Artifact:
    """Go on until a round gains no more than its standard error, or all rounds are done; the summary."""
    rounds = check(request)

    def made(label: str, stage: str, of: Request, made_by: Callable[[], Stage] | None = None) -> Artifact:
        return run_jobs([Job(label, stage, of, (), made_by)], launcher, told)[0][label]

    policy = made("policy 0", "train-source", request.having(variant="source"))
    best, kept, done = policy, trial(request, policy), []
    parents: dict[str, Artifact] = {"policy-0": policy}
    done.append(Round(float(kept.mean()), None, None, _evaluated(request, policy), adopted=True))
    recording: Artifact | None = None
    if request.config["collect"]["policy"] == SWEEP:  # whose commands stand for as long as processes may need
        recording = parents["recording"] = made(SWEEP, "collect", request)
    known: Plant | None = None
    stopped = f"all {rounds} rounds are done"
    for turn in range(rounds):
        before = {} if recording is None else {"before": recording}
        recording = made(f"drive {turn}", DRIVE, request, partial(_drive_stage, {"policy": best, **before}))
        parents[f"recording-{turn}"] = recording
        done[-1] = replace(
            done[-1],
            new=None if known is None else _new(request, known, recording),
            transitions=read_recording(recording.path).transition_count,
        )
        asked = request.having(recording=str(recording.path))
        jobs = _refit(asked, turn)
        policy = run_jobs(jobs, launcher, told)[0][jobs[-1].label]
        known = safety.predictor(jobs[-1].request)
        parents[f"policy-{turn + 1}"] = policy
        earned = trial(request, policy)
        difference = earned - kept  # from the same starts
        gain = float(difference.mean())
        error = float(difference.std(ddof=1) / np.sqrt(len(difference)))
        adopted = gain > 0.0
        done.append(Round(float(earned.mean()), gain, error, _evaluated(request, policy), adopted))
        if adopted:
            best, kept = policy, earned
        if gain <= error:
            stopped = (
                f"round {turn + 1} gained {gain:.3g}, which does not exceed its standard error of {error:.3g}"
            )
            break
    return made("iterate", "iterate", request, partial(_summary_stage, done, stopped, parents))


def _refit(request: Request, turn: int) -> list[Job]:
    """What makes a policy, the last of the jobs, of what was recorded so far."""
    if request.config["correction"] in (None, "gp"):
        request = request.having(correction="gp")
        residuals = Job(f"residuals {turn}", "build-residuals", request)
        learnt = [residuals, Job(f"fit {turn}", "fit-gp", request, (residuals.label,))]
    else:
        learnt = [Job(f"diagnosis {turn}", "diagnose", request)]
    return [*learnt, Job(f"policy {turn + 1}", "train-gp-policy", request, (learnt[-1].label,))]


def _drive_stage(parents: Mapping[str, Artifact]) -> Stage:
    return stage_about(DRIVE, _drive_recipe, _drive, parents, format=1)


def _drive_recipe(request: Request, parents: Mapping[str, Artifact]) -> Recipe:
    """A policy's drives on the target, and behind them all that was recorded before."""
    config = request.section("simulator", "target", "task", "collect")
    return Recipe(DRIVE, config, parents, {"seed": request.seed})


def _drive(request: Request, folder: Path, parents: Mapping[str, Artifact]) -> Json:
    """The newest episodes come first: what is held out are then the oldest."""
    section, base = request.config["collect"], base_plant(request.config)
    purpose = f"iterate/{parents['policy'].digest}"
    act = policy_actor(read_policy(parents["policy"].path), generator(request.seed, f"{purpose}/driver"))
    episodes = collect_episodes(
        target_plant(request.config),
        make_task(request.config).on_target(),
        act,
        int(section["episodes"]),
        generator(request.seed, f"{purpose}/episodes"),
    )
    rng = generator(request.seed, f"{purpose}/sensors")
    sensed, noise = as_sensed(episodes, base.state, float(section["noise"]), float(section["missing"]), rng)
    before = read_recording(parents["before"].path) if "before" in parents else None
    older = () if before is None else before.episodes
    turn = 0 if before is None else 1 + int(before.provenance.get("round", -1))
    episodes = (*(replace(e, name=f"{turn}.{e.name}") for e in sensed), *older)
    recording = recording_of(base, episodes, "iterate", request.seed, noise, round=turn, new=len(sensed))
    write_recording(recording, folder)
    return {"transitions": recording.transition_count}


def _new(request: Request, known: Plant, recording: Artifact) -> float:
    """The root mean square of the one-step error that a simulator leaves, over the base's; mean over the channels."""
    read = read_recording(recording.path)
    newest: tuple[Episode, ...] = read.episodes[: int(read.provenance["new"])]
    left, base = (
        one_step_errors(plant, newest, read.state, generator(request.seed, "iterate/new"))
        for plant in (known, base_plant(request.config))
    )
    size = np.sqrt((base**2).mean(axis=0))
    counts = size > 1e-9  # the base is right about a position's change
    return float((np.sqrt((left**2).mean(axis=0))[counts] / size[counts]).mean())


def trial(request: Request, policy: Artifact) -> FloatArray:
    """(N,) returns on the target, of starts that no evaluation knows."""
    count = int(request.config["evaluate"]["episodes"])
    rng = generator(request.seed, "iterate/trial")
    start = make_task(request.config).start(count, rng)
    return certify.returns_of(request, target_plant(request.config), policy, start, "iterate/trial")


def _evaluated(request: Request, policy: Artifact) -> float:
    target, start = target_plant(request.config), certify.evaluation_starts(request)
    return float(certify.returns_of(request, target, policy, start, "evaluate/returns").mean())


def _summary_stage(done: list[Round], stopped: str, parents: dict[str, Artifact]) -> Stage:
    def recipe(request: Request) -> Recipe:
        config = request.section("rounds", "simulator", "target", "task", "evaluate", "correction")
        return Recipe("iterate", config, parents, {"seed": request.seed})

    def write(request: Request, recipe: Recipe, folder: Path) -> Json:
        best = max(i for i, r in enumerate(done) if r.adopted)
        content: dict[str, Any] = {
            "rounds": [asdict(r) for r in done],
            "best": best,
            "policy": str(parents[f"policy-{best}"].path),
            "stopped": stopped,
        }
        write_json(folder / SUMMARY, plain(content))
        return {}

    return Stage("iterate", recipe, write, lines, format=1)


def lines(artifact: Artifact) -> list[str]:
    """A line a round, and why it stopped."""
    found = read_object(artifact.path / SUMMARY)
    out = []
    for turn, r in enumerate(found["rounds"]):
        gained = "" if r["gain"] is None else f", gained {r['gain']:.1f} ± {r['gain_error']:.1f} in the trial"
        new = (
            ""
            if r["new"] is None
            else f"; {100 * r['new']:.0f} % of the base's one-step error was new in its drives"
        )
        kept = "" if r["adopted"] else ", not adopted"
        out.append(f"round {turn}: return {r['returns']:.1f}{gained}{kept}{new}")
    return [*out, f"stopped: {found['stopped']}", f"best: round {found['best']}, {found['policy']}"]
