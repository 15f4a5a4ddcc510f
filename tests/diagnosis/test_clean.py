"""Recordings without noise: a channel that is known far better than another must not hold a fit."""

import numpy as np
import pytest

from gpsim.diagnosis.diagnosis import diagnose
from gpsim.simulators import make_simulator

from .truths import mechanical
from .worlds import record


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
