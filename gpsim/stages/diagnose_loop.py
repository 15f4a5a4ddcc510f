"""The diagnosis inside the loop: of the recording that `collect` made, against the base simulator."""

from __future__ import annotations

from pathlib import Path

from gpsim.artifacts import Artifact, Recipe, read_artifact
from gpsim.diagnosis import score
from gpsim.diagnosis.run import Run
from gpsim.files import Json, read_object, write_json
from gpsim.findings import Score
from gpsim.reports.account import account_of
from gpsim.reports.account_effects import told_effects
from gpsim.stages import build_residuals, collect, diagnose
from gpsim.stages.stage import SOURCES, Request, Stage, blamed, generator, stage_about


def _stage(request: Request) -> Stage:
    given = request.config["recording"]
    recording = Path(str(given)) if given is not None else collect.STAGE.need(request).path
    episodes = request.config["diagnose"]["episodes"]
    share = build_residuals.check(request)
    return diagnose.stage_for(
        diagnose.Task(recording, str(request.config["simulator"]["name"]), episodes, share)
    )


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
    lambda request: _stage(request).recipe(request),
    lambda request, recipe, folder: _stage(request).write(request, recipe, folder),
    sentences,
    format=diagnose.FORMAT,  # a recording is diagnosed once, whoever asks
    code=SOURCES,
)


SCORE_FORMAT = 1
FILE = "score.json"


def score_stage(diagnosis: Path, recording: Path, simulator: str | None = None) -> Stage:
    """The stage for a finished diagnosis and a recording; `simulator` says what the columns of a bare table are."""
    about = (diagnosis, recording, simulator)
    return stage_about("score", _score_recipe, _score_write, *about, format=SCORE_FORMAT, code=SOURCES)


def read_score(folder: Path) -> Score:
    """What a finished score found; raises UsageError where its score.json is none."""
    path = read_artifact(folder, "score").path / FILE
    return Score.from_dict(read_object(path), str(path))


def _task(diagnosis: Artifact, recording: Path, simulator: str | None) -> diagnose.Task:
    """The recording, compared with the simulator that was diagnosed, whatever it calls its own."""
    return diagnose.Task(recording, simulator or str(diagnosis.manifest["config"]["simulator"]))


def _score_recipe(request: Request, diagnosis: Path, recording: Path, simulator: str | None) -> Recipe:
    found = read_artifact(diagnosis, "diagnose")
    task = _task(found, recording, simulator)
    diagnose.open_recording(task)  # what cannot be read is said before anything is made
    config: Json = {
        "recording": diagnose.digests_of(task),
        "simulator": task.simulator,
        "settings": diagnose.settings_of(request),
    }
    return Recipe("score", config, {"diagnosis": found}, {"seed": request.seed})


def _score_write(
    request: Request, folder: Path, diagnosis: Path, recording: Path, simulator: str | None
) -> Json:
    task = _task(read_artifact(diagnosis, "diagnose"), recording, simulator)
    opened, _ = diagnose.open_recording(task)
    corrected = diagnose.read_corrected(diagnosis)
    found = diagnose.read_diagnosis(diagnosis)
    process = found.remainder.gp is None or found.remainder.gp.used
    with_gp = diagnose.read_corrected(diagnosis, gp=True) if process else None
    request.progress(0, 1, "simulating")
    with blamed(corrected.simulator.name):
        run = Run(diagnose.read_thresholds(request), threads=request.cores)
        made = score(opened, corrected, with_gp, generator(request.seed, "score"), run)
    write_json(folder / FILE, made.to_dict())
    request.progress(1, 1, "done")
    return {}
