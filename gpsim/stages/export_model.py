"""export model: the corrected MuJoCo model of a diagnosis, and a wrapper for what MJCF cannot say."""

from __future__ import annotations

from pathlib import Path

from gpsim.artifacts import read_artifact
from gpsim.errors import UsageError
from gpsim.files import Json
from gpsim.mjcf import Exported, MjcfSimulator, export_model
from gpsim.stages.corrected_model import correction_of, sentences, went
from gpsim.stages.diagnose import read_corrected, read_diagnosis


def export_corrected_model(folder: Path, out: Path) -> tuple[Exported, list[str]]:
    """Write the corrected model of the diagnosis at `folder`; sentences about where each effect went.

    Raises UsageError, for a diagnosis of equations too: they have no model file.
    """
    artifact = read_artifact(folder, "diagnose")
    found, plant = read_diagnosis(folder), read_corrected(folder)
    if not isinstance(plant.simulator, MjcfSimulator):
        raise UsageError(
            f"{folder}: corrects {plant.simulator.name}, which is equations and no MuJoCo model, so there is no XML to "
            f"write; drive it in Python by gpsim.Diagnosis.load({str(folder)!r}).corrected(), or train in it with "
            f"`gpsim train-gp-policy diagnosis={folder}`"
        )
    if _inside(out, artifact.path):
        raise UsageError(f"{out}: lies in the diagnosis, which is never changed; choose an --out beside it")
    correction = correction_of(plant, plant.simulator)
    source = {
        "diagnosis": str(folder),
        "diagnosis_sha256": artifact.digest,
        "simulator": plant.simulator.name,
        "verdict": found.verdict,
    }
    made = export_model(correction, sentences(found.effects), source, out)
    return made, _notes(made, plant.terms == ())


def _inside(out: Path, folder: Path) -> bool:
    return folder.resolve() in out.resolve().parents


def _notes(made: Exported, nothing: bool) -> list[str]:
    """What was written, and where each effect went."""
    notes = [f"{kind:<8} {path.name}" for kind, path in made.files.items()]
    if nothing:
        notes.append("no effect stands: the model is the base")
    notes += [went(effect) for effect in made.effects]
    if made.wrapped:
        notes.append(
            f"the model alone lacks what the wrapper adds: drive it by Robot of {made.files['wrapper'].name}"
        )
    notes.append(f"read back: no number differs by more than {made.difference:.1g} of its field's largest")
    return notes


def told(made: Exported) -> Json:
    """For --json: where each effect went, and how exactly the model comes back."""
    return {"effects": [dict(effect) for effect in made.effects], "largest_difference": made.difference}
