"""diagnose --score: how an existing diagnosis does on another recording; nothing is fitted."""

from __future__ import annotations

from pathlib import Path

from gpsim.artifacts import Artifact, Recipe, read_artifact
from gpsim.diagnosis import score
from gpsim.diagnosis.report import Score
from gpsim.diagnosis.run import Run, cores
from gpsim.files import Json, read_object, write_json
from gpsim.stages import diagnose
from gpsim.stages.code import SOURCES, blamed
from gpsim.stages.stage import Request, Stage, generator

FORMAT = 1
FILE = "score.json"


def stage_for(diagnosis: Path, recording: Path, simulator: str | None = None) -> Stage:
    """The stage for a finished diagnosis and a recording; `simulator` says what the columns of a bare table are."""
    return Stage(
        "score",
        lambda request: _recipe(request, diagnosis, recording, simulator),
        lambda request, recipe, folder: _write(request, diagnosis, recording, simulator, folder),
        format=FORMAT,
        code=SOURCES,
    )


def read_score(folder: Path) -> Score:
    """What a finished score found; raises UsageError where its score.json is none."""
    path = read_artifact(folder, "score").path / FILE
    return Score.from_dict(read_object(path), str(path))


def _task(diagnosis: Artifact, recording: Path, simulator: str | None) -> diagnose.Task:
    """The recording, compared with the simulator that was diagnosed, whatever it calls its own."""
    return diagnose.Task(recording, simulator or str(diagnosis.manifest["config"]["simulator"]))


def _recipe(request: Request, diagnosis: Path, recording: Path, simulator: str | None) -> Recipe:
    found = read_artifact(diagnosis, "diagnose")
    task = _task(found, recording, simulator)
    diagnose.open_recording(task)  # what cannot be read is said before anything is made
    folder = recording if recording.is_dir() else recording.parent
    config: Json = {
        "recording": diagnose.digests_of(task, folder),
        "simulator": task.simulator,
        "settings": diagnose.settings_of(request),
    }
    return Recipe("score", config, {"diagnosis": found}, {"seed": request.seed})


def _write(request: Request, diagnosis: Path, recording: Path, simulator: str | None, folder: Path) -> Json:
    task = _task(read_artifact(diagnosis, "diagnose"), recording, simulator)
    opened, _ = diagnose.open_recording(task)
    corrected = diagnose.read_corrected(diagnosis)
    found = diagnose.read_diagnosis(diagnosis)
    process = found.remainder.gp is None or found.remainder.gp.used
    with_gp = diagnose.read_corrected(diagnosis, gp=True) if process else None
    request.progress(0, 1, "simulating")
    with blamed(corrected.simulator.name), cores(request.cores) as workers:
        run = Run(workers, diagnose.read_thresholds(request))
        made = score(opened, corrected, with_gp, generator(request.seed, "score"), run)
    write_json(folder / FILE, made.to_dict())
    request.progress(1, 1, "done")
    return {}
