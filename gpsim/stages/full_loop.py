"""full-loop: every stage for every seed, side by side where they do not depend on each other."""

from __future__ import annotations

from gpsim.errors import UsageError
from gpsim.launchers import Launcher, Update
from gpsim.recordings import read_recording
from gpsim.residuals import check_clock
from gpsim.settings import positive
from gpsim.stages import build_residuals, building, certify, collect, evaluate, train_source
from gpsim.stages.building import base_plant, drivable, make_task, randomised_plant, target_plant
from gpsim.stages.diagnose_loop import find_diagnosis
from gpsim.stages.jobs import Finished, Job, run_jobs
from gpsim.stages.stage import Request, blamed
from gpsim.stages.train_gp_policy import DIAGNOSED, TRAINED_BY, effects_plant, needs_diagnosis, policy_names
from gpsim.stages.train_source import settings_for


def plan(request: Request, seeds: tuple[int, ...]) -> list[Job]:
    """The loop's jobs in the order in which they matter: what others wait for comes first."""
    _check(request)
    jobs = [job for seed in seeds for job in _plan_seed(request.having(seed=seed), seed)]
    shared = [Job("certify", "certify", request.having(seed=seeds[0]))] if drivable(request.config) else []
    jobs += shared
    for seed in seeds:
        after = tuple(f"{name} · seed {seed}" for name in policy_names(request))
        parents = (*after, f"Source · seed {seed}", f"fit-gp · seed {seed}", *(job.label for job in shared))
        jobs.append(Job(f"evaluate · seed {seed}", "evaluate", request.having(seed=seed), parents))
    return jobs


def _check(request: Request) -> None:
    """Settings that are wrong are better found now than after an hour of training."""
    if request.config["deployed"] is not None:
        raise UsageError("deployed= scores logs of a policy and needs no loop: gpsim evaluate deployed=...")
    train_source.tracks(request)
    base_plant(request.config)
    settings_for(request, make_task(request.config))
    evaluate.check(request)
    if "Domain randomisation" in policy_names(request):
        randomised_plant(request.config)
    if request.config["recording"] is None:
        collect.check(request)
    else:  # it must be there, be whole, and be of this experiment's simulator
        build_residuals.recipe(request)
        recording = read_recording(build_residuals.recording_folder(request))
        check_clock(recording)
        build_residuals.check_same(recording, base_plant(request.config))
    if request.config["diagnosis"] is not None:
        effects_plant(request.having(correction="effects"), find_diagnosis(request))
    build_residuals.check(request)
    building.check_gp(request)
    asked, section = request.config["diagnose"]["episodes"], request.config["collect"]
    if asked is not None:
        positive(asked, "diagnose.episodes")
        driven = request.config["recording"] is None and collect.waits_for_policy(request)
        if driven and asked > positive(section["episodes"], "collect.episodes"):
            raise UsageError(
                f"diagnose.episodes={asked}: collect.episodes={section['episodes']} are recorded"
            )
    if drivable(request.config):
        target_plant(request.config)
        certify.recipe(request)


def _plan_seed(request: Request, seed: int) -> list[Job]:
    """What is given, `recording=` or `diagnosis=`, is not made."""
    source = Job(f"Source · seed {seed}", "train-source", request.having(variant="source"))
    driver = (source.label,) if collect.waits_for_policy(request) else ()
    collected = Job(f"collect · seed {seed}", "collect", request, driver)
    recorded = [collected] if request.config["recording"] is None else []
    behind = tuple(job.label for job in recorded)
    residuals = Job(f"build-residuals · seed {seed}", "build-residuals", request, behind)
    fit = Job(f"fit-gp · seed {seed}", "fit-gp", request, (residuals.label,))
    found = Job(f"diagnose · seed {seed}", "diagnose", request, behind)
    diagnosed = [found] if needs_diagnosis(request) and request.config["diagnosis"] is None else []
    # What waits for no policy goes first: logs that cannot be read are found at once.
    jobs = [source, *recorded] if driver else [*recorded, source]
    jobs += [residuals, fit, *diagnosed]
    for name in policy_names(request):
        stage, settings = TRAINED_BY[name]
        after: tuple[str, ...] = (fit.label,) if stage.name == "train-gp-policy" else ()
        if name in DIAGNOSED:
            after = tuple(job.label for job in diagnosed)
        job = Job(f"{name} · seed {seed}", stage.name, request.having(**settings), after)
        if name != "Source":
            jobs.append(job)
    return jobs


def run(
    request: Request, seeds: tuple[int, ...], launcher: Launcher, update: Update, finished: Finished
) -> None:
    """Make everything the report needs; what exists with the same configuration and parents is kept."""
    with blamed(request.config["simulator"]["name"]):
        run_jobs(plan(request, seeds), launcher, update, finished)
