"""Recordings without noise: a channel that is known far better than another must not hold a fit."""

import numpy as np
import pytest

from gpsim.diagnosis.diagnosis import diagnose
from gpsim.diagnosis.fitting.hypothesis import Hypothesis
from gpsim.diagnosis.fitting.multiple_shooting import fit
from gpsim.diagnosis.selection.acceptance import pays
from gpsim.diagnosis.setup.candidates import candidates
from gpsim.diagnosis.setup.prepare import prepare
from gpsim.simulators import make_simulator

from .truths import mechanical
from .worlds import World, record


@pytest.mark.parametrize("seed", [3, 4])
def test_a_bias_is_found_to_the_digit_though_its_own_channel_does_not_show_it(seed):
    # q_dot says the same whatever the bias is, as the start states follow; all that tells is how far q comes.
    (truth,) = (t for t in mechanical("slider") if (t.family, t.on) == ("sensor_bias", "q_dot"))
    recording = record(truth.world, seed=seed, episodes=6, steps=155, noise=0.0)
    simulator = make_simulator(recording.system)
    known = simulator.defaults(recording.parameters)
    report = diagnose(recording, simulator, known, np.random.default_rng(0)).diagnosis
    assert report.verdict == "named"
    (effect,) = report.effects
    assert (effect.family, effect.on) == ("sensor_bias", "q_dot")
    offset = effect.parameters["offset"]
    assert offset.value == pytest.approx(truth.values["offset"], rel=1e-6)
    assert offset.low <= truth.values["offset"] <= offset.high


@pytest.mark.parametrize(("back", "noise", "times"), [(1.48, 0.0, 1), (1.487, 0.1, 2)])
def test_half_of_a_law_that_was_seldom_asked_for_pays(back, noise, times):
    """A gain that differs by direction, hardly ever backwards: the mean was named, 6758 nats behind, or 87."""
    uneven = World("slider", filters=[lambda u, t, h, m: np.where(u > 0, 1.5, back) * u])
    recording = record(uneven, seed=1, episodes=12, steps=155, noise=noise, hold=60)
    slider = make_simulator("slider")
    known = slider.defaults(recording.parameters)
    problem = prepare(recording, slider, known).everything
    backwards = (problem.windows.actions[..., 0] < 0).any(axis=1)
    some = np.concatenate([np.flatnonzero(~backwards), np.flatnonzero(backwards)[:times]])
    problem = problem.on(problem.windows.take(some))
    offers = {c.family: c for c in candidates(recording, slider, known) if not c.variant}

    def fitted(family, *values):
        law = offers[family]
        hypothesis = Hypothesis().plus(law.term(values), law.declared)
        return fit(problem, hypothesis, problem.windows.measured[:, 0])

    gain, uneven_gain = fitted("actuator_gain", 1.4), fitted("actuator_asymmetry", 1.4, 1.4)
    assert uneven_gain.hypothesis.theta == pytest.approx([1.5, back], rel=1e-3)
    assert pays(problem, uneven_gain, gain)
