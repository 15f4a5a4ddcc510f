"""The goal-reaching task of Table 4.2, and the geometry of what a car can solve."""

import numpy as np
import pytest

from gpsim.environments import BatchedEnv
from gpsim.evaluation import solvable
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.tasks import GoalReaching

UNICYCLE = make_simulator("unicycle")
PLANT = SimulatorPlant(UNICYCLE, {}, "euler", 0.1)


def test_the_observation_is_the_goal_in_the_agents_frame():
    """Against rotation matrices written out."""
    task, rng = GoalReaching(), np.random.default_rng(0)
    start = task.start(50, rng)
    for state, goal, seen in zip(
        start.states, start.context, task.observe(start.states, start.context), strict=True
    ):
        c, s = np.cos(state[2]), np.sin(state[2])
        expected = np.array([[c, s], [-s, c]]) @ (goal - state[:2])
        np.testing.assert_allclose(seen, expected, atol=1e-6)


def test_the_reward_telescopes_to_the_bearing_gained_plus_the_goal():
    task = GoalReaching(max_steps=400)
    env = BatchedEnv(PLANT, task, 1, seed=0)
    start, goal = np.array([[0.0, 0.0, np.pi / 2]]), np.array([[0.5, 0.0]])
    env.reset(options={"states": start, "context": goal})
    total, over = 0.0, False
    turning = np.array([[0.0, -0.3]], dtype=np.float32)
    ahead = np.array([[0.2, 0.0]], dtype=np.float32)
    steps = 0
    while not over:
        facing = abs(task.bearing(env.episodes.states, goal)[0]) < 0.031
        _, reward, ended, late, info = env.step(ahead if facing else turning)
        total, over, steps = total + reward[0], bool(ended[0] or late[0]), steps + 1
    assert ended[0]
    assert not late[0]
    assert np.hypot(*info["final_obs"][0]) <= 0.05 + 1e-6
    last = np.abs(np.arctan2(*info["final_obs"][0][::-1]))
    assert total == pytest.approx(np.pi / 2 - last + 10.0, abs=1e-5)
    assert 50 < steps < 85


def test_an_action_that_is_repeated_is_that_many_single_steps():
    """Ended episodes stay where they ended, and their last observation is from there."""
    task, rng = GoalReaching(max_steps=23), np.random.default_rng(1)
    start = task.start(6, rng)
    start.context[0] = start.states[0, :2] + 0.06 * np.array(
        [np.cos(start.states[0, 2]), np.sin(start.states[0, 2])]
    )
    options = {"states": start.states, "context": start.context}
    many, one = BatchedEnv(PLANT, task, 6, 0, repeat=10), BatchedEnv(PLANT, task, 6, 0)
    many.reset(options=options)
    one.reset(options=options)
    action = np.tile(np.array([[0.2, 0.05]], dtype=np.float32), (6, 1))
    _, rewards, ended, late, info = many.step(action)
    total, done, final = np.zeros(6), np.zeros(6, dtype=bool), np.zeros((6, 2))
    for _ in range(10):
        _, reward, over, _, more = one.step(action)
        total += np.where(done, 0.0, reward)
        fresh = over & ~done
        if fresh.any():
            final[fresh] = more["final_obs"][fresh]
        done |= over
    assert ended.tolist() == done.tolist()
    assert ended[0]
    assert not late.any()
    np.testing.assert_allclose(rewards, total, atol=1e-12)
    np.testing.assert_allclose(info["final_obs"][0], final[0], atol=1e-7)
    for _ in range(2):
        _, _, _, late, _ = many.step(action)
    assert late[1:].all()


def test_geometry_of_turning():
    """Straight ahead needs no room; on the far side of a floor as wide as the car's circle nothing helps."""
    ahead = (np.array([[0.0, 0.0, 0.0]]), np.array([[0.6, 0.0]]))
    back = (np.array([[0.0, 0.0, 0.0]]), np.array([[-0.6, 0.0]]))
    assert solvable(*ahead, radius=0.462, half_floor=0.65, longest=6.9)[0]
    assert not solvable(*back, radius=0.462, half_floor=0.65, longest=6.9)[0]
    assert solvable(*back, radius=0.462, half_floor=1.2, longest=6.9)[0]
    assert not solvable(*back, radius=0.462, half_floor=1.2, longest=1.0)[0]  # half a circle alone is 1.45 m
    # Inside the turning circle: the car must leave and come back.
    near = (np.array([[0.0, 0.0, 0.0]]), np.array([[0.05, 0.3]]))
    assert solvable(*near, radius=0.462, half_floor=2.0, longest=6.9)[0]
    assert not solvable(*near, radius=0.462, half_floor=0.7, longest=6.9)[0]
