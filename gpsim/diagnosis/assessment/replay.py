"""Recorded actions played again in a corrected simulator, whose sensors may err and whose effects may know the time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected import EffectsPlant
from gpsim.diagnosis.data import at
from gpsim.diagnosis.fitting import Hypothesis, Problem, predicted
from gpsim.diagnosis.run import Run
from gpsim.recordings import Recording


def replayed(
    plant: EffectsPlant, recording: Recording, places: Sequence[tuple[int, int]], steps: int
) -> FloatArray:
    """(B, T + 1, S): what the corrected sensors would say over T = steps, from measured states on.

    places: episode and sample at which each of the B rollouts begins; the recording's clock is the one on which the
    plant's onsets and ages are moments. What was commanded before is remembered, sensors are read backwards at the
    start to find the true state. Named effects alone: a Gaussian process beside them is left out.
    """
    run = Run()
    windows = at(recording, places, steps)
    size, nothing = len(plant.state), np.zeros(len(plant.state))
    everywhere = np.ones(size, dtype=np.bool_)
    scale = np.maximum(windows.measured.std(axis=(0, 1)), 1e-9)
    problem = Problem(
        plant.simulator, plant.parameters, plant.dt, windows, everywhere, nothing, ~everywhere, scale,
        plant.substeps, run=run,
    )  # fmt: skip
    hypothesis = Hypothesis(plant.terms, tuple(() for _ in plant.terms), plant.scheme)
    return predicted(problem, windows, hypothesis)
