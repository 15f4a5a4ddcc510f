"""`gpsim runs`: what is in runs/, as plain data; what has to be known of today's code to say what is stale."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from gpsim import runs
from gpsim.artifacts import MANIFEST, Artifact, Leftover, Recipe, read_manifest
from gpsim.errors import UsageError
from gpsim.reports.runs_text import says
from gpsim.runs import Catalogue, Difference, Entry, LoopStatus, Making, Standing, entry_at, read_catalogue
from gpsim.stages import diagnose_loop, fleet, full_loop, import_log, report
from gpsim.stages.registry import STAGES
from gpsim.stages.stage import LATER, NOT_MADE, RELEASE, NotMadeError, Request, Stage

Code = Mapping[str, tuple[int, str]]
"""Of each stage the format and the state of the code that make its artifacts today."""


def todays_code() -> Code:
    """What makes each stage's artifacts today."""
    nowhere = Path()
    stages = [*STAGES.values(), report.stage_for((0,)), diagnose_loop.score_stage(nowhere, nowhere)]
    return {stage.name: (stage.format, stage.code) for stage in stages} | {
        import_log.STAGE_NAME: (1, ""),
        full_loop.SWEEP: (full_loop.FORMAT, RELEASE),
        fleet.STAGE_NAME: (fleet.FORMAT, RELEASE),
    }


def list_runs(
    runs_dir: Path, experiment: str | None = None, stage: str | None = None, verify: bool = False
) -> runs.Listing:
    """Every artifact, or those of an experiment or a stage; verify: every byte is looked at."""
    catalogue, code = read_catalogue(runs_dir, verify=verify), todays_code()
    chosen = [e for e in catalogue.entries if experiment in (None, e.experiment) and stage in (None, e.stage)]
    order = {name: place for place, name in enumerate(code)}
    chosen.sort(key=lambda e: (e.experiment or "~", order.get(e.stage, len(order)), e.age_key))
    beside = _beside(catalogue.leftovers) if experiment is None and stage is None else ()
    return runs.Listing(str(runs_dir), tuple(_listed(catalogue, entry, code) for entry in chosen), beside)


def show_run(runs_dir: Path, word: str, beside: Sequence[Path] = ()) -> runs.Shown:
    """One artifact: what it is made from, by what, and what was made of it."""
    catalogue = read_catalogue(runs_dir, _places([word], beside))
    entry = runs.named(catalogue, word)
    verified = entry_at(entry.path, runs_dir, verify=True)
    listed = _listed(catalogue, entry, todays_code())
    if verified.damage is not None and listed.damage is None:
        listed = replace(listed, state="broken", damage=verified.damage)
    names = entry.manifest.get("files", {})
    return runs.Shown(
        artifact=listed,
        sha256=entry.artifact.digest if entry.artifact is not None else None,
        config=entry.manifest.get("config", {}),
        parents=tuple(
            runs.Parent(need.role, need.stage, need.digest, parent.name if parent is not None else None)
            for need, parent in runs.parents(catalogue, entry)
        ),
        children=tuple(child.name for child in runs.children(catalogue, entry)),
        dependents=len(runs.dependents(catalogue, [entry.path])),
        figures=runs.figures_of(entry.path),
        packages=entry.manifest.get("packages", {}),
        commit=entry.manifest.get("git_commit"),
        files={name: runs.size_of(path) for name in names if (path := entry.path / name).is_file()},
    )


def compare_runs(runs_dir: Path, old: str, new: str, beside: Sequence[Path] = ()) -> runs.Compared:
    """How two artifacts differ: configuration, files, seeds, parents, code, packages, figures, content."""
    catalogue = read_catalogue(runs_dir, _places([old, new], beside))
    one, other = runs.named(catalogue, old), runs.named(catalogue, new)
    for entry in (one, other):
        if entry.artifact is None:
            raise UsageError(str(entry.damage))
    return runs.Compared(one.name, other.name, runs.compared(catalogue, one, other))


@dataclass(frozen=True)
class Planned:
    """What would go, as it is told, and what removes it: that returns what went, and raises UsageError."""

    told: runs.Removed
    go: Callable[[], runs.Removal]


def plan_removal(
    runs_dir: Path,
    words: Sequence[str],
    with_dependents: bool = False,
    dry_run: bool = False,
    beside: Sequence[Path] = (),
) -> Planned:
    """Of `rm`; raises UsageError where something else needs one of them."""
    places = _places(words, beside)
    catalogue = read_catalogue(runs_dir, places)
    asked = {entry.path: entry for entry in (runs.named(catalogue, word) for word in words)}
    removal = runs.removal_of(catalogue, list(asked.values()), with_dependents)
    return Planned(_told(catalogue, removal, dry_run), lambda: runs.remove(catalogue, removal, places))


def plan_gc(
    runs_dir: Path, keep: int | None = None, dry_run: bool = False, beside: Sequence[Path] = ()
) -> Planned:
    """Of `gc`, which leaves out what something is being made of."""
    catalogue = read_catalogue(runs_dir, beside)
    told = _told(catalogue, runs.garbage(catalogue, keep), dry_run)
    return Planned(told, lambda: runs.collect_garbage(runs_dir, keep, beside))


def _told(catalogue: Catalogue, removal: runs.Removal, dry_run: bool) -> runs.Removed:
    """Before it is done, as what it says is read from the disk."""
    code = todays_code()
    entries = tuple(_listed(catalogue, entry, code) for entry in removal.entries)
    return runs.Removed(entries, _beside(removal.leftovers), removal.bytes, dry_run)


def _places(words: Sequence[str], beside: Sequence[Path]) -> list[Path]:
    """Folders to look into besides: those that the user names, and artifacts elsewhere that are asked for."""
    for folder in beside:
        if not folder.is_dir():
            raise UsageError(f"--beside {folder}: no such folder")
    return [*beside, *(Path(word) for word in words if (Path(word) / MANIFEST).is_file())]


def _beside(leftovers: Sequence[Leftover]) -> tuple[runs.Beside, ...]:
    return tuple(runs.Beside(str(x.path), x.kind, runs.size_of(x.path)) for x in leftovers)


def _listed(catalogue: Catalogue, entry: Entry, code: Code) -> runs.Listed:
    why = _why_stale(catalogue, entry, code)
    seconds = entry.timings.get("seconds")
    return runs.Listed(
        name=entry.name,
        path=str(entry.path),
        experiment=entry.experiment,
        stage=entry.stage,
        state="broken" if not entry.whole else "stale" if why else "finished",
        says=says(entry.stage, runs.figures_of(entry.path), entry.manifest.get("config", {}), entry.timings),
        made=entry.made,
        seconds=float(seconds) if isinstance(seconds, int | float) else None,
        bytes=entry.bytes,
        seeds=entry.manifest.get("seeds", {}),
        why=why,
        damage=entry.damage,
    )


def _why_stale(catalogue: Catalogue, entry: Entry, code: Code) -> tuple[Difference, ...]:
    """What of an artifact is not today's: code of its stage, parents that are gone."""
    if not entry.whole:
        return ()
    gone = [
        Difference("parent", need.role, need.path or f"{need.stage} {str(need.digest)[:12]}", runs.ABSENT)
        for need, parent in runs.parents(catalogue, entry)
        if parent is None
    ]
    made = (entry.manifest.get("format", 1), entry.manifest.get("code", ""))
    keys = zip(("format", "code"), made, code.get(entry.stage, made), strict=True)
    return (*(Difference("code", key, old, new) for key, old, new in keys if old != new), *gone)


def loop_status(request: Request, seeds: tuple[int, ...]) -> LoopStatus:
    """The loop and its report, artifact by artifact; raises UsageError for settings that the loop refuses."""
    found: dict[str, Standing] = {}
    plan = [(STAGES[job.stage], job.request, job.label, job.after) for job in full_loop.plan(request, seeds)]
    every = tuple(label for _, _, label, _ in plan)
    for stage, asked, label, after in [*plan, (report.stage_for(seeds), request, "report", every)]:
        try:
            standing = standing_of(stage, asked, label)
        except UsageError as error:  # one artifact that is damaged is no reason to say nothing of the others
            standing = Standing(label, stage.name, "refused", stage.command(asked), refusal=str(error))
        missing = tuple(before for before in after if found[before].state != "there")
        waits = standing.state == "waits" and missing
        found[label] = replace(standing, waits_for=missing) if waits else standing
    several = [f"--seeds {len(seeds)}"] if len(seeds) > 1 else []
    return LoopStatus(
        experiment=str(request.config["experiment"]),
        runs_dir=str(request.config["runs_dir"]),
        seeds=seeds,
        standings=tuple(found.values()),
        command=" ".join(["gpsim run full-loop", *map(shlex.quote, request.words), *several]),
    )


def standing_of(stage: Stage, request: Request, job: str | None = None) -> Standing:
    """How it stands with one stage; raises UsageError for what its command refuses at once."""
    known = Standing(job or stage.name, stage.name, "to make", stage.command(request))
    try:
        recipe = stage.keyed(request)
    except NotMadeError as error:
        planned = replace(request, planned=True)
        with suppress(UsageError):  # where its recipe reads a file of a parent nothing else is known
            known = _beside_nearest(planned, stage.keyed(planned), known)
        return replace(known, state="waits", waits_for=(error.stage,), make_first=error.command)
    if request.out is not None:
        if request.out.exists():
            raise UsageError(
                f"{request.out}: exists already; artifacts are never overwritten, choose another --out"
            )
        known = replace(known, path=str(request.out))
    elif (found := request.store.find(recipe)) is not None:
        return replace(known, state="there", path=str(found.path))
    return _beside_nearest(request, recipe, known)


def _beside_nearest(request: Request, recipe: Recipe, known: Standing) -> Standing:
    entries = [entry_at(path, request.store.root) for path in request.store.versions(recipe.stage)]
    entries.sort(key=lambda entry: entry.age_key, reverse=True)
    whole = [entry.artifact for entry in entries if entry.artifact is not None]
    made = [(artifact, _completed(runs.made_from(artifact))) for artifact in whole]
    found = runs.nearest(made, _completed(runs.asked_of(recipe)))
    if found is None:
        return known
    artifact, differing = found
    told = []
    for d in differing:
        if d.kind == "parent":  # by where it lies instead of its digest; None for one that is not made yet
            new = recipe.parents.get(d.key)
            there = None if new is None or new.digest == NOT_MADE else str(new.path)
            old = _place(artifact, d.key) if d.key in artifact.manifest["parents"] else d.old
            d = replace(d, old=old, new=there if new is not None else d.new)
        told.append(d)
    return replace(known, nearest=str(artifact.path), differences=tuple(told))


def _completed(making: Making) -> Making:
    """With the settings that recipes leave out at the value that they had before they were settings."""
    config = {k: {**LATER[k], **part} if k in LATER else part for k, part in making["setting"].items()}
    return {**making, "setting": config}


def _place(artifact: Artifact, role: str) -> str:
    """Where a finished artifact's parent lies; its stage and digest where that is no longer there."""
    parent = artifact.manifest["parents"][role]
    needs = entry_at(artifact.path, artifact.path.parent).needs
    for path, digest in ((need.path, need.digest) for need in needs if need.role == role):
        with suppress(UsageError):
            if path is not None and read_manifest(Path(path)).digest == digest:
                return path
    return f"{parent['stage']} {parent['sha256'][:12]}"
