"""The problem of a fit: windows to explain, the simulator that should, and what a hypothesis says of such windows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gpsim.channels import BoolArray, FloatArray, difference
from gpsim.diagnosis.data import Windows
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.simulate import Extra, simulate
from gpsim.diagnosis.run import Run
from gpsim.effects import Chain
from gpsim.simulators import Simulator

INVERSION_ITERATIONS = 20  # Newton's steps at most
INVERSION_SETTLED = 1e-9  # of a channel's typical size: a step that small is the last
INVERSION_NUDGE = 1e-3
"""Of a channel's typical size: how far a state is moved to see what its sensor makes of it."""
LEAST_SENSOR_GAIN = 0.01  # a sensor that answers less is taken for one that reads the truth
MOST_SENSOR_GAIN = 100.0  # a sensor that answers more is, too


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
        hypothesis: Hypothesis,
        windows: Windows,
        starts: FloatArray,
        thetas: FloatArray,
        extra: Extra | None = None,
    ) -> FloatArray:
        """(C, W, L + 1, S) what sensors would say for thetas (C, P), starts (C, W, S), in as many steps as needed."""
        chain = hypothesis.chain(self.simulator, self.parameters, self.dt)
        return simulate(self.run, chain, windows, starts, hypothesis.spread, thetas, self.steps(chain), extra)

    def gaps(self, hypothesis: Hypothesis, thetas: FloatArray, starts: FloatArray) -> FloatArray:
        """(C, W, L + 1, S) measured minus simulated, 0 where nothing counts."""
        said = self.simulated(hypothesis, self.windows, starts, thetas)
        error = self.simulator.state_error(self.windows.measured[None], said)
        error[:, ~self.counted] = 0.0
        return error

    def residuals(self, hypothesis: Hypothesis, thetas: FloatArray, starts: FloatArray) -> FloatArray:
        """The same, weighted."""
        return self.gaps(hypothesis, thetas, starts) * self.root_weights


def mean_squares(problem: Problem, residual: FloatArray) -> FloatArray:
    """(S,) of the residual (W, L + 1, S), over its degrees of freedom."""
    return np.asarray((residual**2).sum(axis=(0, 1)) / np.maximum(problem.counts, 1.0))


def predicted(
    problem: Problem,
    windows: Windows,
    hypothesis: Hypothesis,
    extra: Extra | None = None,
    starts: FloatArray | None = None,
) -> FloatArray:
    """(W, L + 1, S) what the sensors would say, from starts (W, S), else the measured ones; `extra` rates are added."""
    begun = true_starts(problem, windows, hypothesis) if starts is None else starts
    return np.asarray(problem.simulated(hypothesis, windows, begun[None], hypothesis.theta[None], extra)[0])


def has_sensors(hypothesis: Hypothesis) -> bool:
    """Whether it says that a sensor reads something else than the true state."""
    return any(term.effect.site == "sensor" for term in hypothesis.terms)


def without_sensors(hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis about what happened, whatever the sensors said of it."""
    return hypothesis.without_all([i for i, t in enumerate(hypothesis.terms) if t.effect.site == "sensor"])


def as_it_was(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> Windows:
    """Single transitions with the true states at both ends, as far as the hypothesis's sensors tell, for measured ones.

    Of a late sensor's first readings in an episode it takes the second to be one of a motion that went on before.
    """
    ends = [true_starts(problem, part, hypothesis) for part in (windows, _next(windows))]
    return replace(windows, measured=np.stack(ends, axis=1))


def _next(windows: Windows) -> Windows:
    """Single transitions that begin where those of `windows` end; what happens in them nobody knows."""
    t = windows.t[:, 1:]

    def later(before: FloatArray, now: FloatArray) -> FloatArray:
        return np.concatenate([before[:, 1:], now], axis=1)

    return replace(
        windows,
        measured=np.repeat(windows.measured[:, 1:], 2, axis=1),
        t=np.concatenate([t, t + np.diff(windows.t, axis=1)], axis=1),
        before_states=later(windows.before_states, windows.measured[:, :1]),
        before_actions=later(windows.before_actions, windows.actions),
        before_t=later(windows.before_t, t),
        fresh=np.zeros_like(windows.fresh),
    )


def true_starts(problem: Problem, windows: Windows, hypothesis: Hypothesis) -> FloatArray:
    """(W, S) true states whose measurement is what was measured: Newton's steps with each sensor's own gain."""
    measured = windows.measured[:, 0]
    if not has_sensors(hypothesis):
        return measured
    first = replace(
        windows,
        measured=windows.measured[:, :2],
        actions=windows.actions[:, :1],
        t=windows.t[:, :2],
        valid=windows.valid[:, :2],
    )

    def said(state: FloatArray) -> FloatArray:
        return predicted(problem, first, hypothesis, starts=state)[:, 0]

    state, gains = measured, _gains(problem, measured, said)
    for _ in range(INVERSION_ITERATIONS):
        change = difference(measured, said(state), problem.simulator.state) / gains
        state = state + change
        if (np.abs(change) < INVERSION_SETTLED * problem.scale).all():
            break
    return state


def _gains(problem: Problem, state: FloatArray, said: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """(W, S) how much more each channel reads where its state is more."""
    channels, before = problem.simulator.state, said(state)
    gains = np.ones_like(state)
    for i, nudge in enumerate(INVERSION_NUDGE * problem.scale):
        moved = np.array(state)
        moved[:, i] += nudge
        gains[:, i] = difference(said(moved), before, channels)[:, i] / nudge
    answers = (gains > LEAST_SENSOR_GAIN) & (gains < MOST_SENSOR_GAIN)
    return np.where(answers, gains, 1.0)
