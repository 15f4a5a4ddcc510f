"""build-residuals: what happened minus what the simulator predicts, as rates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from gpsim.artifacts import MANIFEST, Artifact, Recipe, read_artifact
from gpsim.channels import Channels
from gpsim.errors import UsageError
from gpsim.files import Json, file_digest, read_object, write_json
from gpsim.recordings import LONGEST_STEP, OverGaps, Recording, read_recording
from gpsim.residuals import Residuals, build_residuals, check_clock, check_match, from_table, to_table
from gpsim.settings import number
from gpsim.simulators import SimulatorPlant
from gpsim.stages import collect
from gpsim.stages.building import base_plant
from gpsim.stages.stage import Request, Stage, generator

OVER_GAPS = "over_gaps.parquet"
SAME_DT = 0.02  # relative difference of the control step that a jittering clock may show


def recipe(request: Request) -> Recipe:
    """The base simulator and the recording: the loop's own, or the folder that `recording=` names."""
    check(request)
    config = request.section("simulator", "residuals")
    given = request.config["recording"]
    if given is None:
        return Recipe(
            "build-residuals", config, {"recording": collect.STAGE.need(request)}, {"seed": request.seed}
        )
    folder = Path(str(given))
    if not folder.is_dir():
        raise UsageError(
            f"recording={folder}: no such folder; give a recording folder made by `gpsim import`"
        )
    if (folder / MANIFEST).is_file():
        return Recipe("build-residuals", config, {"recording": read_artifact(folder)}, {"seed": request.seed})
    digests = {path.name: file_digest(path) for path in sorted(folder.glob("recording.*"))}
    return Recipe("build-residuals", {**config, "recording": digests}, {}, {"seed": request.seed})


def check(request: Request) -> float:
    """The share of the episodes that is held out; raises UsageError for one that is none."""
    fraction = request.config["residuals"]["test_fraction"]
    if not 0 <= number(fraction, "residuals.test_fraction") < 1:
        raise UsageError(f"residuals.test_fraction: expected a number in [0, 1), got {fraction!r}")
    return float(fraction)


def recording_folder(request: Request) -> Path:
    """Where the recording lies: the loop's own, or the folder that `recording=` names."""
    given = request.config["recording"]
    return collect.STAGE.need(request).path if given is None else Path(str(given))


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Write residuals.parquet and residuals.json; over_gaps.parquet where rows are lost."""
    source = recipe.parents["recording"].path if recipe.parents else Path(str(request.config["recording"]))
    recording, base = read_recording(source), base_plant(request.config)
    check_clock(recording)  # first: a wrong dt would be taken for another simulator's
    check_same(recording, base)
    residuals = build_residuals(
        recording,
        base.simulator,
        base.parameters,
        base.integrator,
        test_fraction=check(request),
        rng=generator(request.seed, "build-residuals/order"),
    )
    to_table(residuals).to_parquet(folder / "residuals.parquet", index=False)
    if residuals.over_gaps is not None:
        residuals.over_gaps.to_table(base.action).to_parquet(folder / OVER_GAPS, index=False)
    write_json(folder / "residuals.json", _summary(residuals, recording.transition_count))
    return {}


def check_same(recording: Recording, base: SimulatorPlant) -> None:
    """The recording's simulator must be the experiment's: policies, GPs and effects correct one and the same."""
    check_match(recording, base.simulator)
    wanted = other_settings(base, recording.dt, recording.parameters, recording.integrator)
    if wanted:
        raise UsageError(
            "the recording is compared with another simulator than this experiment's: choose "
            + " ".join(wanted)
            + ", or import it with the time step and parameters of this one (collect.changes=[...])"
        )


def other_settings(
    base: SimulatorPlant, dt: float, parameters: Mapping[str, float], integrator: str | None = None
) -> list[str]:
    """KEY=VALUE of every setting that would make the experiment's simulator `base` step as it is said here."""
    wanted = [] if abs(dt - base.dt) <= SAME_DT * base.dt else [f"simulator.dt={dt:g}"]
    wanted += [f"simulator.integrator={integrator}"] if integrator not in (None, base.integrator) else []
    return wanted + [
        f"simulator.parameters.{name}={value:g}"
        for name, value in parameters.items()
        if not math.isclose(value, base.parameters.get(name, math.nan), rel_tol=1e-9)
    ]


def read_residuals(artifact: Artifact) -> Residuals:
    """The residuals of an artifact of this stage."""
    meta = read_object(artifact.path / "residuals.json")
    table = pd.read_parquet(artifact.path / "residuals.parquet")
    channels = Channels.of(meta["channels"], wraps=meta.get("wraps", ()))
    lost = artifact.path / OVER_GAPS  # neither there without a gap, nor in artifacts of before
    over_gaps = OverGaps.from_table(pd.read_parquet(lost)) if lost.is_file() else None
    return from_table(table, channels, Channels.of(meta["rates"]), over_gaps)


def _summary(residuals: Residuals, recorded: int) -> dict[str, Any]:
    """residuals.json; recorded: how many transitions the recording has."""
    train, test = residuals.values[~residuals.test], residuals.values[residuals.test]
    wraps = [channel.name for channel in residuals.channels if channel.wraps]
    left_out = recorded - len(residuals.t)
    return {
        "channels": residuals.channels.units,
        **({"wraps": wraps} if wraps else {}),
        "rates": residuals.rate.units,
        "rows": {"training": len(train), "test": len(test), **({"over_a_gap": left_out} if left_out else {})},
        "residual_std": {name: float(train[:, i].std()) for i, name in enumerate(residuals.rate.names)},
        "measured_std": {
            name: float(residuals.measured[~residuals.test, i].std())
            for i, name in enumerate(residuals.rate.names)
        },
    }


def notes(artifact: Artifact) -> list[str]:
    """How much is left, rate by rate."""
    meta = read_object(artifact.path / "residuals.json")
    rows = meta["rows"]
    lost = rows.get("over_a_gap", 0)
    left_out = (
        f"; {lost} over {LONGEST_STEP:g} control steps left out, because rows are missing" if lost else ""
    )
    return [f"{rows['training']} training and {rows['test']} test transitions{left_out}"] + [
        f"{name}: residual {meta['residual_std'][name]:.3g} {unit}, measured {meta['measured_std'][name]:.3g} (std)"
        for name, unit in meta["rates"].items()
    ]


STAGE = Stage(
    "build-residuals",
    recipe,
    write,
    notes,
    format=2,  # 2: what was commanded over gaps is kept
)
