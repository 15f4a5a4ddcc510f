"""States from noisy observations with lost samples, and the residuals of them that gp=observations fits."""

import json
from dataclasses import replace

import numpy as np
import pytest
from gpsim.cli.configuration import resolve

from gpsim.corrected import Smoother
from gpsim.environments import as_sensed
from gpsim.errors import UsageError
from gpsim.recordings import Episode, Recording
from gpsim.recordings.files import write_recording
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.stages import build_residuals, fit_gp
from gpsim.stages.stage import Request
from gpsim.targets import FrictionCartPole

CARTPOLE, DT = make_simulator("cartpole"), 0.02
BASE = SimulatorPlant(CARTPOLE, CARTPOLE.defaults(), "euler", DT)
SMALL = (
    "gp=observations",
    "gp.n_train=80",
    "gp.restarts=0",
    "gp.max_iterations=20",
    "residuals.test_fraction=0.25",
)


def rubbing(episodes=4, count=60):
    """A cart that rubs a little, pushed at random; true states."""
    rng, target = np.random.default_rng(0), FrictionCartPole(CARTPOLE.defaults(), 0.1, DT)
    out = []
    for i in range(episodes):
        states, actions = [rng.uniform(-0.05, 0.05, 4)], 10.0 * rng.choice([-1.0, 1.0], (count, 1))
        for action in actions:
            states.append(target.step(states[-1][None], action[None], {}, rng)[0])
        out.append(Episode(str(i), DT * np.arange(count + 1), np.array(states), actions))
    return out


def sensed(noise=0.05, missing=0.15):
    true = rubbing()
    episodes, said = as_sensed(true, CARTPOLE.state, noise, missing, np.random.default_rng(1))
    recording = Recording(
        "cartpole",
        CARTPOLE.state,
        CARTPOLE.action,
        episodes,
        DT,
        CARTPOLE.defaults(),
        "euler",
        "measured",
        "episode",
        said,
    )
    return true, recording


def test_smoothed_states_are_nearer_to_the_truth_and_fill_what_was_lost():
    true, recording = sensed()
    noise = np.array([recording.noise[name] for name in CARTPOLE.state.names])
    smoother = Smoother(BASE, None, noise, np.array([1.0, 1.0]), np.array([10.0]))
    for truth, seen in zip(true, recording.episodes, strict=True):
        found, known = smoother(seen)
        assert len(found) == len(truth) == len(known)
        np.testing.assert_allclose(found.t, truth.t, atol=1e-12)
        np.testing.assert_array_equal(found.actions[known], truth.actions[known])
        assert known.sum() == len(seen)
        rows = np.rint(seen.t / DT).astype(int)
        error = np.sqrt(((found.states - truth.states)[rows] ** 2).mean(axis=0))
        assert (error < 0.8 * noise).all()


def on_disk(recording, tmp_path, *words):
    folder = tmp_path / "recording"
    folder.mkdir()
    write_recording(recording, folder)
    words = (f"recording={folder}", f"runs_dir={tmp_path / 'runs'}", *SMALL, *words)
    return Request(resolve(list(words), None), words)


def test_residuals_of_observations_have_more_rows_and_less_noise(tmp_path):
    _, recording = sensed()
    asked = on_disk(recording, tmp_path)
    build_residuals.STAGE.make(asked)
    made, _ = fit_gp.STAGE.make(asked)
    report = json.loads((made.path / "fit.json").read_text())
    assert report["rows"] == 80
    settings = fit_gp.observations_of(asked)
    assert settings is not None
    found = fit_gp.observed(asked, settings)
    raw = build_residuals.read_residuals(build_residuals.STAGE.need(asked))
    assert len(found.t) > len(raw.t)
    assert (found.values.std(axis=0) < 0.7 * raw.values.std(axis=0)).all()
    assert found.test.any()
    ranks = np.sort(found.order[found.order >= 0])
    np.testing.assert_array_equal(ranks, np.arange(len(ranks)))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "gp.observations: the noise of x is unknown"),
        (("gp.filter=true",), "gp.observations: it estimates states without the command filter"),
        (("gp.observations.rounds=0",), "gp.observations: rounds must be at least 1"),
        (("gp.observations=3",), "gp.observations: expected settings"),
        (("gp.observations.noise={x: 0}",), "gp.observations: the noise of x is unknown"),
    ],
)
def test_observations_that_nothing_can_be_made_of_are_one_line(tmp_path, words, said):
    _, recording = sensed()
    asked = on_disk(replace(recording, noise={}), tmp_path, *words)
    build_residuals.STAGE.make(asked)
    with pytest.raises(UsageError) as refused:
        fit_gp.STAGE.make(asked)
    assert str(refused.value).startswith(said)
