"""The documented example of a user's own system: the cascaded tanks, with a pump that is weaker than believed."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from gpsim.cli.main import app
from typer.testing import CliRunner

from gpsim.channels import Channels
from gpsim.diagnosis import diagnose
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import Known
from gpsim.diagnosis.setup import prepare
from gpsim.errors import UsageError
from gpsim.recordings import Episode, Recording
from gpsim.recordings.files import to_frame, write_recording
from gpsim.reports.diagnosis_text import where
from gpsim.residuals import build_residuals, check_rates
from gpsim.simulators import make_simulator
from gpsim.stages.diagnose import Task, open_recording, read_corrected
from gpsim.trust import trusting

pytestmark = pytest.mark.usefixtures("own_files")

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "cascaded_tanks.py"
REFERENCE = f"{EXAMPLE}:CascadedTanks"
FEW = "diagnose.families.only=[actuator_gain,actuator_lag]"


@cache
def drive(noise: float = 0.01) -> Recording:
    """Both levels, under a pump of 80 % of its size."""
    tanks = make_simulator(REFERENCE)
    rng, episodes = np.random.default_rng(0), []
    for i in range(5):
        level, states, pumps = rng.uniform(3.0, 6.0, 2), [], []
        for k in range(151):
            pump = rng.uniform(1.0, 5.0) if k % 10 == 0 else pumps[-1]
            states.append(level + rng.normal(size=2) * noise)
            pumps.append(pump)
            for _ in range(80):  # 4 s in steps of 50 ms
                out = 0.05 * np.sqrt(np.maximum(level, 0))
                level = level + 0.05 * np.array([0.05 * 0.8 * pump - out[0], out[0] - out[1]])
        episodes.append(
            Episode(str(i), 4.0 * np.arange(151), np.array(states), np.array(pumps[:150])[:, None])
        )
    known = {"upper": noise, "lower": noise}
    return Recording(
        tanks.name, tanks.state, tanks.action, tuple(episodes), 4.0, tanks.defaults(), noise=known
    )


def without_upper(recording: Recording) -> Recording:
    """What is left when nobody measures the upper tank."""
    episodes = tuple(replace(e, states=e.states[:, 1:]) for e in recording.episodes)
    return replace(recording, state=Channels.of({"lower": "V"}), episodes=episodes, noise={"lower": 0.01})


def few() -> Run:
    """A run that asks what a pump may do, and what its parameters may be, and nothing else."""
    return Run(known=Known(only=("actuator_gain", "actuator_bias", "actuator_lag", "parameter_offset")))


def weak_pump(report) -> list[float]:
    """The sizes that the leading explanation or one of its rivals gives the pump."""
    options = [report.effects, *(a.effects for a in report.alternatives)]
    named = {(e.family, e.on): e.parameters for effects in options for e in effects if len(effects) == 1}
    gains = [p["gain"].value for key, p in named.items() if key == ("actuator_gain", "pump")]
    return gains + [p["ratio"].value for key, p in named.items() if key == ("parameter_offset", "inflow")]


@pytest.mark.slow
def test_a_weak_pump_of_the_cascaded_tanks_is_found():
    tanks = make_simulator(REFERENCE)
    report = diagnose(drive(), tanks, tanks.defaults(), np.random.default_rng(0), run=few()).diagnosis
    found = weak_pump(report)
    assert found
    np.testing.assert_allclose(found, 0.8, atol=0.02)


@pytest.mark.slow
def test_the_command_diagnoses_it_when_nobody_measures_the_upper_tank(tmp_path):
    (tmp_path / "log").mkdir()
    write_recording(without_upper(drive()), tmp_path / "log", "csv")
    out = tmp_path / "out"
    result = CliRunner().invoke(
        app, ["diagnose", str(tmp_path / "log"), "--simulator", REFERENCE, "--out", str(out), FEW]
    )
    assert result.exit_code == 0, result.output
    assert "Not measured, but estimated by each model: upper" in " ".join(result.output.split())
    plant, rng = read_corrected(out, gp=True), np.random.default_rng(0)
    state = plant.step(np.full((3, 2), 4.0), np.full((3, 1), 2.0), plant.begin(3, rng), rng)
    assert state.shape == (3, 2)
    assert np.isfinite(state).all()


@pytest.fixture(scope="module")
def blind():
    with trusting():
        tanks = make_simulator(REFERENCE)
        recording = without_upper(drive())
        return diagnose(recording, tanks, tanks.defaults(), np.random.default_rng(0), run=few())


def test_what_a_hidden_state_does_to_the_report(blind):
    report = blind.diagnosis
    found = weak_pump(report)
    assert found
    np.testing.assert_allclose(found, 0.8, atol=0.05)
    assert report.not_measured == ("upper",)
    assert set(report.fit.one_step) == {"lower_rate"}
    assert set(report.fit.rollout.channels) == {"lower"}
    errors = report.fit.rollout.channels["lower"]
    assert errors.after < 0.5 * errors.before
    assert not any(
        e.on == "upper" and e.site == "sensor"
        for effects in [report.effects, *(a.effects for a in report.alternatives)]
        for e in effects
    )
    assert "Not measured, but estimated by each model: upper" in where(report)


def test_the_windows_say_what_the_hidden_state_was(blind):
    truth = drive(noise=0.0)
    estimated = blind.judgement.leader.starts[:, 0]
    windows = blind.question.everything.windows
    actual = [
        np.interp(windows.t[i, 0], truth.episodes[e].t, truth.episodes[e].states[:, 0])
        for i, e in enumerate(windows.episode)
    ]
    assert np.median(np.abs(estimated - actual)) < 0.3  # levels lie between 1 and 9


def test_a_channel_without_a_guess_must_be_measured(tmp_path):
    source = re.sub(r"    start = .*\n", "", EXAMPLE.read_text())
    (tmp_path / "tanks.py").write_text(source)
    tanks = make_simulator(f"{tmp_path / 'tanks.py'}:CascadedTanks")
    with pytest.raises(UsageError, match=r'needs \(upper \[V\], lower \[V\]\).*start = \{"upper": VALUE\}$'):
        prepare(without_upper(drive()), tanks, tanks.defaults())


def test_slow_systems_take_no_more_substeps_than_they_need():
    tanks = make_simulator(REFERENCE)
    question = prepare(drive(), tanks, tanks.defaults())
    assert question.everything.substeps <= 2


TANK = """
import numpy as np

class Tank:
    state = {"level": "m"}
    action = {"pump": "V"}
    parameters = {"outflow": ("m^0.5/s", 0.1, 0.0, 10.0)}

    def rates(self, state, action, p):
        return {"level": action["pump"] - p["outflow"] * np.sqrt(state["level"])}
"""


def test_a_root_of_a_noisy_level_is_refused_with_its_row(tmp_path):
    """One row of a thousand is below zero: it is an extreme one, and looked at."""
    (tmp_path / "tank.py").write_text(TANK)
    tank, rng = make_simulator(f"{tmp_path / 'tank.py'}:Tank"), np.random.default_rng(0)
    levels = rng.uniform(0.5, 1.0, (2, 501, 1))
    levels[1, 123] = -0.01
    episodes = tuple(
        Episode(name, 0.1 * np.arange(501), states, rng.uniform(0.0, 1.0, (500, 1)))
        for name, states in zip(("first", "second"), levels, strict=True)
    )
    recording = Recording(tank.name, tank.state, tank.action, episodes, 0.1, tank.defaults())
    write_recording(recording, tmp_path, "csv")
    result = CliRunner().invoke(
        app, ["diagnose", str(tmp_path), "--simulator", tank.name, "--out", str(tmp_path / "out")]
    )
    assert isinstance(result.exception, UsageError)
    said = str(result.exception)
    assert "level_rate is not finite (nan)" in said
    assert "episode second, row 123 (level=-0.01, pump=" in said
    assert "np.sqrt(np.maximum(x, 0.0))" in said
    assert "tank.py" in said
    assert "\n" not in said
    with pytest.raises(UsageError, match="episode second, row 123"):
        build_residuals(recording, tank, tank.defaults(), "euler", test_fraction=0.5, rng=rng)
    check_rates(replace(recording, episodes=episodes[:1]), tank, tank.defaults())


def test_a_bare_table_is_compared_with_the_classs_own_integrator(tmp_path):
    source = EXAMPLE.read_text(encoding="utf-8").replace(
        'action = {"pump": "V"}', 'action = {"pump": "V"}\n    integrator = "rk4"'
    )
    (tmp_path / "tanks.py").write_text(source)
    (tmp_path / "wrong.py").write_text(source.replace("rk4", "rk5"))
    table = to_frame(drive()).drop(columns="upper")
    table.to_csv(tmp_path / "log.csv", index=False)
    recording, _ = open_recording(Task(tmp_path / "log.csv", f"{tmp_path}/tanks.py:CascadedTanks", None))
    assert recording.integrator == "rk4"
    recording, _ = open_recording(Task(tmp_path / "log.csv", REFERENCE, None))
    assert recording.integrator == "euler"
    with pytest.raises(UsageError, match="'integrator' must be one of euler, semi_implicit, rk4, got 'rk5'"):
        make_simulator(f"{tmp_path}/wrong.py:CascadedTanks")
