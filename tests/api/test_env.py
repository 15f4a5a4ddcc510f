"""Environments: Gymnasium's checker, tasks by name and by functions, and stable-baselines3."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import gpsim
from gpsim.api.environment import cartpole_env
from gpsim.errors import UsageError
from gpsim.tasks import Balance


def centre(state, action, next_state):
    return -abs(next_state["q"])


def checked(env):
    """By Gymnasium; that a state has no bounds is what it warns of, of its own CartPole too."""
    with pytest.warns(UserWarning, match="infinity"):
        check_env(env, skip_render_check=True)
    return env


def test_a_reward_of_ones_own(made):
    env = checked(gpsim.make_env(made.diagnosis, reward=centre, max_steps=7))
    starts = made.recording.transitions().states
    observation, _ = env.reset(seed=3)
    assert (np.abs(starts - observation).max(axis=1) < 1e-6).any()
    np.testing.assert_array_equal(observation, env.reset(seed=3)[0])
    ends = []
    for _ in range(7):
        before = env.state
        observation, reward, terminated, truncated, _ = env.step(np.array([1.0], dtype=np.float32))
        assert reward == -abs(env.state[0])
        ends.append((terminated, truncated))
    assert ends == [(False, False)] * 6 + [(False, True)]
    most = made.recording.transitions().actions.max()
    expected = made.diagnosis.corrected().step(before, [most])
    np.testing.assert_allclose(env.state, expected)


def test_what_the_functions_are_given(made):
    seen = []

    def reward(state, action, next_state):
        seen.append((state, action, next_state))
        return 1

    env = gpsim.make_env(
        made.diagnosis,
        reward=reward,
        terminated=lambda state: state["q"] > 0.5,
        starts=[[0.4, 5.0]],
        actions={"force": (-3.0, 5.0)},
    )
    assert env.reset(seed=0)[0].tolist() == pytest.approx([0.4, 5.0])
    *_, terminated, truncated, _ = env.step(np.array([0.0]))
    assert (terminated, truncated) == (False, False)
    state, action, after = seen[0]
    assert state == {"q": 0.4, "q_dot": 5.0}
    assert action == {"force": 1.0}
    assert after["q"] == pytest.approx(0.5, abs=0.01)
    *_, terminated, truncated, _ = env.step(np.array([9.0]))
    assert seen[-1][1] == {"force": 5.0}
    assert (terminated, truncated) == (True, False)
    observation, _ = env.reset(options={"states": [0.1, 0.2]})
    assert observation.tolist() == pytest.approx([0.1, 0.2])


def test_a_batch_asks_for_numbers_or_for_arrays(made):
    def rewards(state, action, next_state):
        return -np.abs(next_state["q"])

    slow = gpsim.make_env(made.diagnosis, reward=centre, terminated=lambda s: s["q"] > 9, count=3)
    fast = gpsim.make_env(
        made.diagnosis, reward=rewards, terminated=lambda s: s["q"] > 9, count=3, vectorised=True
    )
    actions = np.array([[0.5], [-0.5], [0.0]])
    for env in (slow, fast):
        assert isinstance(env, gymnasium.vector.VectorEnv)
        env.reset(seed=1)
    first, second = slow.step(actions), fast.step(actions)
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])
    assert first[1].shape == (3,)


def test_a_diagnosis_from_disk_needs_to_be_told_where_to_begin(here):
    with pytest.raises(UsageError, match=r'say what the policy may do: actions=\{"force": \(low, high\)\}'):
        gpsim.make_env("found", reward=centre)
    with pytest.raises(UsageError, match="give the start states: starts="):
        gpsim.make_env("found", reward=centre, actions={"force": (-1, 1)})
    told = gpsim.Diagnosis.load("found", recording="slider.csv")
    for env in (
        gpsim.make_env(told, reward=centre),
        gpsim.make_env("found", reward=centre, actions={"force": (-1, 1)}, starts=told.recording),
        gymnasium.make(
            "gpsim/Corrected-v0",
            diagnosis="found",
            reward=centre,
            actions={"force": (-1, 1)},
            starts=[[0, 0]],
        ),
    ):
        assert env.reset(seed=0)[0].shape == (2,)


def test_a_state_that_nobody_measured_is_guessed(made, log):
    recording = gpsim.recording_from_frame(log, {"q": "m", "force": "N"}, "slider")
    env = gpsim.make_env(made.diagnosis, reward=centre, starts=recording)
    speeds = [env.reset(seed=seed)[0][1] for seed in range(20)]
    assert np.std(speeds) > 0.1


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({}, "name a task (balance, goal), or give reward=function(state, action, next_state)"),
        ({"task": "juggle"}, "task: 'juggle' is not one of balance, goal"),
        ({"task": "balance"}, "the task is of another system: its state is (x [m], x_dot [m/s], theta [rad]"),
        ({"task": Balance()}, "the task is of another system"),
        ({"task": "balance", "reward": centre}, "reward: for your own task, not with task='balance'"),
        ({"task": Balance(), "force": 3.0}, "settings need a task name"),
        ({"task": "balance", "weight": 3.0}, "task: no setting 'weight'"),
        ({"reward": centre, "weight": 3.0}, "no argument 'weight'"),
        ({"reward": 1.0}, "reward: expected a function, got float"),
        ({"reward": centre, "terminated": True}, "terminated: expected a function, got bool"),
        ({"reward": centre, "max_steps": 0}, "max_steps: expected a whole number of at least 1"),
        (
            {"reward": centre, "starts": [[0.0]]},
            "starts: expected finite states (N, 2), (q [m], q_dot [m/s]), got",
        ),
        ({"reward": centre, "starts": "here"}, "starts: expected states (N, S), got str"),
        ({"reward": centre, "actions": {"torque": (0, 1)}}, "actions: 'torque' is not one of force"),
        ({"reward": centre, "actions": {"force": (1, 1)}}, "force lies between 1 and 1"),
    ],
)
def test_what_is_refused(made, named, said):
    with pytest.raises(UsageError) as caught:
        gpsim.make_env(made.diagnosis, **named)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("reward", "said"),
    [
        (lambda s, a, n: n["x"], "reward(state, action, next_state) raised KeyError: 'x'"),
        (lambda s, a, n: None, "reward: expected a finite number, got None"),
        (lambda s, a, n: np.nan, "reward: expected a finite number, got nan"),
        (lambda s, a, n: [1.0, 2.0], "reward: expected a finite number, got shape (2,)"),
    ],
)
def test_a_reward_that_is_none(made, reward, said):
    env = gpsim.make_env(made.diagnosis, reward=reward)
    env.reset(seed=0)
    with pytest.raises(UsageError) as caught:
        env.step(np.zeros(1))
    assert said in str(caught.value)


def test_a_step_before_the_first_reset(made):
    with pytest.raises(gymnasium.error.ResetNeeded):
        gpsim.make_env(made.diagnosis, reward=centre).step(np.zeros(1))
    with pytest.raises(
        UsageError, match="expected a diagnosis, its folder or a corrected simulator, got int"
    ):
        gpsim.make_env(3, reward=centre)


@pytest.mark.slow
def test_stable_baselines3_trains_in_it(made):
    from stable_baselines3 import PPO

    env = gpsim.make_env(made.diagnosis, reward=centre, max_steps=20)
    agent = PPO("MlpPolicy", env, n_steps=32, batch_size=32, n_epochs=1, seed=0, device="cpu").learn(64)
    action, _ = agent.predict(env.reset(seed=0)[0], deterministic=True)
    assert action in env.action_space
    assert agent.num_timesteps == 64


@pytest.mark.parametrize("imports", ["gpsim, gymnasium", "gymnasium, gpsim"])
def test_gymnasium_finds_them_whichever_was_imported_first(imports):
    names = ["gpsim/CartPole-v0", "gpsim/Limo-v0", "gpsim:gpsim/CartPole-v0"]
    code = (
        f"import {imports}\n"
        f"print([gymnasium.make(name).reset(seed=0)[0].shape[0] for name in {names}], gymnasium.__loader__)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr
    assert said.stdout.startswith("[4, 2, 4]")
    assert "gpsim" not in said.stdout  # the library's own loader is back in its place


def test_without_gymnasium_gpsim_imports():
    code = "import sys; sys.modules['gymnasium'] = None; import gpsim; print(gpsim.__version__)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr


def test_the_built_in_tasks():
    env = checked(gymnasium.make("gpsim/CartPole-v0", max_steps=5).unwrapped)
    reference = gymnasium.make("CartPole-v1").unwrapped
    reference.reset(seed=0)
    start = np.array([0.01, -0.02, 0.03, 0.04])
    reference.state = start
    env.reset(options={"states": start})
    for action in (0, 1, 1):
        expected = reference.step(action)[0]
        got, reward, terminated, truncated, _ = env.step(action)
        np.testing.assert_allclose(got, expected, rtol=2e-6, atol=2e-6)
        assert (reward, terminated, truncated) == (1.0, False, False)
    checked(gymnasium.make("gpsim/Limo-v0", goal_radius=0.1).unwrapped)
    with pytest.raises(UsageError, match="task: no setting 'weight'"):
        cartpole_env(weight=1.0)


def test_a_task_by_name_in_what_corrects_its_simulator():
    from gpsim.corrected import EffectsPlant
    from gpsim.effects import Gate, Term
    from gpsim.simulators import make_simulator

    simulator = make_simulator("cartpole")
    friction = Term("coulomb_friction", "x", {"force": 9.0}, Gate())
    plant = EffectsPlant(simulator, simulator.defaults(), (friction,), "fine", 4, 0.02)
    env = gpsim.make_env(gpsim.CorrectedSimulator(plant), "balance", max_steps=3, force=8.0)
    assert env.action_space.n == 2
    env.reset(seed=0, options={"states": np.zeros(4)})
    env.step(1)
    assert env.task.force == 8.0
    assert env.state[1] == 0.0  # 8 N do not overcome 9 N
