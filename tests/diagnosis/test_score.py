"""An existing answer on another recording: what it is worth there, with nothing fitted."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gpsim.cli.main import app
from typer.testing import CliRunner

from gpsim.corrected import EffectsPlant
from gpsim.diagnosis import score
from gpsim.effects import Gate, Term
from gpsim.errors import UsageError
from gpsim.findings import Score
from gpsim.recordings import write_recording
from gpsim.reports.statistics_text import score_lines
from gpsim.simulators import make_simulator

from .test_sight import keeping, without_actions
from .worlds import World, record

DAMPED = World("slider", forces={0: lambda q, v, t: -1.5 * v})
NEW = record(DAMPED, seed=9, episodes=10, steps=150)


def corrected(damping, system="slider", **gate):
    simulator = make_simulator(system)
    on = simulator.coordinates[0].name
    term = Term("viscous_friction", on, {"damping": damping}, Gate(**gate))
    return EffectsPlant(simulator, {"mass": 2.0}, (term,), "fine", 2, 0.02)


def scored(plant, recording=NEW):
    return score(recording, plant, None, np.random.default_rng(0))


def test_a_right_answer_is_as_good_as_the_sensors_and_a_wrong_one_is_told():
    right, wrong = scored(corrected(1.5)), scored(corrected(6.0))
    assert right.rollout["q"].after < 0.1 * right.rollout["q"].before
    assert right.one_step["q_acc"].after < right.one_step["q_acc"].before
    assert wrong.rollout["q"].after > wrong.rollout["q"].before
    assert wrong.rollout["q"].over_before.low > 1.0 > right.rollout["q"].over_before.high
    assert right.transitions == NEW.transition_count  # all of it, though a part says that it is held out
    assert right.rollout["q"].before == pytest.approx(wrong.rollout["q"].before)


def test_what_began_in_the_old_recording_has_begun_in_the_new_one():
    late = scored(corrected(1.5, since=1000.0))
    assert late.rollout["q"].after == pytest.approx(scored(corrected(1.5)).rollout["q"].after)


def test_a_recording_that_shows_a_part_is_judged_on_that():
    found = scored(corrected(1.5), keeping(NEW, "q"))
    assert found.one_step == {}
    assert set(found.rollout) == {"q"}
    assert found.rollout["q"].after < 0.3 * found.rollout["q"].before


def test_another_system_is_refused_in_one_line():
    other = record(World("pendulum"), episodes=4, steps=40)
    with pytest.raises(UsageError, match="simulator slider needs"):
        scored(corrected(1.5), other)


def test_the_table_says_it_shortly_and_the_file_keeps_it():
    found = scored(corrected(1.5))
    again = Score.from_dict(json.loads(json.dumps(found.to_dict())))
    assert again == found
    lines = score_lines(found)
    assert lines[0].startswith("1500 transitions; errors of ")
    assert lines[1].split()[:2] == ["unit", "base"]
    assert [line.split(",")[0] for line in lines[2:5]] == ["q_acc", "q", "q_dot"]
    assert lines[-1] == "no Gaussian process: the diagnosis has none"
    assert max(map(len, lines)) <= 100
    diverged = replace(found, rollout={"q": replace(found.rollout["q"], after=float("nan"))})
    assert "diverged" in "\n".join(score_lines(diverged))
    with pytest.raises(UsageError, match="not a score"):
        Score.from_dict({"schema": "gpsim.diagnosis/2"})


def test_the_command_scores_a_finished_diagnosis(tmp_path: Path):
    for name, recording in (("old", record(DAMPED, seed=1, episodes=5, steps=100)), ("new", NEW)):
        (tmp_path / name).mkdir()
        write_recording(recording, tmp_path / name, "csv")
    run, words = CliRunner().invoke, [f"runs_dir={tmp_path / 'runs'}"]
    only = "diagnose.families.only=[viscous_friction]"
    made = run(app, ["diagnose", str(tmp_path / "old"), "--out", str(tmp_path / "found"), "--cores=1", only])
    assert made.exit_code == 0, made.output
    asked = ["diagnose", "--score", str(tmp_path / "found"), str(tmp_path / "new"), "--cores=1", *words]
    told = run(app, asked)
    assert told.exit_code == 0, told.output
    assert "q, after 1 s" in told.output
    (path,) = (tmp_path / "runs").glob("*/score/v0001/score.json")
    assert json.loads(path.read_text())["schema"] == "gpsim.score/1"
    assert "already there" in run(app, asked).output
    alone = run(app, asked[:3])
    assert isinstance(alone.exception, UsageError)
    assert "needs a RECORDING" in str(alone.exception)


def test_what_was_never_commanded_can_be_scored(tmp_path: Path):
    coasting = record(World("slider", filters=[lambda u, t, h, m: 0 * u]), episodes=4, steps=60)
    assert scored(corrected(0.0), without_actions(coasting)).rollout["q"].over_before.value == pytest.approx(
        1.0
    )
