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
from gpsim.settings import share
from gpsim.simulators import SimulatorPlant
from gpsim.stages import collect
from gpsim.stages.building import base_plant
from gpsim.stages.stage import Request, Stage, generator

OVER_GAPS = "over_gaps.parquet"
SAME_DT = 0.02  # relative difference of the control step that a jittering clock may show


def recipe(request: Request) -> Recipe:
    """The base simulator and the recording: the loop's own, or the folder that `recording=` names."""
    check(request)
    config, parents = request.section("simulator", "residuals"), {}
    given = request.config["recording"]
    folder = Path(str(given))
    if given is None:
        parents["recording"] = collect.STAGE.need(request)
    elif not folder.is_dir():
        raise UsageError(
            f"recording={folder}: no such folder; give a recording folder made by `gpsim import`"
        )
    elif (folder / MANIFEST).is_file():
        parents["recording"] = read_artifact(folder)
    else:
        config["recording"] = {path.name: file_digest(path) for path in sorted(folder.glob("recording.*"))}
    return Recipe("build-residuals", config, parents, {"seed": request.seed})


def check(request: Request) -> float:
    """The share of the episodes that is held out; raises UsageError for one that is none."""
    return share(request.config["residuals"]["test_fraction"], "residuals.test_fraction")


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
    residuals = subtracted(request, recording, base)
    to_table(residuals).to_parquet(folder / "residuals.parquet", index=False)
    if residuals.over_gaps is not None:
        residuals.over_gaps.to_table(base.action).to_parquet(folder / OVER_GAPS, index=False)
    write_json(folder / "residuals.json", _summary(residuals, recording.transition_count))
    return {}


def subtracted(request: Request, recording: Recording, base: SimulatorPlant) -> Residuals:
    """What happened minus what the base predicts, as much held out as the settings say."""
    rng = generator(request.seed, "build-residuals/order")
    model = (base.simulator, base.parameters, base.integrator)
    return build_residuals(recording, *model, test_fraction=check(request), rng=rng)


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
    train = ~residuals.test
    # Column by column: all at once, the last digits are others.
    spread, measured = (
        {name: float(values[train, i].std()) for i, name in enumerate(residuals.rate.names)}
        for values in (residuals.values, residuals.measured)
    )
    wraps = [channel.name for channel in residuals.channels if channel.wraps]
    left_out = recorded - len(residuals.t)
    return {
        "channels": residuals.channels.units,
        **({"wraps": wraps} if wraps else {}),
        "rates": residuals.rate.units,
        "rows": {
            "training": int(train.sum()),
            "test": int(residuals.test.sum()),
            **({"over_a_gap": left_out} if left_out else {}),
        },
        "residual_std": spread,
        "measured_std": measured,
    }


def notes(artifact: Artifact) -> list[str]:
    """How much is left, rate by rate."""
    meta = read_object(artifact.path / "residuals.json")
    rows = meta["rows"]
    lines = [f"{rows['training']} training and {rows['test']} test transitions"]
    if lost := rows.get("over_a_gap", 0):
        lines[0] += f"; {lost} over {LONGEST_STEP:g} control steps left out, because rows are missing"
    return lines + [
        f"{name}: residual {meta['residual_std'][name]:.3g} {unit}, measured {meta['measured_std'][name]:.3g} (std)"
        for name, unit in meta["rates"].items()
    ]


STAGE = Stage("build-residuals", recipe, write, notes, format=2)
