"""The expert that looks ahead, and the policy that learns from it."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest
from gpsim.cli.configuration import resolve

from gpsim.environments import BatchedEnv
from gpsim.errors import UsageError
from gpsim.policies import BeamSearch, balance_search
from gpsim.policies.expert import FAILS, NEARNESS, Expert, Visited
from gpsim.policies.training.expert_iteration import improved
from gpsim.policies.training.ppo import train_ppo
from gpsim.policies.training.settings import PpoSettings
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.stages.stage import Request
from gpsim.stages.train_source import settings_for
from gpsim.targets import FrictionCartPole
from gpsim.tasks import Balance

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


def test_where_it_cannot_look_ahead_one_line_says_so():
    asked = Request(resolve(["policy=expert", "policy.gamma=1.0"], None))
    with pytest.raises(UsageError, match="gamma must be below 1"):
        settings_for(asked, TASK)
    elsewhere = resolve(["policy=expert"], None)
    elsewhere["task"] = {"name": "goal"}
    with pytest.raises(UsageError, match=r"policy.expert_rounds: .*cart-pole"):
        settings_for(Request(elsewhere), TASK)
    assert settings_for(Request(resolve(["policy=expert"], None)), TASK).expert_rounds == 24
