"""collect strategy=active, and what sensors make of a recording: noise, lost samples, the first so many transitions."""

import numpy as np
import pytest
from asking import asked

from gpsim.environments import ActiveSettings, Model, as_sensed, collect_actively
from gpsim.errors import UsageError
from gpsim.recordings import Episode, read_recording
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.stages import build_residuals, collect, fit_gp, full_loop
from gpsim.stages.building import target_plant
from gpsim.tasks import Balance

CARTPOLE, DT = make_simulator("cartpole"), 0.02
TINY = (
    "strategy=active", "active.transitions=150", "active.first=40", "active.refit=60", "active.candidates=8",
    "active.horizon=10", "active.n_train=40", "gp.n_train=60", "gp.restarts=0", "gp.max_iterations=20",
)  # fmt: skip


def request(tmp_path, *words):
    return asked(f"runs_dir={tmp_path / 'runs'}", *words)


def test_an_active_recording_has_its_transitions_and_is_fitted(tmp_path):
    wanted = request(tmp_path, *TINY)
    made, _ = collect.STAGE.make(wanted)
    recording = read_recording(made.path)
    assert recording.transition_count == 150
    assert recording.provenance["driver"] == "active"
    again, existed = collect.STAGE.make(wanted)
    assert existed
    assert again.path == made.path
    build_residuals.STAGE.make(wanted)
    fit_gp.STAGE.make(wanted)
    assert "policy" not in made.manifest["parents"]
    jobs = {job.label: job for job in full_loop.plan(wanted, (0,))}
    assert jobs["collect · seed 0"].after == ()


def test_the_limo_is_driven_actively_too(tmp_path):
    words = [word for word in TINY if not word.startswith(("gp.max", "active.trans"))]
    made, _ = collect.STAGE.make(request(tmp_path, "experiment=limo", *words, "active.transitions=80"))
    assert read_recording(made.path).transition_count == 80


class Knows:
    """A process that is unsure of fast carts alone."""

    noise_variances = np.array([1.0])

    def mean_and_variance(self, inputs):
        return np.zeros((len(inputs), 1)), (inputs[:, 1:2] > 0.3) * 100.0


def test_it_drives_to_where_nothing_is_known():
    plant = SimulatorPlant(CARTPOLE, CARTPOLE.defaults(), "euler", DT)
    model = Model(plant, Knows(), lambda inputs: inputs)
    settings = ActiveSettings(transitions=300, first=1, refit=1000, horizon=20, candidates=64, hold=4)
    found = collect_actively(plant, Balance(), lambda episodes: model, settings, np.random.default_rng(0))
    speeds = np.concatenate([episode.states[:, 1] for episode in found])
    assert sum(len(episode) for episode in found) == 300
    assert (speeds > 0.3).mean() > 0.4
    assert (speeds < -0.3).mean() < 0.1


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("strategy=greedy", "strategy: 'greedy' is not one of active"),
        ("active.first=3000", "active: first=3000 are more than transitions=2000"),
        ("active.hold=0", "active: hold must be at least 1"),
        ("collect.transitions=0", "collect.transitions: expected a whole number of at least 1"),
        ("collect.noise=-1", "collect.noise: expected a number of at least 0"),
        ("collect.missing=1", "collect.missing: expected a number in"),
    ],
)
def test_settings_that_nothing_can_be_recorded_with_are_one_line(word, said):
    words = ("strategy=active", word) if word.startswith("active") else (word,)
    with pytest.raises(UsageError) as refused:
        collect.check(asked(*words))
    assert str(refused.value).startswith(said)


def driven():
    rng, plant = np.random.default_rng(0), target_plant(asked().config)
    states = [rng.uniform(-0.05, 0.05, 4)]
    actions = 10.0 * rng.choice([-1.0, 1.0], (400, 1))
    for action in actions:
        states.append(plant.step(states[-1][None], action[None], {}, rng)[0])
    return Episode("0", DT * np.arange(401), np.array(states), actions)


def test_sensors_add_their_noise_and_lose_their_share():
    episode, state = driven(), CARTPOLE.state
    (sensed,), noise = as_sensed([episode], state, 0.05, 0.1, np.random.default_rng(1))
    assert len(sensed.t) == pytest.approx(361, abs=20)
    assert sensed.t[[0, -1]].tolist() == episode.t[[0, -1]].tolist()
    rows = np.rint(sensed.t / DT).astype(int)
    np.testing.assert_array_equal(sensed.actions, episode.actions[rows[:-1]])
    error = (sensed.states - episode.states[rows]).std(axis=0)
    np.testing.assert_allclose(error, 0.05 * episode.states.std(axis=0), rtol=0.15)
    np.testing.assert_allclose(list(noise.values()), 0.05 * episode.states.std(axis=0))
    assert as_sensed([episode], state, 0.0, 0.0, np.random.default_rng(1)) == ((episode,), {})
