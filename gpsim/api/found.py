"""What stands behind a Diagnosis: one that was just made, or the folder of an earlier one; both answer the same."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from gpsim.artifacts import Artifact, Recipe, Store, WarningLog, read_artifact
from gpsim.channels import Channels
from gpsim.corrected import EffectsPlant, Features
from gpsim.diagnosis import Diagnosis, Outcome
from gpsim.diagnosis.settings import as_mapping
from gpsim.errors import UsageError
from gpsim.files import Json, canonical, disk_errors, written_whole
from gpsim.gp import Predictor
from gpsim.mjcf import files_digest, open_simulator
from gpsim.posterior import LeftOpen, posterior_of
from gpsim.recordings import Recording
from gpsim.reports.wording import worded
from gpsim.simulators import Simulator
from gpsim.stages import diagnosis_files
from gpsim.stages.diagnose import FORMAT, read_corrected, read_diagnosis, read_left_open
from gpsim.stages.diagnosis_files import Question, write_diagnosis
from gpsim.stages.stage import SOURCES

if TYPE_CHECKING:
    from gpsim.reports.diagnosis_figures import Picture


@dataclass
class Made:
    """A diagnosis that was made in this process."""

    outcome: Outcome
    recording: Recording
    simulator: Simulator
    question: Question
    result: Diagnosis = field(init=False)
    place: str | None = None

    def __post_init__(self) -> None:
        self.result = worded(self.outcome.diagnosis)

    @property
    def name(self) -> str:
        """The base simulator's."""
        return self.simulator.name

    @cached_property
    def pictures(self) -> Mapping[str, Picture]:
        """Those that can be drawn."""
        return diagnosis_files.drawn(self.result, self.outcome, WarningLog())

    @property
    def left_open(self) -> LeftOpen:
        """Of what was found."""
        return posterior_of(self.outcome)

    def corrected(self, gp: bool) -> EffectsPlant:
        """As it is written down and read again."""
        content = diagnosis_files.described(self.outcome, self.result, self.simulator.state)
        return diagnosis_files.plant_of(content, self.simulator, self._process if gp else None)

    def _process(self, channels: Channels) -> tuple[Predictor, Features]:
        """The Gaussian process on what is left; asked only where there is one."""
        corrected = self.outcome.comparison.corrected
        assert corrected is not None
        return corrected.learnt.predictor, Features.of(corrected.learnt.features.items, channels)

    def save(self, folder: Path) -> None:
        """What `gpsim diagnose --out` writes; instead of the recording's files its manifest names its content."""
        config: Json = {
            "recording": {"content": content_digest(self.recording)},
            "simulator": self.name,
            "simulator_file": files_digest(self.name),
            "episodes": None,
            "settings": as_mapping(self.question.settings),
        }
        if self.question.known:
            config["known"] = self.question.known.as_mapping()
        seeds = {"seed": self.question.seed}
        recipe = Recipe("diagnose", config, {}, seeds, format=FORMAT, code=SOURCES)

        def write(temporary: Path) -> None:
            title = diagnosis_files.title_of(self.recording)
            write_diagnosis(temporary, self.outcome, self.simulator, title)

        Store(folder.parent, "").publish(recipe, write, out=folder)


@dataclass
class Kept:
    """A diagnosis in a folder, verified; given: the base simulator, where the folder only knows its name."""

    artifact: Artifact
    given: Simulator | None
    result: Diagnosis

    @classmethod
    def read(cls, folder: Path, given: Simulator | None) -> Kept:
        """Raises UsageError where the folder holds none, or has changed."""
        artifact = read_artifact(folder, "diagnose")
        kept = cls(artifact, given, worded(read_diagnosis(folder)))
        if given is not None and given.name != kept.name:
            raise UsageError(f"{folder}: diagnoses the simulator {kept.name}, got {given.name}")
        return kept

    @property
    def name(self) -> str:
        """The base simulator's."""
        return str(self.artifact.manifest["config"]["simulator"])

    @property
    def place(self) -> str:
        """Where it lies."""
        return str(self.artifact.path)

    @property
    def simulator(self) -> Simulator:
        """The base simulator."""
        return self.given or open_simulator(self.name)

    @cached_property
    def pictures(self) -> Mapping[str, Picture]:
        """Those that were drawn, by the names of their files."""
        from gpsim.reports.diagnosis_figures import Picture

        paths = sorted((self.artifact.path / diagnosis_files.FIGURES).glob("*.png"))
        return {path.stem: Picture(path.stem.replace("_", " "), "", path.read_bytes()) for path in paths}

    @property
    def left_open(self) -> LeftOpen:
        """As it was written down."""
        return read_left_open(self.artifact.path)

    def corrected(self, gp: bool) -> EffectsPlant:
        """As training reads it."""
        return read_corrected(self.artifact.path, gp, self.given)

    def save(self, folder: Path) -> None:
        """A copy."""
        read_artifact(self.artifact.path, "diagnose")
        with disk_errors(folder, "folder"):
            folder.parent.mkdir(parents=True, exist_ok=True)
            with written_whole(folder) as temporary:
                shutil.copytree(self.artifact.path, temporary)


Found = Made | Kept


def content_digest(recording: Recording) -> str:
    """sha256 of what a recording holds, wherever it lies."""
    said = {
        "system": recording.system,
        "parameters": dict(recording.parameters),
        "integrator": recording.integrator,
        "dt": recording.dt,
        "channels": [(c.name, c.unit, c.wraps) for c in recording.state + recording.action],
        "states": len(recording.state),
        "velocities": recording.velocities,
        "clock": recording.clock,
        "noise": dict(recording.noise),
        "held_out": recording.held_out and vars(recording.held_out),
        "episodes": [(e.name, len(e.t)) for e in recording.episodes],
    }
    if len(recording.poses):
        said["poses"] = list(recording.poses.names)
    if recording.sources:
        said["sources"] = [(s.name, s.held_out and vars(s.held_out)) for s in recording.sources]
        said["of"] = [e.source for e in recording.episodes]
    digest = hashlib.sha256(canonical(said))
    for episode in recording.episodes:
        seen = () if episode.poses is None else (episode.poses,)
        for values in (episode.t, episode.states, episode.actions, *seen):
            digest.update(values.astype("<f8").tobytes())
    return digest.hexdigest()
