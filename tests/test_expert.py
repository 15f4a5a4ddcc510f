"""The expert that looks ahead, and the policy that learns from it."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest
from gpsim.cli.configuration import resolve

from gpsim.environments import BatchedEnv
from gpsim.errors import UsageError
from gpsim.policies import BeamSearch, Policy, balance_search
from gpsim.policies.expert import FAILS, NEARNESS, Expert, Visited
from gpsim.policies.training import expert_iteration
from gpsim.policies.training.expert_iteration import improved
from gpsim.policies.training.ppo import train_ppo
from gpsim.policies.training.settings import PpoSettings
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.stages.stage import Request
from gpsim.stages.train_source import settings_for
from gpsim.targets import FrictionCartPole
from gpsim.tasks import Balance, Start

CARTPOLE = make_simulator("cartpole")
PLANT = SimulatorPlant(CARTPOLE, CARTPOLE.defaults(), "euler", 0.02)
TASK = Balance(angle_limit=0.12)
HORIZON = 6
COST = balance_search(9.8, 0.5, 1).cost
EVERYTHING = BeamSearch(COST, cells=np.full(4, 1e-9), width=2**HORIZON)


@dataclass(frozen=True)
class Late(SimulatorPlant):
    """A cart that does what it was told a step before."""

    def begin(self, count, rng):
        return {"told": np.zeros((count, 1))}

    def step(self, state, action, memory, rng):
        after = super().step(state, memory["told"], memory, rng)
        memory["told"][:] = action
        return after


def worth(observations):
    """What a critic might say: upright and slow is worth most."""
    return 1.0 - np.abs(observations).sum(axis=1).astype(np.float64)


def visited(plant, count=30):
    rng = np.random.default_rng(5)
    states = rng.uniform(-1, 1, (count, 4)) * [0.5, 0.5, 0.11, 1.2]
    memory = {key: rng.uniform(-10, 10, values.shape) for key, values in plant.begin(count, rng).items()}
    return Visited(states, memory, np.empty((count, 0)), states.astype(np.float32))


def every_sequence(plant, at):
    """(N, 2): the same costs by trying all sequences, one state at a time."""
    ends = [[[], []] for _ in range(len(at))]
    longest = np.zeros((len(at), 2))
    for i, sequence in product(range(len(at)), product((0, 1), repeat=HORIZON)):
        state, memory = at.states[i : i + 1], {k: v[i : i + 1].copy() for k, v in at.memory.items()}
        for lasted, action in enumerate(sequence):
            state = plant.step(state, TASK.command(np.array([action])), memory, None)
            if TASK.terminated(state, np.empty((1, 0)))[0]:
                longest[i, sequence[0]] = max(longest[i, sequence[0]], lasted)
                break
        else:
            cost = NEARNESS * COST(state)[0] + 1.0 - worth(state.astype(np.float32))[0]
            ends[i][sequence[0]].append(cost)
    fallen = FAILS + (HORIZON - longest) / HORIZON
    return np.array([[min(ends[i][a], default=fallen[i, a]) for a in (0, 1)] for i in range(len(at))])


@pytest.mark.parametrize("plant", [PLANT, Late(**vars(PLANT))], ids=["at once", "late"])
def test_it_finds_what_trying_every_sequence_finds(plant):
    """What the plant remembers goes along: a command may act later than it was given."""
    at = visited(plant)
    got = Expert(plant, TASK, EVERYTHING, HORIZON, worth).costs(at, np.random.default_rng(0))
    np.testing.assert_allclose(got, every_sequence(plant, at), rtol=1e-9)
    assert (got > FAILS).any()
    assert (got < FAILS).any()
    assert (got[:, 0] > got[:, 1]).any()
    assert (got[:, 0] < got[:, 1]).any()


SETTINGS = PpoSettings(
    total_steps=640, n_steps=64, n_epochs=4, hidden=(32, 32), observation_scale=(2.4, 0.3, 0.1, 0.5),
    expert_rounds=3, expert_states=1500, expert_width=4, expert_horizon=12,
)  # fmt: skip


def taught(seed=0):
    task, target = Balance(max_steps=150), FrictionCartPole(CARTPOLE.defaults(), 0.9, 0.02)
    first, _, critic = train_ppo(BatchedEnv(target, task, 10, seed), SETTINGS, seed, lambda *_: None)
    expert = Expert(
        target,
        task,
        balance_search(9.8, 0.5, SETTINGS.expert_width),
        SETTINGS.expert_horizon,
        lambda seen: critic.logits(seen)[:, 0].astype(np.float64) / 100.0,
    )
    return first, *improved(first, target, expert, SETTINGS, seed, lambda *_: None)


@pytest.mark.slow
def test_a_policy_learns_from_it_and_the_best_round_is_kept():
    first, best, scores = taught()
    assert scores.steps.tolist() == [0, 1500, 3000, 4500][: len(scores.steps)]
    assert scores.score.max() > 1.5 * scores.score[0]
    assert any(first.weights[name].tobytes() != best.weights[name].tobytes() for name in first.weights)
    _, again, same = taught()
    assert scores.score.tobytes() == same.score.tobytes()
    for name, weights in best.weights.items():
        assert weights.tobytes() == again.weights[name].tobytes()


@pytest.mark.slow
def test_only_what_need_not_have_failed_is_looked_at_closely():
    """A policy that always pushes right drops every pole; from some starts anybody would."""
    task = Balance(start_range=0.12, angle_limit=0.12, max_steps=120)
    weights = {"layer.0.weight": np.zeros((2, 4), np.float32), "layer.0.bias": np.array([0, 1], np.float32)}
    right = Policy(weights, np.ones(4, dtype=np.float32))
    expert = Expert(PLANT, task, balance_search(9.8, 0.5, 4), HORIZON, worth)
    done = expert_iteration._played(right, PLANT, expert, np.random.default_rng(0))
    assert not done.lasted.any()
    saved = expert_iteration._needless(done, expert, np.random.default_rng(1))
    start = Start(done.states[0], done.context)
    wide = balance_search(9.8, 0.5, 64).solvable(PLANT, replace(task, max_steps=100), start, lambda *_: None)
    assert 0 < (~wide).mean() < 0.5
    assert wide[saved].all()
    assert len(saved) > 0.9 * wide.mean() * expert_iteration.FAILED
    steps, episodes = expert_iteration._looked_at(done, 600, expert, np.random.default_rng(1))
    assert len(steps) == len(set(zip(steps, episodes, strict=True))) == 600
    assert done.alive[steps, episodes].all()
    elsewhere = ~np.isin(episodes, saved)
    assert (steps[elsewhere] % expert_iteration.ANYWHERE == 0).all()
    assert 0.2 < elsewhere.mean() <= 1 / 3


def test_where_it_cannot_look_ahead_one_line_says_so():
    asked = Request(resolve(["policy=expert", "policy.gamma=1.0"], None))
    with pytest.raises(UsageError, match="gamma must be below 1"):
        settings_for(asked, TASK)
    elsewhere = resolve(["policy=expert"], None)
    elsewhere["task"] = {"name": "goal"}
    with pytest.raises(UsageError, match=r"policy.expert_rounds: .*cart-pole"):
        settings_for(Request(elsewhere), TASK)
    assert settings_for(Request(resolve(["policy=expert"], None)), TASK).expert_rounds == 24
