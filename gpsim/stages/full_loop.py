"""full-loop: every stage for every seed, side by side where they do not depend on each other."""

from __future__ import annotations

from gpsim.settings import positive
from gpsim.stages import build_residuals, certify, collect, evaluate, fit_gp
from gpsim.stages.building import (
    base_plant,
    drivable,
    make_task,
    randomised_plant,
    target_plant,
    training_settings,
)
from gpsim.stages.evaluate import TRAINED_BY, policy_names
from gpsim.stages.jobs import Finished, Job, Update, run_jobs
from gpsim.stages.stage import Request


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
    base_plant(request.config), make_task(request.config)
    training_settings(request.config)
    evaluate.check(request)
    if "Domain randomisation" in policy_names(request):
        randomised_plant(request.config)
    collect.check(request)
    build_residuals.check(request)
    fit_gp.check(request)
    if (episodes := request.config["diagnose"]["episodes"]) is not None:
        positive(episodes, "diagnose.episodes")
    if drivable(request.config):
        target_plant(request.config)
        certify.recipe(request)


def _plan_seed(request: Request, seed: int) -> list[Job]:
    source = Job(f"Source · seed {seed}", "train-source", request.having(variant="source"))
    collect = Job(f"collect · seed {seed}", "collect", request, (source.label,))
    residuals = Job(f"build-residuals · seed {seed}", "build-residuals", request, (collect.label,))
    fit = Job(f"fit-gp · seed {seed}", "fit-gp", request, (residuals.label,))
    diagnose = Job(f"diagnose · seed {seed}", "diagnose", request, (collect.label,))
    jobs = [source, collect, residuals, fit, *([diagnose] if "Effects" in policy_names(request) else [])]
    for name in policy_names(request):
        stage, settings = TRAINED_BY[name]
        after = (fit.label,) if stage.name == "train-gp-policy" else ()
        if name == "Effects":
            after = (diagnose.label,)
        job = Job(f"{name} · seed {seed}", stage.name, request.having(**settings), after)
        if name != "Source":
            jobs.append(job)
    return jobs


def run(request: Request, seeds: tuple[int, ...], workers: int, update: Update, finished: Finished) -> None:
    """Make everything the report needs; what exists with the same configuration and parents is kept."""
    run_jobs(plan(request, seeds), workers, update, finished)
