"""What is reported of a real machine is what is probable: verdict, odds, probabilities and sizes agree."""

import json
from pathlib import Path

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known
from gpsim.reports.wording import worded
from gpsim.simulators import make_simulator
from gpsim.stages.import_log import read_logs
from gpsim.trials.contradictions import contradictions

TANKS = Path(__file__).resolve().parents[2] / "docs" / "examples" / "cascaded_tanks.py"
SETS = {
    "emps": "emps/DATA_EMPS.mat",
    "cascaded_tanks": "cascaded_tanks/dataBenchmark.csv",
    "simple_pendulum": "simple_pendulum",
    "physical_cartpole": "physical_cartpole/balancing",
    "dart_jetracer": "dart_jetracer/bags/4_sept_random_driving_slow.bag",
    "f1tenth_track": "f1tenth_track",
}
USUAL = ("coulomb_friction", "viscous_friction", "constant_force")
"""Families that a quick diagnosis of the axis asks about."""


def said(recordings, mapping, run):
    recording, _, _ = read_logs([recordings / SETS[mapping]], mapping)
    simulator = make_simulator(f"{TANKS}:CascadedTanks" if mapping == "cascaded_tanks" else recording.system)
    parameters = simulator.defaults(recording.parameters)
    found = diagnose(recording, simulator, parameters, np.random.default_rng(0), run=run).diagnosis
    return json.loads(json.dumps(worded(found).to_dict()))


def test_what_a_quick_diagnosis_reports_is_probable(real):
    """Of the axis three laws explain 99.97 %, and a Gaussian process beside them takes three quarters off the rest."""
    report = said(real, "emps", Run(known=Known(only=USUAL)))
    assert contradictions(report) == []
    assert report["verdict"] == "named"
    assert "black box" not in report["doubts"]  # of the twentieth that would count it takes nothing


@pytest.mark.slow
@pytest.mark.parametrize("mapping", SETS)
def test_what_is_reported_is_probable(real, mapping):
    report = said(real, mapping, Run())
    assert contradictions(report) == []
    channels = [e for e in report["fit"]["rollout"].values() if isinstance(e, dict)]
    assert not any(e["black_box"] is None for e in channels) or report["fit"]["black_box"] is None
