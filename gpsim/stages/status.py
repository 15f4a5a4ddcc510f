"""status, and --dry-run: what exists, what would be made, and why; nothing is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gpsim.artifacts import Artifact, Recipe, read_manifest
from gpsim.errors import UsageError
from gpsim.runs import Difference, LoopStatus, Making, Standing, entry_at, nearest
from gpsim.stages import full_loop, report
from gpsim.stages.registry import STAGES
from gpsim.stages.stage import LATER, NOT_MADE, NotMadeError, Request, Stage, quoted


def loop_status(request: Request, seeds: tuple[int, ...]) -> LoopStatus:
    """The loop and its report, artifact by artifact; raises UsageError for settings that the loop refuses."""
    jobs = full_loop.plan(request, seeds)
    found: dict[str, Standing] = {}
    for job in jobs:
        standing = _forgiving(STAGES[job.stage], job.request, job.label)
        missing = tuple(label for label in job.after if found[label].state != "there")
        if standing.state == "waits" and missing:
            standing = replace(standing, waits_for=missing)
        found[job.label] = standing
    last = _forgiving(report.stage_for(seeds), request, "report")
    missing = tuple(label for label, standing in found.items() if standing.state != "there")
    if last.state == "waits" and missing:
        last = replace(last, waits_for=missing)
    return LoopStatus(
        experiment=str(request.config["experiment"]),
        runs_dir=str(request.config["runs_dir"]),
        seeds=seeds,
        standings=(*found.values(), last),
        command=_loop_command(request, seeds),
    )


def standing_of(stage: Stage, request: Request, job: str | None = None) -> Standing:
    """How it stands with one stage; raises UsageError for what its command refuses at once."""
    known = Standing(job or stage.name, stage.name, "to make", stage.command(request))
    try:
        recipe = stage.keyed(request)
    except NotMadeError as error:
        return replace(
            _planned(stage, request, known), state="waits", waits_for=(error.stage,), make_first=error.command
        )
    if request.out is not None:
        if request.out.exists():
            raise UsageError(
                f"{request.out}: exists already; artifacts are never overwritten, choose another --out"
            )
        known = replace(known, path=str(request.out))
    elif (found := request.store.find(recipe)) is not None:
        return replace(known, state="there", path=str(found.path))
    return _beside_nearest(request, recipe, known)


def _forgiving(stage: Stage, request: Request, job: str) -> Standing:
    """As `standing_of`; one artifact that is damaged is no reason to say nothing of the others."""
    try:
        return standing_of(stage, request, job)
    except UsageError as error:
        return Standing(job, stage.name, "refused", stage.command(request), refusal=str(error))


def _planned(stage: Stage, request: Request, known: Standing) -> Standing:
    """What differs beside the parents that are not made, as far as can be said without them."""
    planned = replace(request, planned=True)
    try:
        return _beside_nearest(planned, stage.keyed(planned), known)
    except UsageError:  # its recipe reads a file of a parent
        return known


def _beside_nearest(request: Request, recipe: Recipe, known: Standing) -> Standing:
    made = [(artifact, _completed(Making.of(artifact))) for artifact in _newest_first(request, recipe.stage)]
    found = nearest(made, _completed(Making.asked(recipe)))
    if found is None:
        return known
    artifact, differing = found
    told = tuple(_with_places(d, artifact, recipe) if d.kind == "parent" else d for d in differing)
    return replace(known, nearest=str(artifact.path), differences=told)


def _completed(making: Making) -> Making:
    """With the settings that recipes leave out at the value that they had before they were settings."""
    config = {key: {**LATER[key], **part} if key in LATER else part for key, part in making.config.items()}
    return replace(making, config=config)


def _newest_first(request: Request, stage: str) -> list[Artifact]:
    """Finished versions by the clock; damaged ones are left out."""
    entries = [entry_at(path, request.store.root) for path in request.store.versions(stage)]
    entries.sort(key=lambda entry: entry.age_key, reverse=True)
    return [entry.artifact for entry in entries if entry.artifact is not None]


def _with_places(difference: Difference, old: Artifact, recipe: Recipe) -> Difference:
    """A parent by where it lies instead of its digest; None for one that is not made yet."""
    role = difference.key
    new = recipe.parents.get(role)
    made = None if new is None or new.digest == NOT_MADE else str(new.path)
    return replace(
        difference,
        old=_place(old, role) if role in old.manifest["parents"] else difference.old,
        new=made if new is not None else difference.new,
    )


def _place(artifact: Artifact, role: str) -> str:
    """Where a finished artifact's parent lies; its stage and digest where that is no longer there."""
    parent = artifact.manifest["parents"][role]
    for need in entry_at(artifact.path, artifact.path.parent).needs:
        if need.role == role and need.path is not None:
            try:
                if read_manifest(Path(need.path)).digest == need.digest:
                    return need.path
            except UsageError:
                break
    return f"{parent['stage']} {parent['sha256'][:12]}"


def _loop_command(request: Request, seeds: tuple[int, ...]) -> str:
    several = [f"--seeds {len(seeds)}"] if len(seeds) > 1 else []
    return " ".join(["gpsim run full-loop", *map(quoted, request.words), *several])
