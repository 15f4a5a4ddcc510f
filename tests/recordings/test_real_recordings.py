import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known
from gpsim.reports.wording import worded
from gpsim.simulators import make_simulator
from gpsim.stages.import_log import import_log, read_logs
from gpsim.trials.scoring import contradictions

SETS = {
    "emps": ("emps/DATA_EMPS.mat", 1),
    "physical_cartpole": ("physical_cartpole/balancing", 30),
    "dart_jetracer": ("dart_jetracer/bags/4_sept_random_driving_slow.bag", 1),
    "dart_csv": ("dart_jetracer/csv/90_model_validation_long_term_predictions", 1),
    "f1tenth_track": ("f1tenth_track", 7),
    "simple_pendulum": ("simple_pendulum", 4),
    "cascaded_tanks": ("cascaded_tanks/dataBenchmark.csv", 2),
}
TANKS = Path(__file__).resolve().parents[2] / "docs" / "examples" / "cascaded_tanks.py"


@pytest.mark.parametrize("mapping", SETS)
def test_every_set_imports_by_its_mapping(real, tmp_path, mapping):
    source, episodes = SETS[mapping]
    made = import_log([real / source], tmp_path / "out", mapping)
    assert len(made.recording.episodes) == episodes
    assert made.recording.held_out is not None
    for count in made.report.topics:
        assert count.read == count.kept + sum(count.dropped.values())
    for episode in made.recording.episodes:
        assert np.isfinite(episode.states).all()


def agreement():
    path = Path(__file__).resolve().parents[2] / "benchmarks" / "import_agreement.py"
    spec = importlib.util.spec_from_file_location("import_agreement", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_ros1_bag_its_ros2_twin_and_the_authors_log_agree(real):
    tool, drive = agreement(), real / "dart_jetracer"
    bag, twin = (
        tool.recorded(drive / "bags" / name, "dart_jetracer")
        for name in ("4_sept_random_driving_slow.bag", "slow_ros2_sqlite3")
    )
    assert tool.same(bag, twin)
    log = tool.recorded(drive / "csv" / tool.LOG.name, "dart_csv", "rate=source", "episodes.by=file")
    # 1 m/s times a quarter of a microsecond, the resolution of absolute stamps in double precision
    x, y, yaw = tool.pose_difference(bag, log)
    assert max(x, y) < 1e-6
    assert yaw < 1e-5
    echoed = tool.recorded(drive / "bags" / "slow_ros2_sqlite3", "dart_jetracer", *tool.ECHOED)
    assert (tool.command_agreement(echoed, log) > 0.95).all()


def test_the_cart_pole_falls_the_way_its_mapping_says(real):
    # theta_acc = 3 / (4 l) (g sin theta - x_acc cos theta): the sign of the angle decides the second term's.
    recording, _, _ = read_logs([real / "physical_cartpole" / "balancing"], "physical_cartpole", ["rate=50"])
    rows, accelerations = [], []
    for episode in recording.episodes:
        theta, velocity, x_dot = episode.states[:, 2], episode.states[:, 3], episode.states[:, 1]
        inner = slice(2, -2)
        rows.append(np.stack([np.sin(theta), np.gradient(x_dot, 0.02) * np.cos(theta)], axis=1)[inner])
        accelerations.append(np.gradient(velocity, 0.02)[inner])
    fit = np.linalg.lstsq(np.concatenate(rows), np.concatenate(accelerations), rcond=None)[0]
    assert fit[0] == pytest.approx(37.2, rel=0.2)
    assert fit[1] < -1.0


USUAL = ("coulomb_friction", "viscous_friction", "constant_force")
"""Families that a quick diagnosis of the axis asks about."""


def said(recordings, mapping, run):
    recording, _, _ = read_logs([recordings / SETS[mapping][0]], mapping)
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
@pytest.mark.parametrize("mapping", sorted({*SETS} - {"dart_csv"}))
def test_what_is_reported_is_probable(real, mapping):
    report = said(real, mapping, Run())
    assert contradictions(report) == []
    channels = [e for e in report["fit"]["rollout"].values() if isinstance(e, dict)]
    assert not any(e["black_box"] is None for e in channels) or report["fit"]["black_box"] is None
