"""PPO with its inner loops written out: stable-baselines3's numbers, draw for draw."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete
from stable_baselines3 import PPO
from stable_baselines3.common.logger import KVWriter, Logger
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from gpsim.environments import BatchedEnv
from gpsim.policies.training import ppo
from gpsim.policies.training.lean_ppo import ADAM_EPSILON, Batch, Network, limit_norm, write_gradients
from gpsim.policies.training.settings import PpoSettings
from gpsim.simulators import SimulatorPlant, make_simulator
from gpsim.tasks import Balance

CARTPOLE = make_simulator("cartpole")
PLANT = SimulatorPlant(CARTPOLE, CARTPOLE.defaults(), "euler", 0.02)
# The last mini-batch is smaller than the others, and episodes end by time as well as by falling.
SETTINGS = PpoSettings(total_steps=960, n_steps=32, n_envs=10, batch_size=96, n_epochs=3, hidden=(16, 8))
TASK = Balance(max_steps=25)


def library_ppo(*arguments, policy_kwargs, **settings):
    kwargs = {
        "net_arch": policy_kwargs["net_arch"],
        "optimizer_kwargs": {"fused": True, "eps": ADAM_EPSILON},
    }
    return PPO(*arguments, policy_kwargs=kwargs, **settings)


class Collected(KVWriter):
    def __init__(self):
        self.rows = []

    def write(self, key_values, key_excluded, step=0):
        self.rows.append({key: value for key, value in key_values.items() if key.startswith("train/")})

    def close(self):
        pass


def learnt(settings, monkeypatch, kind):
    """Weights after a training, and what was written down of every update."""
    with monkeypatch.context() as patch:
        if kind == "library":
            patch.setattr(ppo, "LeanPPO", library_ppo)
        env = BatchedEnv(PLANT, TASK, settings.n_envs, 3)
        model = ppo._ppo(env, np.ones(4, dtype=np.float32), settings, settings.n_steps, 3)
    assert (type(model) is PPO) == (kind == "library")
    written = Collected()
    model.set_logger(Logger(None, [written]))
    model.learn(settings.total_steps)
    model.logger.dump()
    return {k: v.numpy() for k, v in model.policy.state_dict().items()}, written.rows


@pytest.mark.parametrize("entropy", [0.0, 0.02])
def test_a_training_is_stable_baselines3s_own(entropy, monkeypatch):
    settings = replace(SETTINGS, ent_coef=entropy)
    with pytest.warns(UserWarning, match="mini-batch size"):
        expected, noted = learnt(settings, monkeypatch, "library")
    with pytest.warns(UserWarning, match="mini-batch size"):
        got, written = learnt(settings, monkeypatch, "lean")
    assert expected.keys() == got.keys()
    for name, weights in expected.items():
        np.testing.assert_allclose(got[name], weights, rtol=1e-5, atol=1e-6, err_msg=name)
    assert len(noted) == len(written) == 3 + 1
    for theirs, ours in zip(noted, written, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-4, abs=1e-6)


CLIP, VALUE = 0.2, 0.5


def small_policy(count):
    """A policy with gradients of none, and a batch of observations and actions."""
    torch.manual_seed(count)
    policy = ActorCriticPolicy(Box(-5, 5, (4,)), Discrete(3), lambda _: 1e-3)
    for part in policy.parameters():
        part.data += 0.3 * torch.randn_like(part)
    batch = Batch(
        torch.randn(count, 4),
        torch.randint(0, 3, (count,)),
        -torch.rand(count) - 0.6,
        3.0 * torch.randn(count),
        50.0 * torch.rand(count),
    )
    return policy, batch


def by_graph(policy, batch, entropy):
    """Gradients as the library finds them, and the two terms of which the smaller counts, with the ratio."""
    values, log_probs, entropies = policy.evaluate_actions(batch.observations, batch.actions)
    ratio, advantages = torch.exp(log_probs - batch.log_probs), batch.advantages
    if len(advantages) > 1:
        advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
    free, held = advantages * ratio, advantages * ratio.clamp(1.0 - CLIP, 1.0 + CLIP)
    error = nn.functional.mse_loss(batch.returns, values.flatten())
    policy.zero_grad()
    (-torch.min(free, held).mean() - entropy * entropies.mean() + VALUE * error).backward()
    return [part.grad.clone() for part in policy.parameters()], free, held, ratio


def written_out(policy, batch, entropy):
    hidden = policy.mlp_extractor.policy_net, policy.mlp_extractor.value_net
    actor, critic = (
        Network([layers[0], layers[2], last])
        for layers, last in zip(hidden, (policy.action_net, policy.value_net), strict=True)
    )
    with torch.no_grad():
        write_gradients(actor, critic, batch, CLIP, entropy, VALUE)
    return [part.grad for part in policy.parameters()]


@pytest.mark.parametrize("count", [1, 7, 128])
@pytest.mark.parametrize("entropy", [0.0, 0.1])
def test_the_gradient_of_a_mini_batch_is_that_of_the_graph(count, entropy):
    policy, batch = small_policy(count)
    expected, _, _, ratio = by_graph(policy, batch, entropy)
    assert count == 1 or ((ratio - 1.0).abs() > CLIP).any()  # some are clipped
    nn.utils.clip_grad_norm_(policy.parameters(), 0.5)
    limited = [part.grad.clone() for part in policy.parameters()]
    got = written_out(policy, batch, entropy)
    torch.testing.assert_close(got, expected, rtol=1e-5, atol=1e-5)
    limit_norm(got, 0.5)
    torch.testing.assert_close(got, limited, rtol=1e-5, atol=1e-6)


def test_terms_that_round_alike_beyond_the_limit_count_half_as_in_the_graph():
    policy, batch = small_policy(6000)
    with torch.no_grad():
        _, log_probs, _ = policy.evaluate_actions(batch.observations, batch.actions)
    beyond = math.log(1.0 + CLIP) + 1e-7  # by one step of the numbers, most of them
    batch = batch._replace(log_probs=log_probs - beyond, returns=torch.zeros(6000))
    expected, free, held, ratio = by_graph(policy, batch, 0.0)
    assert ((free == held) & (ratio.clamp(max=1.0 + CLIP) != ratio)).sum() > 20
    torch.testing.assert_close(written_out(policy, batch, 0.0), expected, rtol=1e-5, atol=1e-6)
