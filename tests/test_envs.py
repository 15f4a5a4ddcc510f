"""Environments: Gymnasium's own checker, and the batch against one episode at a time."""

import gymnasium
import numpy as np
import pytest

from gpsim.environments import BatchedEnv
from gpsim.errors import UsageError
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.targets import FrictionCartPole
from gpsim.tasks import Balance, GoalReaching

CARTPOLE = make_simulator("cartpole")
PLANT = SimulatorPlant(CARTPOLE, CARTPOLE.defaults(), "euler", 0.02)


UNICYCLE = SimulatorPlant(make_simulator("unicycle"), {}, "euler", 0.1)


@pytest.mark.parametrize(
    ("plant", "task"), [(PLANT, Balance(max_steps=9)), (UNICYCLE, GoalReaching(max_steps=9))]
)
def test_what_gymnasium_asks_of_a_vector_environment(plant, task):
    """Its checker knows single environments only: spaces, types, shapes, and seeds that decide everything."""

    def played(seed):
        env = BatchedEnv(plant, task, 3, seed=1)
        assert isinstance(env, gymnasium.vector.VectorEnv)
        env.action_space.seed(0)
        seen = [env.reset(seed=seed)[0]]
        for _ in range(20):  # episodes end and begin anew meanwhile
            observations, rewards, terminated, truncated, info = env.step(env.action_space.sample())
            assert observations in env.observation_space
            assert observations.dtype == env.observation_space.dtype
            assert rewards.shape == terminated.shape == truncated.shape == (3,)
            assert terminated.dtype == truncated.dtype == np.bool_
            assert ("final_obs" in info) == bool((terminated | truncated).any())
            seen.append(observations)
        assert env.observation_space == gymnasium.vector.utils.batch_space(env.single_observation_space, 3)
        return np.array(seen)

    np.testing.assert_array_equal(played(5), played(5))
    assert (played(5) != played(6)).any()


def test_the_base_simulator_is_gymnasiums_cartpole():
    """Gymnasium's CartPole-v1 is an independent oracle for the frictionless equations and the Euler step."""
    reference = gymnasium.make("CartPole-v1").unwrapped
    env = BatchedEnv(PLANT, Balance(angle_limit=0.2095), 1, seed=0)
    rng = np.random.default_rng(0)
    for _ in range(20):
        start = rng.uniform(-0.05, 0.05, 4)
        reference.reset(seed=0)
        reference.state = start
        env.reset(options={"states": start})
        for _ in range(100):
            action = int(rng.integers(2))
            expected, _, over, _, _ = reference.step(action)
            got, reward, terminated, _, info = env.step(np.array([action]))
            # Theirs divides before multiplying, and rounds observations to float32.
            np.testing.assert_allclose(info.get("final_obs", got)[0], expected, rtol=2e-6, atol=2e-6)
            assert reward == 1.0
            if over:
                break
        assert terminated[0] == over


def test_a_batch_is_its_episodes_one_by_one():
    target, task = FrictionCartPole(CARTPOLE.defaults(), 0.9, 0.02), Balance()
    rng = np.random.default_rng(0)
    starts = rng.uniform(-0.05, 0.05, (7, 4))
    actions = rng.integers(0, 2, (300, 7))
    batch = BatchedEnv(target, task, 7, seed=0)
    batch.reset(options={"states": starts})
    first_end = np.full(7, -1)
    final = np.zeros((7, 4))
    for k in range(300):
        _, _, terminated, _, info = batch.step(actions[k])
        for i in np.flatnonzero(terminated & (first_end < 0)):
            first_end[i], final[i] = k, info["final_obs"][i]
    for i in range(7):
        single = BatchedEnv(target, task, 1, seed=0)
        single.reset(options={"states": starts[i]})
        for k in range(300):
            _, _, terminated, _, info = single.step(actions[k, i : i + 1])
            if terminated[0]:
                break
        assert terminated[0]
        assert first_end[i] == k
        np.testing.assert_array_equal(final[i], info["final_obs"][0])


def test_time_limit_is_truncation_not_termination():
    env = BatchedEnv(PLANT, Balance(max_steps=3, angle_limit=3.0), 4, seed=0)
    env.reset()
    for k in range(1, 7):
        _, _, terminated, truncated, info = env.step(np.zeros(4, dtype=np.int64))
        assert not terminated.any()
        assert truncated.all() == (k % 3 == 0)
        assert ("final_obs" in info) == (k % 3 == 0)


def test_states_that_are_no_numbers_end_the_episode():
    task = Balance(position_limit=None)
    states = np.array([[0.0, 0.0, np.nan, 0.0], [0.0, 0.0, 0.1, 0.0]])
    assert task.terminated(states, np.empty((2, 0))).tolist() == [True, False]
    assert Balance().terminated(np.array([[2.5, 0, 0, 0.0]]), np.empty((1, 0))).all()
    assert not task.terminated(np.array([[2.5, 0, 0, 0.0]]), np.empty((1, 0))).any()


def test_states_without_a_context_get_the_tasks_own():
    task, states = GoalReaching(), np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 0.0], [-0.5, 0.5, 1.0]])
    env = BatchedEnv(UNICYCLE, task, 3, seed=0)
    seen, _ = env.reset(options={"states": states})
    np.testing.assert_array_equal(env.episodes.states, states)
    np.testing.assert_array_equal(seen, task.observe(states, env.episodes.context))
    assert (np.abs(env.episodes.context) <= task.arena / 2.0 - task.agent_radius).all()
    assert len(np.unique(env.episodes.context)) == 6
    single = BatchedEnv(UNICYCLE, task, 1, seed=1)
    single.reset(seed=0, options={"states": states[0]})
    first = single.episodes.context
    single.reset(seed=0, options={"states": states[0]})
    np.testing.assert_array_equal(single.episodes.context, first)
    single.reset(options={"states": states[0], "context": [0.5, -0.5]})
    np.testing.assert_array_equal(single.episodes.context, [[0.5, -0.5]])


def test_a_task_without_a_context_draws_nothing_for_given_states():
    env, untouched = BatchedEnv(PLANT, Balance(), 2, seed=7), np.random.default_rng(7)
    env.reset(options={"states": np.zeros((2, 4))})
    assert env.episodes.rng.random() == untouched.random()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"states": np.zeros((2, 3))}, r"options\['states'\] must have shape \(3, 3\), got \(2, 3\)"),
        (
            {"states": np.zeros((3, 3)), "context": np.zeros((3, 1))},
            r"options\['context'\] must have shape \(3, 2\), got \(3, 1\)",
        ),
    ],
)
def test_a_start_of_another_shape_is_refused(options, message):
    with pytest.raises(UsageError, match=message):
        BatchedEnv(UNICYCLE, GoalReaching(), 3, seed=0).reset(options=options)
