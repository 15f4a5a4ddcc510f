"""The monitor of a safe deployment: its false stops, what it sees, and who stops a drive first."""

import json
from pathlib import Path

import numpy as np
import pytest
from gpsim.cli.configuration import resolve
from made_diagnoses import made_diagnosis

from gpsim.artifacts import Recipe, Store
from gpsim.corrected import EffectsPlant, describe
from gpsim.effects import Term
from gpsim.errors import UsageError
from gpsim.evaluation import (
    NEVER,
    ChangingPlant,
    Limits,
    Monitor,
    MonitorSettings,
    Usual,
    drive,
    usual_errors,
)
from gpsim.files import write_json
from gpsim.recordings import Episode, Recording
from gpsim.recordings.files import write_recording
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.stages import evaluate_deployed, safety
from gpsim.stages.stage import Request
from gpsim.targets import FrictionCartPole
from gpsim.tasks import Balance

SLIDER, CARTPOLE, DT = make_simulator("slider"), make_simulator("cartpole"), 0.02
PLANT = SimulatorPlant(SLIDER, {"mass": 1.0}, "euler", DT)


def watched(monitor, observed, action):
    """(B,) the first step at which each monitor stops, NEVER where it does not, of observed states (B, K + 1, S)."""
    monitor.begin(observed[:, 0])
    stopped = np.full(len(observed), NEVER)
    for k in range(observed.shape[1] - 1):
        alarm = monitor.observe(action[:, k], observed[:, k + 1])
        stopped[alarm & (stopped == NEVER)] = k
    return stopped


def test_false_stops_are_no_more_than_stated_where_errors_are_as_large_as_may_be():
    """The mean score is exactly `usual`, the least favourable; heavy tails, and each error much like the last."""
    settings, rng = MonitorSettings(false_stops=0.1, minutes=0.2, cap=1e9), np.random.default_rng(0)
    monitor = Monitor(PLANT, Usual(np.ones(2), 1.0, 1), settings, SLIDER.state, rng)
    count, steps = 400, 600
    scores = np.repeat(rng.exponential(1.0, (count, steps)), 1, axis=1)
    monitor.begin(np.zeros((count, 2)))
    stopped = np.zeros(count, dtype=bool)
    for k in range(steps):
        monitor._at[:] = 0.0  # standing still: what is observed is the error
        error = np.sqrt(2.0 * scores[:, k])
        stopped |= monitor.observe(np.zeros((count, 1)), np.column_stack([error, np.zeros(count)]))
    assert stopped.mean() <= 0.1


def test_a_weaker_motor_is_seen_at_once_and_the_same_motor_never():
    rng = np.random.default_rng(1)
    force = np.repeat(rng.choice([-1.0, 1.0], (20, 30, 1)), 10, axis=1)

    def driven(gain):
        state, rows = np.zeros((20, 2)), [np.zeros((20, 2))]
        for k in range(300):
            state = PLANT.step(state, (gain if k >= 150 else 1.0) * force[:, k], {}, rng)
            rows.append(state + 1e-4 * rng.standard_normal(state.shape))
        return np.stack(rows, axis=1)

    episodes = [
        Episode(str(i), DT * np.arange(301), s, f)
        for i, (s, f) in enumerate(zip(driven(1.0), force, strict=True))
    ]
    settings = MonitorSettings()
    usual = usual_errors(PLANT, episodes, SLIDER.state, np.zeros(2), settings, rng)
    assert usual.mean >= settings.margin
    assert usual.steps == 6000
    monitor = Monitor(PLANT, usual, settings, SLIDER.state, rng)
    assert (watched(monitor, driven(1.0), force) == NEVER).all()
    seen = watched(monitor, driven(0.5), force)
    assert ((seen >= 150) & (seen < 180)).all()


def test_noise_that_the_recording_lacks_is_usual():
    rng = np.random.default_rng(2)
    clean = np.zeros((300, 2))
    episode = Episode("0", DT * np.arange(301), np.vstack([clean[:1], clean]), np.zeros((300, 1)))
    noise = np.array([0.01, 0.02])
    settings = MonitorSettings()
    usual = usual_errors(PLANT, [episode], SLIDER.state, noise, settings, rng)
    monitor = Monitor(PLANT, usual, settings, SLIDER.state, rng)
    noisy = noise * rng.standard_normal((50, 500, 2))
    noisy[..., 0] *= 0.9
    assert (watched(monitor, noisy, np.zeros((50, 499, 1))) == NEVER).all()


def test_a_recording_without_two_samples_in_a_row_says_nothing():
    lonely = Episode("0", np.array([0.0, 1.0]), np.zeros((2, 2)), np.zeros((1, 1)))
    with pytest.raises(UsageError, match="no two consecutive samples"):
        usual_errors(PLANT, [lonely], SLIDER.state, np.zeros(2), MonitorSettings(), np.random.default_rng(0))


def balanced(observations):
    """A hand-made policy that keeps the pole up where nothing rubs."""
    x, x_dot, theta, theta_dot = observations.T
    return (theta + 0.3 * theta_dot + 0.02 * x + 0.05 * x_dot > 0).astype(int)


def pole(friction=0.0):
    return FrictionCartPole(CARTPOLE.defaults(), friction, DT)


def cart_monitor(rng):
    plant = SimulatorPlant(CARTPOLE, CARTPOLE.defaults(), "euler", DT)
    return Monitor(plant, Usual(np.full(4, 1e-3), 1.5, 1000), MonitorSettings(), CARTPOLE.state, rng)


def test_a_concealed_change_is_stopped_before_the_limit_and_no_change_is_not():
    rng = np.random.default_rng(3)
    limits = Limits.of({"x": 2.4, "theta": 0.2}, CARTPOLE.state)
    common = {"count": 10, "steps": 200, "endless": False, "rng": rng}
    plain = drive(pole(), Balance(), balanced, cart_monitor(rng), limits, **common)
    assert (plain.stopped == NEVER).all()
    assert (plain.returns > 100).any()
    changing = ChangingPlant(pole(), pole(0.9), 20)
    found = drive(changing, Balance(), balanced, cart_monitor(rng), limits, **common)
    assert ((found.stopped > 20) & (found.stopped < 40)).all()
    assert (found.left == NEVER).all()
    np.testing.assert_array_equal(found.steps, found.stopped)
    on = drive(
        changing,
        Balance(),
        balanced,
        cart_monitor(rng),
        limits,
        **common,
        fallback=lambda o: np.zeros(len(o), int),
    )
    assert (on.steps >= on.stopped).all()
    assert (on.left > on.stopped).all()  # one push in one direction for ever is no good policy


def test_a_drive_without_end_goes_on_from_a_new_start():
    rng = np.random.default_rng(4)
    limits = Limits.of({}, CARTPOLE.state)
    always = lambda observations: np.ones(len(observations), int)  # noqa: E731  # falls within a second
    found = drive(
        pole(), Balance(), always, cart_monitor(rng), limits, count=3, steps=120, endless=True, rng=rng
    )
    assert (found.steps == 120).all()
    assert (found.stopped == NEVER).all()


def found_friction(folder):
    """A diagnosis of the cart's friction, on disk."""
    terms = (Term("coulomb_friction", "x", {"coefficient": 0.9}, variant="coefficient"),)
    plant = EffectsPlant(CARTPOLE, CARTPOLE.defaults(), terms, "euler", 1, DT)

    def write(out: Path):
        write_json(out / "corrected.json", describe(plant, gp=False))
        write_json(out / "diagnosis.json", made_diagnosis().to_dict())
        return {}

    return Store(folder, "").publish(Recipe("diagnose", {}, {}, {}), write, out=folder / "found").path


def drives_of(target, names, folder):
    rng, episodes = np.random.default_rng(5), []
    for name in names:
        states, actions = [rng.uniform(-0.05, 0.05, 4)], 10.0 * rng.choice([-1.0, 1.0], (60, 1))
        for action in actions:
            states.append(target.step(states[-1][None], action[None], {}, rng)[0])
        episodes.append(Episode(name, DT * np.arange(61), np.array(states), actions))
    recording = Recording(
        "cartpole",
        CARTPOLE.state,
        CARTPOLE.action,
        tuple(episodes),
        DT,
        CARTPOLE.defaults(),
        "euler",
        "measured",
        "episode",
    )
    folder.mkdir()
    write_recording(recording, folder)
    return folder


def test_recorded_drives_are_watched_as_they_would_have_been(tmp_path):
    known = drives_of(pole(0.9), ["a", "b", "c"], tmp_path / "known")
    words = [f"diagnosis={found_friction(tmp_path)}", f"recording={known}", "deploy.limits=null"]
    asked = Request(resolve(words, None), tuple(words))
    same = evaluate_deployed.replay(asked, [drives_of(pole(0.9), ["d"], tmp_path / "same")])
    assert same["drives"] == [{"drive": "d", "seconds": pytest.approx(1.2), "stopped_at": None, "why": None}]
    other = evaluate_deployed.replay(asked, [drives_of(pole(0.5), ["e"], tmp_path / "other")])
    assert other["drives"][0]["why"] == "the simulator no longer predicts it"
    assert 0.0 < other["drives"][0]["stopped_at"] < 0.6
    lines = evaluate_deployed.replay_lines(other)
    assert lines[0].startswith("e: stopped after 0.")
    assert lines[1].startswith("1 of 1 drives would have been stopped; stated: a false stop in 10 minutes")
    tight = asked.having(deploy={**asked.config["deploy"], "limits": {"x_dot": 0.1}})
    assert evaluate_deployed.replay(tight, [tmp_path / "same"])["drives"][0]["why"] == "limit"
    assert json.loads(json.dumps(other)) == other


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("+deploy.limits.z=1", "deploy.limits: no channel 'z'; the state has x, x_dot, theta, theta_dot"),
        ("deploy.limits.x=0", "deploy.limits.x: expected a positive number"),
        ("deploy.noise={x: -1}", "deploy.noise.x: expected a number of at least 0"),
        ("+deploy.change.rubbing=1", "deploy.change: the target has no setting 'rubbing'"),
        ("+deploy.change.name=limo", "deploy.change: 'name' cannot change"),
        ("deploy.false_stops=1.5", "deploy: false_stops must be between 0 and 1"),
        ("deploy.runs=0", "deploy.runs: expected a whole number of at least 1"),
        ("deploy.change_at=-1", "deploy.change_at: expected a time of at least 0 s"),
        ("deploy.fallback=nowhere", "nowhere: not an artifact"),
    ],
)
def test_settings_with_which_nothing_can_be_deployed_are_one_line(word, said):
    with pytest.raises(UsageError) as refused:
        safety.check(Request(resolve([word], None), (word,)))
    assert str(refused.value).startswith(said)


@pytest.mark.parametrize("experiment", ["cartpole", "limo", "mujoco"])
def test_every_experiment_has_a_change_that_can_be_concealed(experiment):
    words = (f"experiment={experiment}",)
    asked = Request(resolve(list(words), None), words)
    safety.check(asked)
    changed = safety.changed_target(asked)
    assert changed.state.names == ChangingPlant(changed, changed, 1).state.names
    assert changed != safety.target_plant(asked.config)


def test_a_log_that_is_not_there_is_one_line(tmp_path):
    with pytest.raises(UsageError, match="no such log"):
        evaluate_deployed.replay(Request(resolve([], None)), [tmp_path / "no.bag"])
