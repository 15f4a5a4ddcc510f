"""Fits in worker processes: the same results, whatever their number, and with a user's own system too."""

from pathlib import Path

import numpy as np
import pytest

from gpsim.diagnosis.hypothesis import Hypothesis
from gpsim.diagnosis.preparing import prepare
from gpsim.diagnosis.workers import Order, cores, fit_all
from gpsim.recordings import Episode, Recording
from gpsim.simulators import make_simulator

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "cascaded_tanks.py"


@pytest.mark.parametrize("reference", ["slider", "user"])
def test_two_processes_fit_what_one_does(reference):
    rng = np.random.default_rng(0)
    if reference == "user":
        simulator, count, dt = make_simulator(f"{EXAMPLE}:CascadedTanks"), 2, 4.0
    else:
        simulator, count, dt = make_simulator("slider"), 2, 0.02
    episodes = tuple(
        Episode(str(i), dt * np.arange(101), 3 + rng.normal(size=(101, count)), 2 + rng.normal(size=(100, 1)))
        for i in range(5)
    )
    recording = Recording(
        simulator.name, simulator.state, simulator.action, episodes, dt, simulator.defaults(), "euler"
    )
    problem = prepare(recording, simulator, simulator.defaults()).searched
    orders = [Order(Hypothesis(scheme=s), problem.windows.measured[:, 0], 3) for s in ("fine", "euler")]
    alone = fit_all(problem, orders)
    with cores(2):
        together = fit_all(problem, orders)
    for one, two in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.residuals, two.residuals)
        assert one.objective == two.objective
