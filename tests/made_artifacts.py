"""Finished diagnoses on disk that nobody had to wait for: a plant and a result as the stage writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from made_diagnoses import made_diagnosis

from gpsim.artifacts import Artifact, Recipe, Store
from gpsim.corrected import EffectsPlant, describe
from gpsim.diagnosis import Diagnosis
from gpsim.files import write_json
from gpsim.reports.diagnosis_page import page
from gpsim.reports.wording import worded
from gpsim.stages import diagnose


def made_diagnosis_artifact(
    store: Store,
    plant: EffectsPlant,
    recording: Path,
    *,
    found: Diagnosis | None = None,
    out: Path | None = None,
    remember: bool = True,
    **config: Any,
) -> Artifact:
    """An artifact of `diagnose` for the recording's folder; remember: whether it says where that lies."""
    found = worded(found or made_diagnosis())
    task = diagnose.Task(recording, plant.simulator.name)
    settings = {
        "recording": diagnose.digests_of(task), "simulator": plant.simulator.name,
        "simulator_file": None, "episodes": None, "settings": {},
    }  # fmt: skip

    def write(folder: Path) -> dict[str, Any]:
        write_json(folder / "diagnosis.json", found.to_dict())
        write_json(folder / "corrected.json", describe(plant, gp=False))
        text = page(found, {}, plant.simulator.name, [], [], plant.simulator.name)
        (folder / "report.html").write_text(text, encoding="utf-8")
        return {diagnose.RECORDING: str(recording.resolve())} if remember else {}

    return store.publish(Recipe("diagnose", settings | config, {}, {"seed": 0}), write, out=out)
