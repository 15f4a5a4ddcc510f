"""diagnose: where recording and simulator differ, which physics is missing, and a simulator corrected by it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

from gpsim.artifacts import Recipe, read_artifact
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import Diagnosis
from gpsim.diagnosis.settings import Known, Settings, as_mapping, read_known, read_settings
from gpsim.effects import again, bring, installed, origins, read_effects
from gpsim.errors import UsageError, near_path
from gpsim.files import Json, file_digest, read_object
from gpsim.mjcf import files_digest, in_its_columns, open_simulator, simulator_name
from gpsim.posterior import OLDER, LeftOpen, from_two_files, left_open_from
from gpsim.recordings import Recording, joined, read_recording
from gpsim.residuals import holding_out, read_table
from gpsim.simulators import Simulator, lives_here, source_file
from gpsim.stages.diagnosis_files import POSTERIOR, Question, answer, plant_of, title_of, write_diagnosis
from gpsim.stages.policy_files import read_gp
from gpsim.stages.stage import SOURCES, Request, Stage, blamed, stage_about

FILES = ("recording.yaml", "recording.csv", "recording.parquet")
FORMAT = 1
RECORDING, RECORDINGS = "recording", "recordings"
"""In timings.json: where the recording lay, or several by their names. It is no part of what the diagnosis is, and may
have moved since."""


@dataclass(frozen=True)
class Task:
    """What is to be diagnosed; episodes: the first so many of the recording, None for all.

    test_fraction: the share that is held out elsewhere where the recording does not say; None or 0: nowhere. together:
    several recordings by their names that are judged together, `recording` the first of them. effects: files of
    families that the user brings (FILE.py, FILE.py:Class).
    """

    recording: Path
    simulator: str | None
    episodes: int | None = None
    test_fraction: float | None = None
    together: tuple[tuple[str, Path], ...] = ()
    effects: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        recordings: Mapping[str, Path],
        simulator: str | None,
        episodes: int | None,
        effects: tuple[str, ...] = (),
    ) -> Task:
        """To judge recordings together, by their names; one is judged by itself."""
        several = tuple(recordings.items()) if len(recordings) > 1 else ()
        return cls(next(iter(recordings.values())), simulator, episodes, together=several, effects=effects)

    @property
    def folder(self) -> Path:
        """Where the recording's files lie."""
        return self.recording if self.recording.is_dir() else self.recording.parent

    @property
    def parts(self) -> dict[str, Task]:
        """Of several recordings that are judged together each by itself; none of one."""
        return {name: replace(self, recording=path, together=()) for name, path in self.together}

    def brought(self) -> tuple[str, ...]:
        """The families that this task asks beside the catalogue's: its own, and those of installed packages."""
        return bring([*installed(), *chain.from_iterable(map(read_effects, self.effects))])


def stage_for(task: Task) -> Stage:
    """The stage for one recording and simulator."""
    return stage_about("diagnose", _recipe, _write, task, format=FORMAT, code=SOURCES)


def read_diagnosis(folder: Path) -> Diagnosis:
    """What a finished diagnosis found; raises UsageError where its diagnosis.json is none."""
    path = read_artifact(folder, "diagnose").path / "diagnosis.json"
    return Diagnosis.from_dict(read_object(path), str(path))


def read_left_open(folder: Path) -> LeftOpen:
    """What a finished diagnosis leaves open; raises UsageError where an earlier version left it out."""
    path = read_artifact(folder, "diagnose").path / POSTERIOR
    beside = path.with_name("left_open.json")  # of earlier versions
    content = read_object(path) if path.is_file() else {}
    if content.get("schema") == OLDER and beside.is_file():
        content = from_two_files(content, read_object(beside))
    if not content or content.get("schema") == OLDER:
        raise UsageError(f"{folder}: no {POSTERIOR} of this version; diagnose the recording again")
    return left_open_from(content, str(path))


def why_no_gp(folder: Path) -> str | None:
    """Why a finished diagnosis has no Gaussian process on the remainder; None if it has one."""
    gp = read_diagnosis(folder).remainder.gp
    return None if gp is None else gp.why_not  # earlier versions always had one


def read_corrected(folder: Path, gp: bool = False, simulator: Simulator | None = None) -> EffectsPlant:
    """The corrected simulator of a finished diagnosis, to train in.

    `gp` adds the Gaussian process on the remainder, if the diagnosis has one: see `why_no_gp`. simulator: the base, of
    which the folder knows the name; needed only where it lives in a program alone.
    """
    artifact = read_artifact(folder, "diagnose")
    content = read_object(artifact.path / "corrected.json")
    name = str(content["simulator"])
    if simulator is None and lives_here(name):
        raise UsageError(
            f"{folder}: corrects {name}, which exists only in the Python program that made it: load it there, as "
            "gpsim.Diagnosis.load(DIR, simulator)"
        )
    # A user's own simulator must be the one that was diagnosed: its file may have changed since, or be another's.
    source, diagnosed = source_file(name), artifact.manifest["config"].get("simulator_file")
    missing = source is not None and not source.is_file()  # which open_simulator refuses
    if diagnosed is not None and not missing and files_digest(name) != diagnosed:
        changed = source or f"{name}, or what it includes,"
        raise UsageError(
            f"{artifact.path}: corrects the simulator {name}, but {changed} has changed since: diagnose the recording "
            "again, or restore that file"
        )
    bring(again(content.get("effects", {}), str(folder)))
    process = (lambda channels: read_gp(artifact.path, channels)) if gp else None
    return plant_of(content, simulator or open_simulator(name), process)


def open_recording(task: Task) -> tuple[Recording, Simulator]:
    """The recording and the simulator it is compared with; a bare CSV takes the simulator's channels and defaults."""
    if task.together:  # as one, and the simulator must be the same file for all of them
        opened = {name: open_recording(part) for name, part in task.parts.items()}
        (first, (_, simulator)), *others = opened.items()
        for name, (_, other) in others:
            if files_digest(other.name) != files_digest(simulator.name):
                raise UsageError(
                    f"{first} and {name} are of different models ({simulator.name} and {other.name}): several "
                    "recordings need the same model; name it with --simulator, or use --each"
                )
        return joined([recording for recording, _ in opened.values()], list(opened)), simulator
    path, folder = task.recording, task.folder
    if not path.exists():
        raise UsageError(
            f"{path}: no such recording{near_path(path)}; give a folder made by `gpsim import`, or a CSV with "
            "--simulator"
        )
    if (folder / "recording.yaml").is_file() and (path.is_dir() or path.stem == "recording"):
        recording = read_recording(folder)
        simulator = open_simulator(simulator_name(task.simulator, recording, folder))
        return _first(in_its_columns(recording, simulator), task.episodes), simulator
    if path.is_dir():
        raise UsageError(f"{path}: no recording.yaml; make a recording of raw logs with `gpsim import`")
    if task.simulator is None:
        raise UsageError(f"{path}: a plain table needs --simulator NAME, which defines its columns")
    simulator = open_simulator(task.simulator)
    return _first(in_its_columns(read_table(path, simulator), simulator), task.episodes), simulator


def _first(recording: Recording, episodes: int | None) -> Recording:
    """The first episodes; what is held out of them is decided anew."""
    if episodes is None:
        return recording
    most = len(recording.episodes)
    if isinstance(episodes, bool) or not isinstance(episodes, int) or not 0 < episodes <= most:
        raise UsageError(
            f"diagnose.episodes: expected 1 to {most}, which the recording has, got {episodes!r}"
        )
    return replace(recording, episodes=recording.episodes[:episodes], held_out=None)


def _apart(recording: Recording, task: Task) -> Recording:
    """With as much held out as where the diagnosis is compared with others, if that is something."""
    share = task.test_fraction if task.episodes is None else None
    return holding_out(recording, share) if share else recording


def _recipe(request: Request, task: Task) -> Recipe:
    recording, _ = open_recording(task)
    apart, name = _apart(recording, task), simulator_name(task.simulator, recording, task.folder)
    config: Json = {"recording": digests_of(task)}
    if task.together:
        parts = [{"name": name, "files": digests_of(part)} for name, part in task.parts.items()]
        config = {RECORDINGS: parts}
    config |= {
        "simulator": name,
        "simulator_file": files_digest(name),
        "episodes": task.episodes,
        "settings": settings_of(request),
    }
    if known := _known(request):
        config["known"] = known.as_mapping()
    if own := task.brought():
        config["effects"] = origins(own)
    if apart is not recording and apart.held_out is not None:
        config["held_out_share"] = apart.held_out.share
    return Recipe("diagnose", config, {}, {"seed": request.seed})


def digests_of(task: Task) -> dict[str, str]:
    """The digest of every file of a task's recording."""
    names = FILES if task.recording.is_dir() else ("recording.yaml", task.recording.name)
    paths = {name: task.folder / name for name in names}
    return {name: file_digest(path) for name, path in paths.items() if path.is_file()}


def settings_of(request: Request) -> Json:
    """The thresholds as a recipe holds them."""
    return as_mapping(read_thresholds(request))


def read_thresholds(request: Request) -> Settings:
    """The thresholds of the search and its judgement."""
    given = request.config["diagnose"]
    return read_settings({step: values for step, values in given.items() if step not in BESIDE})


BESIDE = ("episodes", "known", "families")
"""Keys of the configuration's `diagnose` that are no settings of a step."""


def _known(request: Request) -> Known:
    given = request.config["diagnose"]
    return read_known(given.get("known"), given.get("families"))


def _write(request: Request, folder: Path, task: Task) -> Json:
    recording, simulator = open_recording(task)
    recording = _apart(recording, task)
    known = _known(request)
    known = replace(known, also=(*known.also, *task.brought()))
    question = Question(read_thresholds(request), known, request.seed, request.cores, request.progress)
    found = answer(recording, simulator, question)
    with blamed(simulator.name):  # what draws it asks the simulator, too
        write_diagnosis(folder, found, simulator, title_of(recording))
    # For whoever shows it; outside every hash.
    if task.together:
        return {RECORDINGS: {name: str(path.resolve()) for name, path in task.together}}
    return {RECORDING: str(task.recording.resolve())}
