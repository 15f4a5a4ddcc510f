"""A Gaussian process as one function an episode: what is not known of a machine does not change from step to step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gpsim.channels import FloatArray
from gpsim.corrected.features import Features
from gpsim.gp import DrawnFunctions
from gpsim.simulators import Memory


@dataclass(frozen=True)
class FunctionCorrection:
    """Adds to the rates one of a few functions that were drawn from the posterior; every episode keeps its own."""

    functions: DrawnFunctions
    features: Features

    def begin(self, count: int, rng: np.random.Generator) -> Memory:
        """Which function each episode has."""
        return {"function": rng.integers(0, self.functions.count, count).astype(float)}

    def rates(
        self, state: FloatArray, action: FloatArray, memory: Memory, rng: np.random.Generator
    ) -> FloatArray:
        """(B, R) correction of the rates."""
        return self.functions(self.features(np.concatenate((state, action), axis=1)), memory["function"])
