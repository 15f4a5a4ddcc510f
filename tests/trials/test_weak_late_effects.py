"""Effects that begin late and are slight leave a recording white as a whole; they are looked for all the same."""

import numpy as np
import pytest

from gpsim.diagnosis.diagnosis import diagnose
from gpsim.simulators import make_simulator
from gpsim.trials.concealing import conceal


@pytest.mark.slow
def test_a_spring_that_begins_late_under_heavy_noise_is_named():
    """Trial 341 of the blind test of seed 2027, which missed it: four times a decent sensor's noise, since 38 of 61 s."""
    recording = conceal(2027, 341).recordings[0]
    simulator = make_simulator(recording.system)
    report = diagnose(recording, simulator, recording.parameters, np.random.default_rng(0)).diagnosis
    (effect,) = report.effects
    assert (report.verdict, effect.family, effect.on) == ("named", "spring", "q")
    assert effect.since == pytest.approx(38.1, abs=0.5)
