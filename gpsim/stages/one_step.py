"""Layer 1 with what is on disk: the Gaussian processes' one-step scores on target transitions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gpsim.channels import BoolArray, FloatArray
from gpsim.corrected import Features, GpCorrection, arrived_inputs
from gpsim.evaluation import OneStep
from gpsim.residuals import Residuals
from gpsim.stages import fit_gp, gp_settings, train_gp_policy
from gpsim.stages.stage import Request, generator

EVERY = slice(None)


def scores(
    request: Request, gp_folder: Path, data: Residuals, rows: BoolArray | slice = EVERY
) -> dict[str, Any]:
    """Rate to the scores of mean and sample on `rows` of the transitions; commands arrive from the ones before, too."""
    plant = train_gp_policy.corrected_plant(request, gp_folder)
    correction = plant.correction
    assert isinstance(correction, GpCorrection)
    inputs, late = arrived_inputs(plant, data)
    mean, variance = correction.predictor.mean_and_variance(correction.features(inputs[rows]))
    result = OneStep(
        data.values[rows],
        mean + late[rows],
        variance,
        correction.predictor.noise_variances,
        data.episode[rows],
    )
    rng = generator(request.start_seed, "evaluate/one-step/sample")
    return {
        name: result.scores(i, rng, sample_noise=correction.sample_noise)
        for i, name in enumerate(data.rate.names)
    }


def training_inputs(request: Request, residuals: Residuals) -> FloatArray:
    """(N, D): the GPs' own inputs on the rows that they were conditioned on."""
    return own_inputs(request, residuals)[fit_gp.rows_of(request, residuals)]


def own_inputs(request: Request, data: Residuals) -> FloatArray:
    """(N, D): the GPs' inputs of transitions."""
    return Features.of(gp_settings.input_names(request), data.channels)(data.inputs)
