"""export model: the corrected MuJoCo model of a diagnosis, and a wrapper for what MJCF cannot say."""

from __future__ import annotations

from pathlib import Path

from gpsim.artifacts import read_artifact
from gpsim.diagnosis.report import Estimate, NamedEffect
from gpsim.errors import UsageError
from gpsim.files import Json
from gpsim.mjcf import Correction, Exported, MjcfSimulator, export_model
from gpsim.reports.account_effects import claim_name
from gpsim.stages.diagnose import read_corrected, read_diagnosis

DIGITS, STEP = 4, 12
"""Of what is told, and of a control step that was taken from a log's stamps."""


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
    correction = Correction(
        plant.simulator,
        plant.parameters,
        plant.terms,
        float(f"{plant.dt:.{STEP}g}"),
        plant.substeps,
        plant.youngest,
    )
    said = {(e.family, e.place): said_of(e) for e in found.effects}
    source = {
        "diagnosis": str(folder),
        "diagnosis_sha256": artifact.digest,
        "simulator": plant.simulator.name,
        "verdict": found.verdict,
    }
    made = export_model(correction, said, source, out)
    return made, _notes(made, plant.terms == ())


def said_of(effect: NamedEffect) -> str:
    """An effect with its numbers and their intervals, for a comment."""
    numbers = (f"{name} {_estimate(estimate)}" for name, estimate in effect.parameters.items())
    return f"{claim_name(effect.family, effect.place)}: {', '.join(numbers)}"


def _estimate(estimate: Estimate) -> str:
    """A value, its unit, and its 90 % interval."""
    value = f"{estimate.value:.{DIGITS}g} {estimate.unit}".removesuffix(" 1")
    if estimate.low is None or estimate.high is None:
        return value
    return f"{value} ({estimate.low:.{DIGITS}g} to {estimate.high:.{DIGITS}g})"


def _inside(out: Path, folder: Path) -> bool:
    return folder.resolve() in out.resolve().parents


def _notes(made: Exported, nothing: bool) -> list[str]:
    """What was written, and where each effect went."""
    notes = [f"{kind:<8} {path.name}" for kind, path in made.files.items()]
    if nothing:
        notes.append("no effect stands: the model is the base")
    for effect in made.effects:
        there = "; ".join(effect["attributes"]) or "wrapper"
        if effect["where"] == "attribute and wrapper":
            there += "; wrapper"
        reason = f" ({effect['why']})" if effect["why"] else ""
        what = "left out" if effect["where"] == "left out" else there
        notes.append(f"{effect['said']} -> {what}{reason}")
    if made.wrapped:
        notes.append(
            f"the model alone lacks what the wrapper adds: drive it by Robot of {made.files['wrapper'].name}"
        )
    notes.append(f"read back: no number differs by more than {made.difference:.1g} of its field's largest")
    return notes


def told(made: Exported) -> Json:
    """For --json: where each effect went, and how exactly the model comes back."""
    return {"effects": [dict(effect) for effect in made.effects], "largest_difference": made.difference}
