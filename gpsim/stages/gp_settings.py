"""The configuration section `gp`: what the processes see, how they are fitted, and states from observations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import Features, GpCorrection, Smoother
from gpsim.errors import UsageError
from gpsim.gp import Bounds, ChainSettings, FitSettings, Interval, Predictor, fit_outputs
from gpsim.recordings import Recording, read_recording
from gpsim.residuals import Residuals, build_residuals
from gpsim.settings import build, number, positive, texts, truth, whole
from gpsim.simulators import SimulatorPlant
from gpsim.stages import build_residuals as residual_stage
from gpsim.stages.building import base_plant
from gpsim.stages.stage import Request, generator

OF_THE_STAGE = ("n_train", "inputs", "settle", "filter", "chain", "observations")
"""Settings of `gp` that say what is fitted, not how."""


def check(request: Request) -> None:
    """Raise UsageError for settings that no fit can have."""
    section = request.config["gp"]
    truth(section.get("filter", False), "gp.filter")
    count_of(request), settle_of(request)
    chain, settings = chain_of(request), fit_settings(request)
    if chain is not None:
        try:
            chain.of_slow(settings), chain.of_fast(settings)
        except ValueError as error:
            raise UsageError(f"gp.chain: {error}") from error
    base = base_plant(request.config)
    Features.of(input_names(request), base.state + base.action)


def input_names(request: Request) -> list[str]:
    """The names of the Gaussian processes' inputs, as configured."""
    return texts(request.config["gp"]["inputs"], "gp.inputs")


def fit_settings(request: Request) -> FitSettings:
    """How the Gaussian processes are fitted, as configured."""
    section = request.config["gp"]
    rest = {key: value for key, value in section.items() if key not in OF_THE_STAGE}
    floor = rest.pop("noise_floor", Bounds().noise_std.low)
    try:
        bounds = Bounds(noise_std=Interval(number(floor, "gp.noise_floor"), Bounds().noise_std.high))
    except ValueError as error:
        raise UsageError(f"gp.noise_floor: {error}") from error
    return build(FitSettings, rest, "gp", bounds=bounds)


def chain_of(request: Request) -> ChainSettings | None:
    """How a slow and a fast process share the residual; None: there is one."""
    section = request.config["gp"].get("chain")
    if section is None:
        return None
    if not isinstance(section, Mapping):
        raise UsageError(f"gp.chain: expected settings, as {{least_slow: 1.0}}, or null, got {section!r}")
    return build(ChainSettings, section, "gp.chain")


def settle_of(request: Request) -> int:
    """Control steps that an action must have stood for its row to count."""
    return whole(request.config["gp"].get("settle", 0), "gp.settle")


def count_of(request: Request) -> int:
    """Transitions that the Gaussian processes are conditioned on."""
    return positive(request.config["gp"]["n_train"], "gp.n_train")


LEAST = 0.05  # of the residual's spread: so much the rates may be off at the least


@dataclass(frozen=True)
class ObservationSettings:
    """noise: channel -> standard deviation of an observation, None: what the recording says; rounds: see `observed`."""

    noise: Mapping[str, float] | None = None
    rounds: int = 3

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise ValueError(f"rounds must be at least 1, got {self.rounds}")


def observations_of(request: Request) -> ObservationSettings | None:
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
    noise = _noise_of(recording, settings.noise)
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


def _noise_of(recording: Recording, given: Mapping[str, Any] | None) -> FloatArray:
    """(S,): of every channel; raises UsageError for one of which nobody says it."""
    named = dict(recording.noise) if given is None else given
    for name in recording.state.names:
        if name not in named or not number(named[name], f"gp.observations.noise.{name}") > 0.0:
            raise UsageError(
                f"gp.observations: nobody says how noisy {name} is; give its standard deviation under noise in "
                f"recording.yaml, or of every channel as gp.observations.noise={{{name}: 0.001, ...}}"
            )
    return np.array([float(named[name]) for name in recording.state.names])
