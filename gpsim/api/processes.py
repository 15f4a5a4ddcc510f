"""fit_gp: what nobody can name, as a Gaussian process on the rates."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from gpsim.api.corrected import CorrectedSimulator
from gpsim.api.recordings import read_recording
from gpsim.api.simulators import folder_of, load_simulator, simulator_of
from gpsim.corrected import PREDICTIONS, CorrectedPlant, Features, GpCorrection, Prediction
from gpsim.errors import UsageError
from gpsim.gp import Bounds, FitSettings, Interval, Predictor, fit_outputs
from gpsim.mjcf import in_its_columns
from gpsim.recordings import Recording
from gpsim.residuals import SHARE, build_residuals
from gpsim.settings import build, choice, positive, whole
from gpsim.simulators import INTEGRATORS, Integrator
from gpsim.stages.stage import generator
from gpsim.trust import trusting

FEWEST = 10
"""Transitions below which nothing is learnt, as in the stage `fit-gp`."""
NOISE_FLOOR = 1e-3
"""Least standard deviation of the noise, as a share of the targets': the default of conf/gp."""


def fit_gp(
    recording: Recording | str | Path,
    simulator: Any = None,
    *,
    inputs: Sequence[str] | None = None,
    n_train: int = 250,
    prediction: Prediction = "mean",
    settings: Mapping[str, Any] | None = None,
    seed: int = 0,
    trust: bool = False,
) -> CorrectedSimulator:
    """Learn what the simulator misses as one Gaussian process a rate, on the residuals of single steps.

    It interpolates what was recorded and names nothing; `diagnose` names, and extrapolates.

    Args:
        recording: a recording, or a path as for `read_recording`. It must hold all of the simulator's channels.
        simulator: as for `load_simulator`; the recording's own `system` by default.
        inputs: channels of state and action, or `sign(...)`, `sin(...)`, `cos(...)` of one; all channels by default.
        n_train: transitions that it is conditioned on, drawn from those that are not held out. Time goes with its cube.
        prediction: `mean` adds the posterior's mean to the rates; `sample` draws from it anew at every step.
        settings: of the fit: `restarts`, `max_iterations`, `minimum_improvement`, `patience`.
        seed: of the choice of transitions and of the fit's starts.
        trust: whether a Python file or module that only the recording names may run.

    Returns:
        The corrected simulator; its `fits` say how each fit went. What a fit warns of is a Python warning.

    Raises:
        UsageError: recording and simulator do not go together, a channel never changes, or too little is left.

    Example:
        >>> import gpsim
        >>> corrected = gpsim.fit_gp("slider.csv", "slider", n_train=60, settings={"restarts": 0})
        >>> corrected.fits["q_acc"].rows
        60
    """
    model = None if simulator is None else load_simulator(simulator)
    taken = recording if isinstance(recording, Recording) else read_recording(recording, model)
    with trusting(trust):
        model = model or simulator_of(taken, folder_of(recording))
    taken = in_its_columns(taken, model)
    parameters = model.defaults(taken.parameters)
    integrator = choice(taken.integrator, INTEGRATORS, "the recording's integrator")
    rng, how = generator(whole(seed, "seed"), "build-residuals/order"), cast(Integrator, integrator)
    residuals = build_residuals(taken, model, parameters, how, test_fraction=SHARE, rng=rng)
    names = list(inputs) if inputs is not None else list(residuals.channels.names)
    features = Features.of(names, residuals.channels)
    rows = residuals.training_rows(positive(n_train, "n_train"))
    if len(rows) < FEWEST:
        raise UsageError(f"only {len(rows)} training transitions: record more, or hold out less")
    bounds = Bounds(noise_std=Interval(NOISE_FLOOR, Bounds().noise_std.high))
    fitting = build(FitSettings, settings or {}, "settings", bounds=bounds)
    inside, rng = features(residuals.inputs[rows]), generator(seed, "fit-gp")
    gps = fit_outputs(inside, residuals.values[rows], fitting, rng)
    fits = {n: gp.report for n, gp in zip(residuals.rate.names, gps, strict=True) if gp.report is not None}
    for name, fit in fits.items():
        for text in fit.warnings:
            warnings.warn(f"{name}: {text}", UserWarning, stacklevel=2)
    choice(prediction, PREDICTIONS, "prediction")
    correction = GpCorrection(Predictor(gps), features, prediction, sample_noise=False)
    return CorrectedSimulator(CorrectedPlant(model, parameters, how, taken.dt, correction), taken, fits)
