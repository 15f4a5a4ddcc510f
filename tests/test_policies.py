"""Training: reproducible to the byte, exported exactly, and able to learn."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from gpsim.environments import BatchedEnv
from gpsim.errors import UsageError
from gpsim.policies import Policy
from gpsim.policies.training.ppo import train_ppo
from gpsim.policies.training.settings import PpoSettings
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.tasks import Balance

CARTPOLE = make_simulator("cartpole")
PLANT = SimulatorPlant(CARTPOLE, CARTPOLE.defaults(), "euler", 0.02)
SMALL = PpoSettings(
    total_steps=640, n_steps=32, n_envs=10, batch_size=64, n_epochs=2, observation_scale=(1, 2, 3, 4)
)


def train(settings, seed=0):
    env = BatchedEnv(PLANT, Balance(), settings.n_envs, seed)
    return train_ppo(env, settings, seed, lambda *_: None)[:2]


def test_same_seed_same_bytes_other_seed_other_policy():
    first, curve = train(SMALL)
    torch.rand(3)  # somebody else's draws must not matter
    np.random.rand(3)  # noqa: NPY002
    again, _ = train(SMALL)
    other, _ = train(SMALL, seed=1)
    for name, weights in first.weights.items():
        assert weights.tobytes() == again.weights[name].tobytes()
    assert any(weights.tobytes() != other.weights[name].tobytes() for name, weights in first.weights.items())
    assert curve.steps.tolist() == [320, 640]


def test_a_watcher_sees_the_policy_before_every_update_and_changes_nothing():
    env, seen = BatchedEnv(PLANT, Balance(), SMALL.n_envs, 0), []
    policy, _, _ = train_ppo(
        env, SMALL, 0, lambda *_: None, lambda steps, policy: seen.append((steps, policy))
    )
    assert [steps for steps, _ in seen] == [320, 640]
    first, second = (policy.weights["layer.0.weight"].tobytes() for _, policy in seen)
    alone, _ = train(SMALL)
    assert len({first, second, policy.weights["layer.0.weight"].tobytes()}) == 3
    assert alone.weights["layer.0.weight"].tobytes() == policy.weights["layer.0.weight"].tobytes()


def test_exported_policy_acts_as_torch_does():
    policy, _ = train(SMALL)
    layers = []
    for i in range(3):
        linear = torch.nn.Linear(*reversed(policy.weights[f"layer.{i}.weight"].shape))
        linear.weight.data = torch.from_numpy(policy.weights[f"layer.{i}.weight"])
        linear.bias.data = torch.from_numpy(policy.weights[f"layer.{i}.bias"])
        layers += [linear, torch.nn.Tanh()]
    network = torch.nn.Sequential(*layers[:-1])
    observations = np.random.default_rng(0).normal(size=(50, 4)).astype(np.float32)
    expected = network(torch.from_numpy(observations / policy.scale)).detach().numpy()
    np.testing.assert_allclose(policy.logits(observations), expected, rtol=1e-4, atol=1e-6)
    assert policy.act(observations).tolist() == expected.argmax(axis=1).tolist()


def test_drawn_actions_follow_the_softmax():
    policy, _ = train(SMALL)
    observation = np.full((20_000, 4), 0.02, dtype=np.float32)
    logits = policy.logits(observation[:1])[0]
    probability = np.exp(logits[1]) / np.exp(logits).sum()
    drawn = policy.act(observation, np.random.default_rng(0))
    assert drawn.mean() == pytest.approx(probability, abs=0.015)


def test_round_trip_and_foreign_files():
    policy, _ = train(SMALL)
    arrays, metadata = policy.to_arrays()
    back = Policy.from_arrays(arrays, metadata)
    observations = np.ones((2, 4), dtype=np.float32)
    assert back.logits(observations).tobytes() == policy.logits(observations).tobytes()
    with pytest.raises(UsageError, match="not a policy"):
        Policy.from_arrays(arrays, {"format": "other"})


def test_training_leaves_nothing_behind(tmp_path, monkeypatch):
    train(SMALL)  # the first of a process has torch make its one cache folder, whatever is trained
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    train(SMALL)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_source_task_is_learnt():
    settings = PpoSettings(total_steps=100_000, observation_scale=(2.4, 0.3, 0.1, 0.5))
    _, curve = train(settings)
    assert curve.mean_return[-3:].mean() > 450


def test_a_training_of_one_update_learns():
    """The schedule counts from an update's start, else the last one would have a learning rate of 0."""
    first = {}
    for rate in (1e-3, 1e-12):
        settings = replace(SMALL, total_steps=320, learning_rate=rate)
        first[rate], _ = train(settings)
    assert any(
        np.abs(first[1e-3].weights[k] - first[1e-12].weights[k]).max() > 1e-5 for k in first[1e-3].weights
    )
