"""From a recording folder to residuals, a fit and an evaluation: lost rows, angles that wrap, one pace throughout."""

import json
from dataclasses import replace

import numpy as np
import pytest
from gpsim.cli.configuration import resolve

from gpsim.channels import Channels, wrap_angle
from gpsim.errors import UsageError
from gpsim.recordings import Episode, Recording
from gpsim.recordings.files import write_recording
from gpsim.simulators import make_simulator
from gpsim.stages import build_residuals, evaluate, fit_gp
from gpsim.stages.building import target_plant
from gpsim.stages.stage import Request
from gpsim.stages.train_gp_policy import corrected_plant

SMALL = ("gp.n_train=80", "gp.restarts=1", "gp.settle=0", "gp.filter=false", "residuals.test_fraction=0.25")


def request(*words):
    return Request(resolve(list(words), None), words)


def drive(name, start, action, *, true, dt, episodes=4, count=80):
    """Episodes of the simulator `name` with the parameters `true`, under actions (E, K, A) around `action`."""
    simulator, rng = make_simulator(name), np.random.default_rng(0)
    actions = np.array(action) * rng.uniform(-1.0, 1.0, (episodes, count, len(action)))
    states = [np.array(start) * rng.uniform(0.5, 1.0, (episodes, len(start)))]
    for k in range(count):
        states.append(simulator.step(states[-1], actions[:, k], true, np.full(episodes, dt), "euler"))
    parts = tuple(
        Episode(str(i), dt * np.arange(count + 1), np.stack(states, axis=1)[i], actions[i])
        for i in range(episodes)
    )
    return Recording(name, simulator.state, simulator.action, parts, dt, simulator.defaults(), "euler")


def spinning(lost=()):
    """A cart-pole that is a little heavier than believed, its pole turning over; its angle is recorded modulo 2 pi."""
    true = make_simulator("cartpole").defaults() | {"cart_mass": 1.05}
    whole = drive("cartpole", (0.1, 0.1, 1.0, 12.0), (5.0,), true=true, dt=0.02)
    episodes = []
    for episode in whole.episodes:
        states = episode.states.copy()
        states[:, 2] = wrap_angle(states[:, 2])
        kept = np.setdiff1d(np.arange(len(states)), lost)
        episodes.append(Episode(episode.name, episode.t[kept], states[kept], episode.actions[kept[:-1]]))
    state = Channels.of(whole.state.units, wraps=("theta",))
    return replace(whole, state=state, episodes=tuple(episodes))


def on_disk(recording, tmp_path):
    folder = tmp_path / "recording"
    folder.mkdir()
    write_recording(recording, folder)
    return (f"recording={folder}", f"runs_dir={tmp_path / 'runs'}", *SMALL)


def test_what_is_left_out_over_a_gap_is_said(tmp_path):
    asked = request(*on_disk(spinning(lost=(20, 21, 50)), tmp_path))
    made, _ = build_residuals.STAGE.make(asked)
    meta = json.loads((made.path / "residuals.json").read_text())
    assert meta["rows"] == {"training": 3 * 75, "test": 75, "over_a_gap": 8}
    assert build_residuals.notes(made)[0] == (
        "225 training and 75 test transitions; 8 over 1.8 control steps left out, because rows are missing"
    )
    whole = tmp_path / "whole"
    whole.mkdir()
    complete, _ = build_residuals.STAGE.make(request(*on_disk(spinning(), whole)))
    assert build_residuals.notes(complete)[0] == "240 training and 80 test transitions"


def test_what_stood_over_a_gap_is_kept_and_residuals_from_before_are_read(tmp_path):
    recording = spinning(lost=(20, 21, 50))
    made, _ = build_residuals.STAGE.make(request(*on_disk(recording, tmp_path)))
    read = build_residuals.read_residuals(made)
    assert read.over_gaps.after.tolist() == [row + 75 * i for i in range(4) for row in (18, 45)]
    stood = [recording.episodes[i].actions[row] for i in range(4) for row in (19, 47)]
    np.testing.assert_array_equal(read.over_gaps.actions, stood)
    assert read.take(read.test).over_gaps.after.tolist() == [18, 45]
    (made.path / build_residuals.OVER_GAPS).unlink()
    assert build_residuals.read_residuals(made).over_gaps is None


def test_without_lost_rows_residuals_have_the_files_they_had(tmp_path):
    made, _ = build_residuals.STAGE.make(request(*on_disk(spinning(), tmp_path)))
    assert not (made.path / build_residuals.OVER_GAPS).exists()
    assert build_residuals.read_residuals(made).over_gaps is None


def test_a_wrong_dt_is_not_taken_for_another_simulators(tmp_path):
    asked = request(*on_disk(replace(spinning(), dt=0.05), tmp_path))
    with pytest.raises(UsageError, match=r"says dt 0.05 s, but the median step of its t is 0.02 s"):
        build_residuals.STAGE.make(asked)


def test_an_angle_that_wraps_in_the_simulator_does_so_in_fit_and_prediction(tmp_path):
    """A stand-in's yaw runs on while it is recorded: 4.0 and 4.0 - 2 pi are one place."""
    driven = drive("unicycle", (1.0, 1.0, 4.0), (0.5, 1.0), true={}, dt=0.1)
    episodes = tuple(replace(e, actions=0.9 * e.actions + 0.01) for e in driven.episodes)
    recording = replace(driven, episodes=episodes)
    words = ("experiment=limo", *on_disk(recording, tmp_path), "gp.inputs=[yaw,v_cmd,w_cmd]")
    asked = request(*words)
    residuals, _ = build_residuals.STAGE.make(asked)
    read = build_residuals.read_residuals(residuals)
    assert [c.name for c in read.channels if c.wraps] == ["yaw"]
    fitted, _ = fit_gp.STAGE.make(asked)
    correction = corrected_plant(asked.having(prediction="mean"), fitted.path).correction
    rows = fit_gp.rows_of(asked, read)
    inputs, support = correction.features(read.inputs[rows]), correction.predictor
    assert np.abs(inputs[:, 0]).max() <= np.pi < np.abs(read.inputs[rows, 2]).max()
    # What it was fitted to, it gives back: a fit on the yaw as it ran on does not know these places.
    errors = support.mean(inputs) - read.values[rows]
    assert np.abs(errors).max() < 0.2 * np.abs(read.values[rows]).max()


def test_more_rows_than_an_exact_fit_takes_are_refused_with_the_subsample_that_fits(tmp_path, monkeypatch):
    words = (*on_disk(spinning(), tmp_path), "gp.inputs=[x_dot,theta,theta_dot,force]")
    for name in ("gpsim.stages.fit_gp.MOST_ROWS", "gpsim.gp.training_data.MOST_ROWS"):
        monkeypatch.setattr(name, 40)
    build_residuals.STAGE.make(request(*words))
    with pytest.raises(UsageError, match=r"^gp.n_train=80: 80 distinct training inputs") as refused:
        fit_gp.STAGE.make(request(*words))
    assert "set gp.n_train=40 to draw that many with the seed" in str(refused.value)
    fit_gp.STAGE.make(request(*words, "gp.n_train=40"))
    with pytest.raises(UsageError, match="n_train=41: 41"):
        fit_gp.STAGE.make(request(*words, "gp.n_train=41"))


def test_an_angle_that_wraps_in_the_recording_alone_goes_through_the_whole_evaluation(tmp_path):
    words = (
        *on_disk(spinning(lost=(20,)), tmp_path),
        "target=recording",
        "evaluate.policies=[Source,GP-Mean]",
        "evaluate.rollout_steps=30",
        'gp.inputs=[x_dot,theta,theta_dot,force,"sign(theta)"]',
    )
    asked = request(*words)
    for stage in (build_residuals.STAGE, fit_gp.STAGE):
        made, _ = stage.make(asked)
    # The simulated angle runs on, the Gaussian process sees it where it was recorded.
    correction = corrected_plant(asked.having(prediction="mean"), made.path).correction
    turns = np.array([[0.0, 0.1, -2.0, 8.0, 1.0]]) + 2.0 * np.pi * np.eye(5)[2] * np.arange(3)[:, None]
    np.testing.assert_allclose(
        np.ptp(correction.predictor.mean(correction.features(turns)), axis=0), 0.0, atol=1e-9
    )
    evaluated, _ = evaluate.STAGE.make(asked)
    rollout = json.loads((evaluated.path / "evaluation.json").read_text())["rollout"]
    assert (
        rollout["rollouts"] == 1
    )  # 59 steps after the lost row: ten to warm up, thirty, and nineteen too few
    assert rollout["Source"]["rms"]["theta"] < 0.5
    assert rollout["GP-Mean"]["rms"]["theta"] < 0.5


@pytest.mark.parametrize("experiment", ["cartpole", "limo"])
def test_target_and_simulator_have_one_pace(experiment):
    with pytest.raises(UsageError, match=r"target.dt=0.05 is not simulator.dt=.*remove it") as caught:
        target_plant(request(f"experiment={experiment}", "target.dt=0.05").config)
    assert "\n" not in str(caught.value)
    both = request(f"experiment={experiment}", "simulator.dt=0.05")
    assert target_plant(both.config).dt == 0.05
