"""train-gp-policy: the same training as train-source, in the corrected simulator."""

from __future__ import annotations

from pathlib import Path

from gpsim.artifacts import Json, Recipe
from gpsim.corrected import PREDICTIONS, CorrectedPlant
from gpsim.errors import UsageError
from gpsim.settings import choice
from gpsim.stages import fit_gp
from gpsim.stages.building import base_plant
from gpsim.stages.policy_files import read_gp_correction
from gpsim.stages.stage import Request, Stage
from gpsim.stages.train_source import train


def recipe(request: Request) -> Recipe:
    """The base simulator, the GPs and how they are used."""
    prediction = choice(request.config["prediction"], PREDICTIONS, "prediction")
    # What a sample is of does not matter to a mean: the same mean policy serves both settings.
    keys = (
        "simulator",
        "task",
        "policy",
        "prediction",
        *(("sample_noise",) if prediction == "sample" else ()),
    )
    return Recipe(
        "train-gp-policy", request.section(*keys), {"gp": fit_gp.STAGE.need(request)}, {"seed": request.seed}
    )


def write(request: Request, recipe: Recipe, folder: Path) -> Json:
    """Train and write the policy and its learning curve."""
    return train(
        request,
        corrected_plant(request, recipe.parents["gp"].path),
        f"train-gp-policy/{request.config['prediction']}",
        folder,
    )


def corrected_plant(request: Request, gp_folder: Path) -> CorrectedPlant:
    """The base simulator corrected by the GPs, as the request's `prediction` and `sample_noise` say."""
    base = base_plant(request.config)
    prediction = choice(request.config["prediction"], PREDICTIONS, "prediction")
    noise = request.config["sample_noise"]
    if not isinstance(noise, bool):
        raise UsageError(f"sample_noise: expected true or false, got {noise!r}")
    correction = read_gp_correction(gp_folder, base.state + base.action, prediction, noise)  # type: ignore[arg-type]
    return CorrectedPlant(base.simulator, base.parameters, base.integrator, base.dt, correction)


STAGE = Stage(
    "train-gp-policy", "Train a policy in the corrected simulator (prediction=mean|sample).", recipe, write
)
