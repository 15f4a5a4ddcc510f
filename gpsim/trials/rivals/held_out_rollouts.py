"""What a diagnosis is worth on held-out episodes, beside the true model fitted to what it learnt from.

Both are simulated by the same code from what was measured, as `gpsim diagnose --score` does it, and judged a second on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import score
from gpsim.diagnosis.fitting import Hypothesis, fit
from gpsim.diagnosis.setup import Question, candidates, prepare
from gpsim.effects import closed
from gpsim.recordings import HeldOut, Recording
from gpsim.simulators import Simulator
from gpsim.trials.rivals.equivalents import as_hypothesis
from gpsim.trials.worlds import TrueEffect

ITERATIONS, TOLERANCE = 25, 0.02


def rollouts_over_truth(
    recording: Recording,
    simulator: Simulator,
    held_out: Sequence[str],
    truth: Sequence[TrueEffect],
    said: Sequence[TrueEffect],
) -> dict[str, float]:
    """Channel -> error of what was said over that of the true model refitted; empty where nothing can be compared.

    recording: as it was published; held_out: names of the episodes that nothing was learnt from; said: with its values.
    """
    learnt = tuple(e for e in recording.episodes if e.name not in held_out)
    held = tuple(e for e in recording.episodes if e.name in held_out)
    if not learnt or not held:
        return {}
    nothing = HeldOut(share=0.0)
    question = prepare(
        replace(recording, episodes=learnt, held_out=nothing),
        simulator,
        simulator.defaults(recording.parameters),
    )
    problem = question.everything
    offers = candidates(question.recording, problem.simulator, problem.parameters)
    known = {c.identity for c in offers}
    if any((e.family, e.on) not in known for e in (*truth, *said)):
        return {}
    starts = problem.windows.measured[:, 0]
    found = fit(problem, as_hypothesis(truth, offers), starts, iterations=ITERATIONS, tolerance=TOLERANCE)
    judged = replace(recording, episodes=held, held_out=None)
    own, other = (
        score(judged, _plant(question, h, recording.dt), None, np.random.default_rng(0)).rollout
        for h in (found.hypothesis, as_hypothesis(said, offers))
    )
    return {
        name: _ratio(other[name].after, own[name].after)
        for name in own
        if name in other and own[name].after > 0
    }


def _ratio(said: float, own: float) -> float:
    return said / own if math.isfinite(said) else math.inf


def _plant(question: Question, hypothesis: Hypothesis, dt: float) -> EffectsPlant:
    """What is driven: the simulator with these effects."""
    system = closed(question.whole)
    steps = (
        math.ceil(question.everything.substeps / question.thinned) if system is None else system.steps_of(dt)
    )
    return EffectsPlant(
        question.whole,
        dict(question.everything.parameters),
        hypothesis.terms,
        hypothesis.scheme,
        steps,
        dt,
    )
