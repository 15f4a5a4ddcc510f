"""evaluate: how a corrected simulator does on a recording, beside its base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gpsim.api.corrected import CorrectedSimulator
from gpsim.api.diagnosis import Diagnosis
from gpsim.api.recordings import read_recording
from gpsim.channels import FloatArray
from gpsim.corrected import CorrectedPlant, EffectsPlant, GpCorrection, arrived_inputs
from gpsim.diagnosis import score
from gpsim.errors import UsageError
from gpsim.evaluation import compare, replay, windows_of
from gpsim.recordings import Recording
from gpsim.reports.statistics_text import errors_lines
from gpsim.residuals import OWN_DT, build_residuals, either_wraps
from gpsim.settings import positive
from gpsim.simulators import SimulatorPlant
from gpsim.stages.stage import generator


@dataclass(frozen=True)
class Errors:
    """Root mean square errors of one rate or channel, in `unit`: of the base simulator, and corrected."""

    unit: str
    base: float
    corrected: float


@dataclass(frozen=True)
class Evaluation:
    """Errors by rate one step ahead, and by state channel over rollouts of `horizon_s` seconds; `print` it.

    Attributes:
        one_step: rate: errors of single steps, each from its measured state.
        rollout: channel: errors of rollouts: at their end for named effects, all along for a Gaussian process.
        horizon_s: length of a rollout [s].
        steps: how many single steps were judged.
        rollouts: how many rollouts.
    """

    one_step: Mapping[str, Errors]
    rollout: Mapping[str, Errors]
    horizon_s: float
    steps: int
    rollouts: int

    def __str__(self) -> str:
        rows = [(f"{n}, one step", e.unit, e.base, e.corrected) for n, e in self.one_step.items()]
        rows += [
            (f"{n}, {self.horizon_s:.3g} s", e.unit, e.base, e.corrected) for n, e in self.rollout.items()
        ]
        return "\n".join(errors_lines(rows, self.steps, self.rollouts))


def evaluate(
    corrected: CorrectedSimulator | Diagnosis,
    recording: Recording | str | Path,
    *,
    steps: int = 50,
    rollouts: int = 100,
    seed: int = 0,
) -> Evaluation:
    """Play a recording's actions again in a corrected simulator and in its base, and measure how far they drift.

    All of the recording counts and nothing is fitted: give one that was not learnt from.

    Args:
        corrected: a corrected simulator, or a diagnosis.
        recording: of the same system; a path as for `read_recording`.
        steps: control steps of a rollout of a Gaussian process; those of named effects take the diagnosis's second.
        rollouts: at most so many of them.
        seed: of what is drawn.

    Returns:
        The errors.

    Raises:
        UsageError: recording and simulator do not go together.

    Example:
        >>> import gpsim
        >>> evaluation = gpsim.evaluate(gpsim.Diagnosis.load("found"), "slider.csv")
        >>> evaluation.one_step["q_acc"].corrected < evaluation.one_step["q_acc"].base
        True
    """
    simulator = corrected.corrected() if isinstance(corrected, Diagnosis) else corrected
    if not isinstance(simulator, CorrectedSimulator):
        raise UsageError(
            f"evaluate: expected a corrected simulator or a diagnosis, got {type(corrected).__name__}"
        )
    plant = simulator.plant
    taken = recording if isinstance(recording, Recording) else read_recording(recording, plant.simulator)
    if isinstance(plant, EffectsPlant):
        return _of_effects(plant, taken, seed)
    if abs(taken.dt - plant.dt) > OWN_DT * plant.dt:
        raise UsageError(
            f"evaluate: the recording's step is {taken.dt:g} s, the simulator's {plant.dt:g} s: its Gaussian process "
            "is valid for that step only"
        )
    return _of_process(plant, taken, positive(steps, "steps"), positive(rollouts, "rollouts"), seed)


def _of_effects(plant: EffectsPlant, recording: Recording, seed: int) -> Evaluation:
    """As `gpsim diagnose --score` does: sensors may err, effects remember and go by the clock."""
    with_gp = plant if plant.correction is not None else None
    found = score(recording, plant, with_gp, generator(seed, "score"))

    made = [
        {n: Errors(e.unit, e.before, e.after if e.after_gp is None else e.after_gp) for n, e in part.items()}
        for part in (found.one_step, found.rollout)
    ]
    return Evaluation(made[0], made[1], found.horizon_s, found.steps, found.rollouts)


def _of_process(plant: CorrectedPlant, recording: Recording, steps: int, most: int, seed: int) -> Evaluation:
    """The thesis's first two layers."""
    base = SimulatorPlant(plant.simulator, plant.parameters, plant.integrator, plant.dt)
    one_step, count = _one_step(plant, recording, seed)
    channels = either_wraps(plant.state, recording.state)
    windows = windows_of(recording.episodes, steps, most, dt=recording.dt, state=recording.state)
    errors = [
        compare(replay(one, windows, generator(seed, "evaluate/rollouts")), windows.recorded, channels)["rms"]
        for one in (base, plant)
    ]
    drift = {n: Errors(unit, errors[0][n], errors[1][n]) for n, unit in channels.units.items()}
    horizon = (windows.recorded.shape[1] - 1) * plant.dt
    return Evaluation(one_step, drift, horizon, count, len(windows.states))


def _one_step(plant: CorrectedPlant, recording: Recording, seed: int) -> tuple[dict[str, Errors], int]:
    data = build_residuals(
        recording, plant.simulator, plant.parameters, plant.integrator,
        test_fraction=0.0, rng=generator(seed, "evaluate/order"), learnt_from=False,
    )  # fmt: skip
    assert isinstance(plant.correction, GpCorrection)
    inputs, late = arrived_inputs(plant, data)
    left = data.values - late - plant.correction.predictor.mean(plant.correction.features(inputs))
    before, after = _rms(data.values), _rms(left)
    units = data.rate.units.items()
    return {n: Errors(unit, before[i], after[i]) for i, (n, unit) in enumerate(units)}, len(left)


def _rms(values: FloatArray) -> list[float]:
    """(R,) of (N, R)."""
    return [float(v) for v in np.sqrt(np.mean(values**2, axis=0))]
