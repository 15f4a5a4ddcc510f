"""gp=observations: residuals of states that were estimated from noisy, partly lost observations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import Features, GpCorrection, Smoother
from gpsim.errors import UsageError
from gpsim.gp import Predictor, fit_outputs
from gpsim.recordings import Recording, read_recording
from gpsim.residuals import Residuals, build_residuals
from gpsim.settings import build, number
from gpsim.simulators import SimulatorPlant
from gpsim.stages import build_residuals as residual_stage
from gpsim.stages.building import base_plant
from gpsim.stages.gp_settings import count_of, fit_settings, input_names
from gpsim.stages.stage import Request, generator

LEAST = 0.05  # of the residual's spread: so much the rates may be off at the least


@dataclass(frozen=True)
class ObservationSettings:
    """noise: channel -> standard deviation of an observation, None: what the recording says; rounds: see `observed`."""

    noise: Mapping[str, float] | None = None
    rounds: int = 3

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise ValueError(f"rounds must be at least 1, got {self.rounds}")


def settings_of(request: Request) -> ObservationSettings | None:
    """How states are estimated; None: they are taken as they were recorded."""
    section = request.config["gp"].get("observations")
    if section is None:
        return None
    if not isinstance(section, Mapping):
        raise UsageError(f"gp.observations: expected settings, as {{rounds: 3}}, or null, got {section!r}")
    if request.config["gp"].get("filter"):
        raise UsageError(
            "gp.observations: states are estimated without a filter of the commands: set gp.filter=false"
        )
    return build(ObservationSettings, section, "gp.observations")


def observed(request: Request, settings: ObservationSettings) -> Residuals:
    """Residuals of smoothed states, of transitions whose command is known.

    In the first round the base simulator says how states may follow each other, then the one that is corrected by the
    Gaussian processes of the round before.
    """
    recording, base = read_recording(residual_stage.recording_folder(request)), base_plant(request.config)
    noise = _noise(recording, settings.noise)
    spread, correction = _spread(request, recording, base, noise), None
    swing = np.concatenate([episode.actions for episode in recording.episodes]).std(axis=0)
    least = LEAST * spread
    for turn in range(settings.rounds):
        residuals = _smoothed(request, recording, base, Smoother(base, correction, noise, spread, swing))
        request.progress(turn + 1, settings.rounds, "states from observations")
        if turn + 1 < settings.rounds:
            correction, spread = _learnt(request, residuals)
            spread = np.maximum(spread, least)
    return residuals


def _smoothed(request: Request, recording: Recording, base: SimulatorPlant, smoother: Smoother) -> Residuals:
    parts = [smoother(episode) for episode in recording.episodes]
    whole = replace(recording, episodes=tuple(episode for episode, _ in parts))
    if not np.isfinite(np.concatenate([e.states for e in whole.episodes])).all():
        raise UsageError(
            "gp.observations: the simulator runs away along the recording: no states can be estimated"
        )
    found = _residuals(request, whole, base).take(np.concatenate([known for _, known in parts]))
    order = np.full(len(found.order), -1, dtype=np.int64)
    training = np.flatnonzero(found.order >= 0)
    order[training[np.argsort(found.order[training])]] = np.arange(training.size)
    return replace(found, order=order)


def _residuals(request: Request, recording: Recording, base: SimulatorPlant) -> Residuals:
    return build_residuals(
        recording,
        base.simulator,
        base.parameters,
        base.integrator,
        test_fraction=residual_stage.check(request),
        rng=generator(request.seed, "build-residuals/order"),
    )


def _learnt(request: Request, residuals: Residuals) -> tuple[GpCorrection, FloatArray]:
    """What the residuals say of the rates, and how far (R,) they may still be off."""
    features = Features.of(input_names(request), residuals.channels)
    rows = residuals.training_rows(count_of(request))
    inputs = features(residuals.inputs[rows])
    rng = generator(request.seed, "fit-gp/observations")
    predictor = Predictor(fit_outputs(inputs, residuals.values[rows], fit_settings(request), rng))
    _, variance = predictor.mean_and_variance(inputs)
    return GpCorrection(predictor, features, "mean", sample_noise=False), np.sqrt(
        variance.mean(axis=0) + predictor.noise_variances
    )


def _spread(request: Request, recording: Recording, base: SimulatorPlant, noise: FloatArray) -> FloatArray:
    """(R,): the spread of the residuals less what the noise makes of it, which as much noise once more shows."""
    rng = generator(request.seed, "fit-gp/noise")
    noisier = replace(
        recording,
        episodes=tuple(
            replace(e, states=e.states + noise * rng.standard_normal(e.states.shape))
            for e in recording.episodes
        ),
    )
    values, again = (_residuals(request, part, base).values for part in (recording, noisier))
    total = values.var(axis=0)
    return np.asarray(
        np.sqrt(np.maximum(total - np.maximum(again.var(axis=0) - total, 0.0), LEAST * total) + 1e-300)
    )


def _noise(recording: Recording, given: Mapping[str, Any] | None) -> FloatArray:
    """(S,): of every channel; raises UsageError for one of which nobody says it."""
    named = dict(recording.noise) if given is None else given
    for name in recording.state.names:
        if name not in named or not number(named[name], f"gp.observations.noise.{name}") > 0.0:
            raise UsageError(
                f"gp.observations: nobody says how noisy {name} is; give its standard deviation under noise in "
                f"recording.yaml, or of every channel as gp.observations.noise={{{name}: 0.001, ...}}"
            )
    return np.array([float(named[name]) for name in recording.state.names])
