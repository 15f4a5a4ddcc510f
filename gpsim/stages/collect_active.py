"""collect strategy=active: what is refitted on the way, and how it is configured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gpsim.corrected import CorrectedPlant, Features, GpCorrection
from gpsim.environments import ActiveSettings, Model, collect_actively
from gpsim.errors import UsageError
from gpsim.gp import FitSettings, Predictor, fit_outputs
from gpsim.recordings import Episode
from gpsim.settings import build, choice
from gpsim.stages import gp_settings
from gpsim.stages.building import base_plant, make_task, residuals_of, target_plant
from gpsim.stages.stage import Request, generator

ACTIVE = "active"
ON_THE_WAY = 60  # iterations of a fit


def active(request: Request) -> bool:
    """Whether uncertainty drives; raises UsageError for another word."""
    said = request.config["strategy"]
    return said is not None and choice(said, (ACTIVE,), "strategy") == ACTIVE


def settings_of(request: Request) -> ActiveSettings:
    """How it is driven."""
    return build(ActiveSettings, request.config["active"], "active")


def drive_actively(request: Request) -> tuple[Episode, ...]:
    """Episodes on the stand-in, driven to where the Gaussian processes of `gp` are least sure."""
    settings, task = settings_of(request), make_task(request.config).on_target()
    rng = generator(request.seed, "collect/active")
    return collect_actively(
        target_plant(request.config),
        task,
        lambda episodes: _fitted(request, settings, episodes),
        settings,
        rng,
        request.progress,
    )


def _quick(settings: FitSettings) -> FitSettings:
    """A fit on the way says where to drive next; the one that counts is fit-gp's."""
    return replace(
        settings, restarts=min(settings.restarts, 1), max_iterations=min(settings.max_iterations, ON_THE_WAY)
    )


def _fitted(request: Request, settings: ActiveSettings, episodes: Sequence[Episode]) -> Model:
    """The corrected simulator of what was recorded so far, of a part of it drawn by seed."""
    base = base_plant(request.config)
    residuals = residuals_of(base, episodes, generator(request.seed, "collect/active/order"))
    features = Features.of(gp_settings.input_names(request), residuals.channels)
    rows = residuals.training_rows(settings.n_train)
    try:
        gps = fit_outputs(
            features(residuals.inputs[rows]),
            residuals.values[rows],
            _quick(gp_settings.fit_settings(request)),
            generator(request.seed, "collect/active/fit"),
        )
    except ValueError as error:
        raise UsageError(f"strategy=active: no Gaussian process fits what was recorded ({error})") from error
    predictor = Predictor(gps)
    correction = GpCorrection(predictor, features, "mean", sample_noise=False)
    plant = CorrectedPlant(base.simulator, base.parameters, base.integrator, base.dt, correction)
    return Model(plant, predictor, features)
