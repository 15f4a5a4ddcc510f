"""The problem of a fit: windows to explain, the simulator that should, and the likelihood of what is left over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gpsim.channels import BoolArray, FloatArray
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting.actuation import Spread
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.rollout import Extra
from gpsim.diagnosis.fitting.simulate import simulate
from gpsim.diagnosis.run import Run
from gpsim.effects import Chain
from gpsim.simulators import Simulator


@dataclass(frozen=True)
class Problem:
    """Windows to explain.

    observed: (S,) which channels were measured; floor: (S,) the least standard deviation of what a perfect hypothesis
    leaves over (known noise, numerical error); stated: (S,) whether the recording says how noisy a channel is;
    scale: (S,) typical size of each channel; substeps: of a transition where the scheme is fine; base_steps: the base
    simulator's own (more where a fast clock was thinned); run: what the diagnosis carries along. Of a simulator that
    owns its integration: slope_steps: of a transition where only differences count (then by `slope_simulator`), 0: as
    many as always; dry_steps: coordinate -> times as many substeps where dry friction acts on it.
    """

    simulator: Simulator
    parameters: Mapping[str, float]
    dt: float
    windows: Windows
    observed: BoolArray
    floor: FloatArray
    stated: BoolArray
    scale: FloatArray
    substeps: int
    base_steps: int = 1
    run: Run = field(default_factory=Run)
    slope_steps: int = 0
    slope_simulator: Simulator | None = None
    dry_steps: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def counts(self) -> FloatArray:
        """(S,) degrees of freedom of each observed channel's residual, the start states taken off."""
        spent = len(self.windows) * len(self.simulator.state) / max(int(self.observed.sum()), 1)
        samples = self.counted.sum(axis=(0, 1)).astype(np.float64)
        return np.where(self.observed, np.maximum(samples - spent, 1.0), 0.0)

    @cached_property
    def counted(self) -> BoolArray:
        """(W, L + 1, S) the samples that count: recorded, of what was observed, not left out as a fact of the log."""
        counted = self.windows.valid[:, :, None] & self.observed
        return counted if self.windows.weights is None else counted & (self.windows.weights > 0)

    @cached_property
    def root_weights(self) -> FloatArray | BoolArray:
        """(W, L + 1, S) what a residual is multiplied by, so that its square counts as much as its sample should.

        All hypotheses have the same: their likelihoods, of residuals so weighted, can be compared.
        """
        weights = self.windows.weights
        return self.counted if weights is None else np.sqrt(weights) * self.counted

    @property
    def slopes(self) -> Problem:
        """The same question where only differences between simulations count, which coarser steps tell as well."""
        if not self.slope_steps:
            return replace(self, dry_steps={}) if self.dry_steps else self
        by, few = self.slope_simulator or self.simulator, self.slope_steps
        return replace(self, simulator=by, substeps=few, slope_steps=0, slope_simulator=None, dry_steps={})

    def on(self, windows: Windows) -> Problem:
        """The same question to other windows."""
        return replace(self, windows=windows)

    def steps(self, chain: Chain) -> int:
        """Steps of a transition."""
        if chain.closed is not None:
            return self.substeps * max((self.dry_steps.get(on, 1) for on in chain.rubbing), default=1)
        return self.substeps * chain.refinement if chain.scheme == "fine" else self.base_steps

    def simulated(
        self,
        chain: Chain,
        windows: Windows,
        starts: FloatArray,
        spread: Spread,
        thetas: FloatArray,
        extra: Extra | None = None,
    ) -> FloatArray:
        """`simulate` in the steps that the chain calls for here."""
        return simulate(self.run, chain, windows, starts, spread, thetas, self.steps(chain), extra)

    def residuals(self, hypothesis: Hypothesis, thetas: FloatArray, starts: FloatArray) -> FloatArray:
        """(C, W, L + 1, S) measured minus simulated for thetas (C, P), starts (C, W, S), weighted.

        0 where nothing counts.
        """
        chain = hypothesis.chain(self.simulator, self.parameters, self.dt)
        said = self.simulated(chain, self.windows, starts, hypothesis.spread, thetas)
        residual = self.simulator.gap(self.windows.measured[None], said)
        residual *= self.root_weights
        return residual


def mean_squares(problem: Problem, residual: FloatArray) -> FloatArray:
    """(S,) of the residual (W, L + 1, S), over its degrees of freedom."""
    return np.asarray((residual**2).sum(axis=(0, 1)) / np.maximum(problem.counts, 1.0))
