"""The diagnosis inside the loop: of the recording that `collect` made, against the base simulator."""

from __future__ import annotations

from pathlib import Path

from gpsim.artifacts import Artifact, Recipe, read_artifact
from gpsim.files import Json
from gpsim.reports.account import account_of
from gpsim.reports.account_effects import told_effects
from gpsim.stages import build_residuals, collect, diagnose
from gpsim.stages.code import SOURCES
from gpsim.stages.stage import Request, Stage


def _stage(request: Request) -> Stage:
    given = request.config["recording"]
    recording = Path(str(given)) if given is not None else collect.STAGE.need(request).path
    episodes = request.config["diagnose"]["episodes"]
    share = build_residuals.check(request)
    return diagnose.stage_for(
        diagnose.Task(recording, str(request.config["simulator"]["name"]), episodes, share)
    )


def _recipe(request: Request) -> Recipe:
    return _stage(request).recipe(request)


def _write(request: Request, recipe: Recipe, folder: Path) -> Json | None:
    return _stage(request).write(request, recipe, folder)


def find_diagnosis(request: Request) -> Artifact:
    """The diagnosis that `diagnosis=` names, or the loop's own."""
    given = request.config["diagnosis"]
    return read_artifact(Path(str(given)), "diagnose") if given is not None else STAGE.need(request)


def sentences(artifact: Artifact) -> list[str]:
    """What was found, in plain words: the verdict, and a sentence each effect that is told."""
    found = diagnose.read_diagnosis(artifact.path)
    headline, _ = told_effects(found)
    return [f"{found.verdict}: {account_of(found).sentence}", *(effect.sentence for effect in headline)]


STAGE = Stage(
    "diagnose",
    _recipe,
    _write,
    sentences,
    format=diagnose.FORMAT,  # a recording is diagnosed once, whoever asks
    code=SOURCES,
)
